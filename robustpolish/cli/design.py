"""`robustpolish design`, the main job."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Any

import click

import robustpolish
from robustpolish.cli.any_machine.design import machine_design
from robustpolish.cli.any_machine.either import or_any_machine
from robustpolish.cli.machine import READINGS, machine_options
from robustpolish.cli.options import (
    brush_options,
    check_json,
    result_options,
    show,
    stages,
    to_json,
)
from robustpolish.closed_loop import design_against_brush
from robustpolish.report import render_html
from robustpolish.report.brush_design import (
    brush_design_report,
    brush_design_summary,
    brush_design_text,
    save_brush_design,
)
from robustpolish.saving import new_file, new_folder

DEFAULT_OUT = "robustpolish-results"


@click.command(cls=or_any_machine(machine_design))
@brush_options
@click.option(
    "--ideal",
    is_flag=True,
    help="The thesis's state feedback of twelve states and six ideal forces, instead of what can "
    "be built; so do the options of it below.",
)
@click.option(
    "--actuation",
    type=click.Choice(("force", "displacement")),
    help="Of the ideal, where the control enters: forces (10.41), the default, or (10.40).",
)
@click.option("--norm", type=click.Choice(("hinf", "h2")), help="Of the ideal; hinf by default.")
@click.option("--method", type=click.Choice(("lmi", "riccati")), help="Of the ideal.")
@click.option("--backend", type=click.Choice(("cvxpy", "picos")), help="Of the ideal.")
@click.option(
    "--control-weight",
    type=float,
    help="Of the ideal: price of a unit of control in metres; 1e-7 for forces and 1e-8 for "
    "velocities, unless a gain bound is given.",
)
@click.option(
    "--gain-bound", type=float, help="Of the ideal: largest singular value that the gain may have."
)
@machine_options
@click.option(
    "--out", type=click.Path(file_okay=False), help="Folder for table, figure, code and signals."
)
@click.option(
    "--report",
    is_flag=False,
    flag_value="",
    metavar="[FILE]",
    help="Write an HTML report to FILE, or to report.html in the folder.",
)
@result_options
def design(
    ideal: bool,
    reading: str,
    dissipation: float,
    out: str | None,
    report: str | None,
    json_out: str | None,
    force: bool,
    **options: Any,
) -> None:
    """Design a controller for the polishing robot, certify it and try it on the brush.

    By default one that can be built: two gap sensors, two actuators, a computer at 20 kHz. The
    same forces drive the machine with and without control; the table shows the largest deviations.
    """
    check_json(json_out, force)
    if report == "" and out is None:
        out = DEFAULT_OUT
    with ExitStack() as places:
        # The places are claimed first: no result is computed that could not be saved.
        folder = places.enter_context(new_folder(out, force)) if out else None
        page = places.enter_context(new_file(report, force, (".html",))) if report else None
        tell = places.enter_context(stages("Designing"))
        job = design_against_brush(
            realisation="ideal" if ideal else None,
            parameters=READINGS[reading](),
            dissipation=dissipation,
            tell=tell,
            **options,
        )
        summary = brush_design_summary(job)
        if report is not None:
            tell("Writing the report ...")
            html = render_html(brush_design_report(job), robustpolish.__version__)
            (page or _in(folder) / "report.html").write_text(html, encoding="utf-8")
        if folder is not None:
            save_brush_design(job, folder)
            (folder / "design.json").write_text(to_json(summary) + "\n", encoding="utf-8")
    show(summary, brush_design_text(job), json_out, force)
    for place in filter(None, (out, report)):
        click.echo(f"Saved {place}", err=True)


def _in(folder: Path | None) -> Path:
    assert folder is not None, "a report without a file name goes to the folder"
    return folder
