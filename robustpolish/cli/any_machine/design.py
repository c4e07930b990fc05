"""`robustpolish design` for any machine."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Any

import click

import robustpolish
from robustpolish.cli.any_machine.options import channel_options, machine_options, named_machine
from robustpolish.cli.options import check_json, options, result_options, show, stages, to_json
from robustpolish.machine_design import design_machine, read_design_task
from robustpolish.machine_design.task import METHODS
from robustpolish.report import render_html
from robustpolish.report.machine_design import machine_design_report, save_machine_design
from robustpolish.saving import new_file, new_folder
from robustpolish.validation import described, invalid, positive

DEFAULT_OUT = "robustpolish-results"

_controller_options = options(
    click.option("--control", multiple=True, metavar="NAME", help="What acts; repeatable."),
    click.option("--measure", multiple=True, metavar="NAME", help="What is measured; repeatable."),
    channel_options,
    click.option("--full-state", is_flag=True, default=None, help="Measure all states."),
    click.option("--norm", type=click.Choice(("hinf", "h2")), help="Minimised; hinf by default."),
    click.option("--method", type=click.Choice(METHODS), help="auto by default."),
    click.option("--order", type=int, help="States of the controller; as many as it takes."),
    click.option(
        "--control-weight",
        multiple=True,
        metavar="[NAME=]SIZE",
        help="Price of a unit of control in units of what is kept small.",
    ),
    click.option(
        "--noise",
        multiple=True,
        metavar="[NAME=]SIZE",
        help="Noise on measurements in their units, per unit of a disturbance.",
    ),
    click.option("--sample-rate", type=float, help="Sample the controller so often, in Hz."),
    click.option("--delay", type=float, help="Seconds from a sample until its control acts."),
    click.option("--anti-aliasing", type=float, help="Corner of a Butterworth filter, in Hz."),
)


@click.command("design")
@machine_options
@click.option(
    "--weights",
    type=click.Path(),
    help="TOML file with the sections [design] and [weights], instead of those of the model.",
)
@_controller_options
@click.option(
    "--out", type=click.Path(file_okay=False), help="Folder for design, plant, table and figure."
)
@click.option(
    "--report",
    is_flag=False,
    flag_value="",
    metavar="[FILE]",
    help="Write an HTML report to FILE, or to report.html in the folder.",
)
@result_options
def machine_design(
    model: str | None,
    plant: str | None,
    weights: str | None,
    out: str | None,
    report: str | None,
    json_out: str | None,
    force: bool,
    **given: Any,
) -> None:
    """Design a controller for a machine, certify it and tell what its loop is like.

    The machine is a mechanical model (TOML), effects linearised about the state of rest, or a
    plant (JSON). What its sections [design] and [weights] say counts unless an option says
    otherwise. `robustpolish margins` and `export` read the design.json of the folder.
    """
    check_json(json_out, force)
    if report == "" and out is None:
        out = DEFAULT_OUT
    machine = named_machine(model, plant)
    source = Path(model) if model is not None and weights is None else machine
    section = None if weights is None else Path(weights)
    task = read_design_task(source, section, **_changes(given))
    with ExitStack() as places:
        # The places are claimed first: no result is computed that could not be saved.
        folder = places.enter_context(new_folder(out, force)) if out else None
        page = places.enter_context(new_file(report, force, (".html",))) if report else None
        for note in task.notes:
            click.echo(f"... {note}", err=True)
        tell = places.enter_context(stages("Designing"))
        found = design_machine(task)
        content = found.to_dict()
        to_json(content)  # nothing is written if anything fails
        if report is not None:
            tell("writing the report")
            html = render_html(machine_design_report(found), robustpolish.__version__)
            target = page if page is not None or folder is None else folder / "report.html"
            assert target is not None, "a report without a file name goes to the folder"
            target.write_text(html, encoding="utf-8")
        if folder is not None:
            save_machine_design(found, folder)
    words = [click.wrap_text(text, 88) for text in (*found.notes, found.analysis.explain())]
    lines = repr(found).splitlines()[: -len(words)]
    show(content, "\n".join([*lines, "", *words]), json_out, force)
    for place in filter(None, (out, report)):
        click.echo(f"Saved {place}", err=True)


def _changes(given: dict[str, Any]) -> dict[str, Any]:
    """Return what was said on the command line, by the names of a task."""
    names = {
        "controls": given["control"],
        "measurements": given["measure"],
        "performance": given["performance"],
        "disturbances": given["disturbance"],
        "control_weight": _sizes("--control-weight", given["control_weight"]),
        "measurement_noise": _sizes("--noise", given["noise"]),
        "sample_rate_hz": given["sample_rate"],
        "computation_delay": given["delay"],
        "anti_aliasing_hz": given["anti_aliasing"],
        **{name: given[name] for name in ("full_state", "norm", "method", "order")},
    }
    return {name: value for name, value in names.items() if value not in (None, ())}


def _sizes(option: str, items: tuple[str, ...]) -> float | dict[str, float] | None:
    """Read one number for all, or NAME=SIZE for each."""
    found: dict[str, float] = {}
    for item in items:
        name, equals, size = item.rpartition("=")
        value = positive(option, size, zero=True)
        if not equals:
            if len(items) > 1:
                shown, want = described(f"{item} besides others"), "one number, or NAME=SIZE each"
                raise invalid(option, shown, want, "Name the signals.")
            return value
        found[name] = value
    return found or None
