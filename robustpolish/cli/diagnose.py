"""`robustpolish diagnose`."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import click
import xarray as xr

import robustpolish
from robustpolish.cli.measurement import (
    Reading,
    data_argument,
    load_records,
    measurement_options,
    replaceable,
)
from robustpolish.cli.options import result_options, show, to_json
from robustpolish.errors import RobustPolishError
from robustpolish.identification import Comparison, compare
from robustpolish.identification.discover.diagnose import diagnose as diagnose_model
from robustpolish.models import MechanicalModel
from robustpolish.report.diagnosis import diagnosis_report
from robustpolish.report.html import render_html
from robustpolish.saving import new_file


@click.command()
@data_argument
@click.option("--model", required=True, type=click.Path(), help="Mechanical model, a TOML file.")
@click.option("--save", type=click.Path(dir_okay=False), help="Save the extended model (.toml).")
@click.option("--report", type=click.Path(dir_okay=False), help="Save a report (.html).")
@measurement_options
@result_options
def diagnose(
    data: tuple[str, ...],
    model: str,
    save: str | None,
    report: str | None,
    reading: Reading,
    json_out: str | None,
    force: bool,
) -> None:
    """Learn which physical effect a model lacks, and add it.

    DATA is a measurement (CSV, MAT, HDF5, NPZ, WAV; TDMS and UFF with the extra [io]) with the
    model's inputs and outputs as columns, or several of them, such as blows of different strength,
    to all of which the options apply: the numbers of the machine are common. The exit code is 0
    whatever the verdict, and 2 for bad input.
    """
    loaded = MechanicalModel.from_toml(Path(model))
    records = load_records(data, loaded, reading)
    with ExitStack() as places:
        # The places are claimed first: nothing is computed that could not be saved.
        drafts = {
            path: places.enter_context(
                new_file(path, force or replaceable(path, *data, model), (suffix,))
            )
            for path, suffix in ((save, ".toml"), (report, ".html"))
            if path is not None
        }
        result = diagnose_model(
            loaded, records, progress=lambda text: click.echo(f"... {text}", err=True)
        )
        content = result.to_dict()
        to_json(content)  # nothing is written if anything fails
        if save is not None:
            drafts[save].write_text(result.model.to_toml(), encoding="utf-8")
        if report is not None:
            held = [_held(each, records) for each in (loaded, result.model)]
            page = render_html(diagnosis_report(result, *held), robustpolish.__version__)
            drafts[report].write_text(page, encoding="utf-8")
    replace = force or replaceable(json_out, *data, model)
    show(content, result.explain(), json_out, replace)


def _held(model: MechanicalModel, records: dict[str, xr.Dataset]) -> Comparison | None:
    """Hold a model against the data; a model that cannot be has no picture in the report."""
    try:
        return compare(model, records)
    except RobustPolishError:
        return None
