"""`robustpolish diagnose`."""

from __future__ import annotations

from collections.abc import Callable
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
from robustpolish.cli.options import check_json, result_options, show, stages, to_json
from robustpolish.errors import RobustPolishError
from robustpolish.identification import Diagnosis, ToldApart, step_runs, tell_apart
from robustpolish.identification.discover.diagnose import diagnose as diagnose_model
from robustpolish.identification.record import over_time
from robustpolish.models import MechanicalModel
from robustpolish.report.diagnosis import diagnosis_report
from robustpolish.report.html import render_html
from robustpolish.saving import new_file

_PAIRS = 2
"""Pairs of alike effects that a report proposes experiments for: each costs a refit."""


@click.command()
@data_argument
@click.option("--model", required=True, type=click.Path(), help="Mechanical model, a TOML file.")
@click.option(
    "--save",
    type=click.Path(dir_okay=False),
    help="Save the extended model (.toml), or the whole diagnosis (.json).",
)
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
    replace = force or replaceable(json_out, *data, model)
    check_json(json_out, replace)
    loaded = MechanicalModel.from_toml(Path(model))
    for path in data:
        over_time(path)
    records = load_records(data, loaded, reading)
    with ExitStack() as places:
        # The places are claimed first: nothing is computed that could not be saved.
        drafts = {
            path: places.enter_context(
                new_file(path, force or replaceable(path, *data, model), suffixes)
            )
            for path, suffixes in ((save, (".toml", ".json")), (report, (".html",)))
            if path is not None
        }
        tell = places.enter_context(stages("Diagnosing"))
        result = diagnose_model(loaded, records, progress=tell)
        content = result.to_dict()
        to_json(content)  # nothing is written if anything fails
        if save is not None:
            if Path(save).suffix == ".json":
                result.save(drafts[save], force=True)
            else:
                drafts[save].write_text(result.model.to_toml(), encoding="utf-8")
        if report is not None:
            runs, told = step_runs(result, records), _told_apart(result, records, tell)
            page = render_html(
                diagnosis_report(result, runs=runs, told=told), robustpolish.__version__
            )
            drafts[report].write_text(page, encoding="utf-8")
    show(content, result.explain(), json_out, replace)


def _told_apart(
    result: Diagnosis, records: dict[str, xr.Dataset], tell: Callable[[str], None]
) -> list[ToldApart]:
    """Search experiments for the first pairs that the record does not tell apart.

    A pair costs a refit; one that cannot be fitted has no experiment in the report. Of several
    records the longest is taken.
    """
    record = max(records.values(), key=lambda data: data.sizes["time"])
    found = []
    for pair in range(min(_PAIRS, len(result.indistinguishable))):
        try:
            found.append(tell_apart(result, record, pair=pair, progress=tell))
        except (RobustPolishError, ArithmeticError):
            continue
    return found
