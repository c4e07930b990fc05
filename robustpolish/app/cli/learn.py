"""Commands on measurements: `compare`, `diagnose`, `refit` and `tell-apart`."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import click
import xarray as xr

import robustpolish
from robustpolish.app.cli.options import (
    Reading,
    data_argument,
    load_data,
    load_records,
    load_response,
    measurement_options,
    options,
    pairs,
    replaceable,
    result_options,
    save_picture,
    stages,
    to_json,
)
from robustpolish.app.documents import diagnosis_report
from robustpolish.app.html import render_html
from robustpolish.base.atomic_writes import new_file
from robustpolish.base.checks import described, invalid, positive
from robustpolish.errors import RobustPolishError
from robustpolish.identification.compare import compare as compare_model
from robustpolish.identification.diagnose import diagnose as diagnose_model
from robustpolish.identification.diagnosis.result import Diagnosis
from robustpolish.identification.record import require_time_data
from robustpolish.identification.refit import refit as refit_model
from robustpolish.identification.residuals import residual_analysis
from robustpolish.identification.steps import step_runs
from robustpolish.identification.tell_apart import ToldApart
from robustpolish.identification.tell_apart import tell_apart as tell_machines_apart
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.signals.frequency_response import holds_frequency_response

# `robustpolish compare`.


@click.command()
@data_argument
@click.option("--model", required=True, type=click.Path(), help="Mechanical model, a TOML file.")
@click.option("--window", type=float, help="Start anew after so many SECONDS: short free runs.")
@click.option("--horizon", type=float, help="Predict so many SECONDS ahead from the outputs.")
@measurement_options
@click.option("--residuals", is_flag=True, help="Show where the error is.")
@click.option("--plot", type=click.Path(dir_okay=False), help="Save the pictures (.png, .svg).")
@result_options
def compare(
    data: tuple[str, ...],
    model: str,
    window: float | None,
    horizon: float | None,
    reading: Reading,
    residuals: bool,
    plot: str | None,
    force: bool,
) -> tuple[Any, ...]:
    """Simulate a model on measured inputs and compare it with the measured outputs.

    DATA is a measurement (CSV, MAT, HDF5, NPZ, WAV; TDMS and UFF with the extra [io]) with the
    model's inputs and outputs as columns, or several of them, to all of which the options apply:
    each is run by itself, and the error is told over all and of each. Or it holds frequency
    responses (CSV with a column "frequency [Hz]", UFF 58), which are compared with those of the
    model. The exit code is 0 however well the model fits, and 2 for bad input.
    """
    loaded = MechanicalModel.from_toml(Path(model))
    if any(holds_frequency_response(path) for path in data):
        given = {"--window": window, "--horizon": horizon, "--residuals": residuals or None}
        result = compare_model(loaded, load_response(data, reading, given))
        content, lines = result.to_dict(), [repr(result)]
    else:
        records = load_records(data, loaded, reading)
        result = compare_model(loaded, records, window=window, horizon=horizon)
        content = result.to_dict()
        lines = [repr(result), *(f"  {note}" for note in result.data.attrs["notes"])]
        if residuals:
            analysis = residual_analysis(result)
            content["residuals"] = analysis.to_dict()
            lines.append(analysis.explain())
    to_json(content)  # nothing is written if anything fails
    save_picture(plot, force, result.plot_panels)
    return content, "\n".join(lines)


# `robustpolish diagnose`.

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
    force: bool,
) -> tuple[Any, ...]:
    """Learn which physical effect a model lacks, and add it.

    DATA is a measurement (CSV, MAT, HDF5, NPZ, WAV; TDMS and UFF with the extra [io]) with the
    model's inputs and outputs as columns, or several of them, such as blows of different strength,
    to all of which the options apply: the numbers of the machine are common. The exit code is 0
    whatever the verdict, and 2 for bad input.
    """
    loaded = MechanicalModel.from_toml(Path(model))
    for path in data:
        require_time_data(path)
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
    return content, result.explain()


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
            found.append(tell_machines_apart(result, record, pair=pair, progress=tell))
        except (RobustPolishError, ArithmeticError):
            continue
    return found


# `robustpolish refit`.


@click.command()
@data_argument
@click.option("--model", required=True, type=click.Path(), help="Mechanical model, a TOML file.")
@click.option("--save", type=click.Path(dir_okay=False), help="Save the fitted model (.toml).")
@measurement_options
@result_options
def refit(
    data: tuple[str, ...],
    model: str,
    save: str | None,
    reading: Reading,
    force: bool,
) -> tuple[Any, ...]:
    """Fit the numbers of a model, those of its effects included.

    DATA is a measurement (CSV, MAT, HDF5, NPZ, WAV; TDMS and UFF with the extra [io]) with the
    model's inputs and outputs as columns, or several of them, to all of which the options apply:
    the numbers of the machine are common. Or it holds frequency responses (CSV with a column
    "frequency [Hz]", UFF 58). The exit code is 0 however well the model fits, and 2 for bad input.
    """
    loaded = MechanicalModel.from_toml(Path(model))
    if any(holds_frequency_response(path) for path in data):
        given = load_response(data, reading, {})
    else:
        given = load_records(data, loaded, reading)
    with ExitStack() as places:
        # The place is claimed first: nothing is computed that could not be saved.
        draft = None if save is None else places.enter_context(new_file(save, force, (".toml",)))
        result = refit_model(loaded, given)
        content = result.to_dict()
        to_json(content)  # nothing is written if anything fails
        if draft is not None:
            draft.write_text(result.model.to_toml(), encoding="utf-8")
    return content, repr(result)


_conditions = options(
    click.option(
        "--noise",
        "noises",
        multiple=True,
        metavar="OUTPUT=SIZE",
        help="Standard deviation in SI units, as in x=2e-6; repeatable.",
    ),
    click.option(
        "--limit",
        "limits",
        multiple=True,
        metavar="SIGNAL=SIZE",
        help="Largest value of an input or output in SI units, as in F=50; repeatable.",
    ),
)


@click.command("tell-apart")
@click.argument("data", type=click.Path())
@click.argument("machines", nargs=-1, required=True, type=click.Path())
@click.option("--pair", default=1, show_default=True, help="Which of a diagnosis's pairs.")
@_conditions
@click.option("--fit/--no-fit", default=True, help="Fit the machines to DATA first, or not.")
@measurement_options
@click.option("--plot", type=click.Path(dir_okay=False), help="Save the picture (.png, .svg).")
@result_options
def tell_apart(
    data: str,
    machines: tuple[str, ...],
    pair: int,
    noises: tuple[str, ...],
    limits: tuple[str, ...],
    fit: bool,
    reading: Reading,
    plot: str | None,
    force: bool,
) -> tuple[Any, ...]:
    """Find the experiment that tells two machines apart which DATA does not.

    MACHINES is a diagnosis, as `robustpolish diagnose --save found.json` writes it, or two models
    (TOML). Both machines are simulated in some twenty experiments, at 0.3 to 10 times the
    amplitudes of DATA. The exit code is 0 whether one tells them apart or none does, and 2 for
    bad input.
    """
    given = _machines(machines)
    model = given.model if isinstance(given, Diagnosis) else given[0]
    require_time_data(data)
    record = load_data(data, model, reading)
    with stages("Trying experiments") as tell:
        found = tell_machines_apart(
            given,
            record,
            pair=pair - 1,
            noise=_sizes("--noise", noises, "--noise x=2e-6"),
            limits=_sizes("--limit", limits, "--limit F=50"),
            fit=fit,
            progress=tell,
        )
    content = found.to_dict()
    to_json(content)  # nothing is written if anything fails
    save_picture(plot, force, found.plot_panels)
    return content, repr(found)


def _machines(paths: tuple[str, ...]) -> Diagnosis | tuple[MechanicalModel, MechanicalModel]:
    """Load a diagnosis, or two models."""
    if len(paths) == 1 and Path(paths[0]).suffix == ".json":
        return Diagnosis.load(paths[0])
    if len(paths) != 2:
        shown = described(f"{len(paths)} files: {', '.join(paths)}")
        raise invalid(
            "MACHINES", shown, "one diagnosis (.json), or two models (.toml)", "Add the other one."
        )
    first, second = (MechanicalModel.from_toml(Path(path)) for path in paths)
    return first, second


def _sizes(option: str, items: tuple[str, ...], example: str) -> dict[str, float]:
    given = pairs(option, items, "NAME=SIZE", example)
    return {name: positive(option, value, "SI units") for name, value in given.items()}
