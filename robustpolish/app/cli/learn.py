"""Commands on models and measurements: from `model` and `compare` to `tell-apart`."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Sequence
from contextlib import ExitStack, nullcontext
from pathlib import Path
from typing import Any

import click
import xarray as xr

import robustpolish
from robustpolish.app.cli import options as cli
from robustpolish.app.documents import diagnosis_report
from robustpolish.app.html import render_html
from robustpolish.base.atomic_writes import new_file
from robustpolish.base.checks import described, invalid, positive
from robustpolish.base.saved import read_saved, write_saved
from robustpolish.errors import RobustPolishError
from robustpolish.identification.compare import compare as compare_model
from robustpolish.identification.compare import step_runs
from robustpolish.identification.diagnose import diagnose as diagnose_model
from robustpolish.identification.diagnosis import Diagnosis, ledger_from
from robustpolish.identification.findings import Ledger
from robustpolish.identification.look import look as look_at
from robustpolish.identification.record import require_time_data
from robustpolish.identification.refit import refit as refit_model
from robustpolish.identification.residuals import residual_analysis
from robustpolish.identification.search.search import MOST_EFFECTS
from robustpolish.identification.tell_apart import ToldApart
from robustpolish.identification.tell_apart import tell_apart as tell_machines_apart
from robustpolish.identification.trial import try_effect
from robustpolish.signals.frequency_response import holds_frequency_response

# `robustpolish look`.

_INPUTS = "What drives the machine, as F,M; by default guessed from units and names."


@click.command()
@click.argument("data", type=click.Path())
@cli.option("--inputs", _INPUTS, metavar="F,M")
@cli.option("--out", "Write the drafted model to a file (.toml).", cli.FILE)
@cli.measurement_options
@cli.option("--plot", "Save the picture of the responses (.png, .svg).", cli.FILE)
@cli.result_options
def look(
    data: str, inputs: str | None, out: str | None, reading: cli.Reading, plot: str | None,
    force: bool,
) -> tuple[Any, ...]:  # fmt: skip
    """Show what a measurement holds, and draft a model of it.

    DATA is a measurement (CSV, MAT, HDF5, NPZ, WAV; TDMS and UFF with the extra [io]). Channels,
    gaps, limits, noise, likely modes, feedback and holds are reported; --columns selects the
    outputs. The numbers of the model are guesses. The exit code is 0 whatever is found, and 2 for
    bad input.
    """
    with new_file(out, force, (".toml",)) if out is not None else nullcontext() as draft:
        ends = {"inputs": inputs, "outputs": reading.columns}
        names = {end: cli.split_names(text) for end, text in ends.items() if text is not None}
        found = look_at(data, **names, **cli.read_as(reading))
        if draft is not None and found.draft is None:
            remedy = "Name them with --inputs and --columns, or write a model by hand."
            raise invalid("--out", described("no output to draft a model of"), "outputs", remedy)
        content, text = found.to_dict(), repr(found)
        cli.to_json(content)  # nothing is written if anything fails
        if draft is not None and found.draft is not None:
            draft.write_text(found.draft.to_toml(), encoding="utf-8")
    cli.save_picture(plot, force, lambda: found.plot().figure)
    return content, text.replace("RUN.csv", data).replace("DRAFT.toml", out or "DRAFT.toml"), out


# `robustpolish compare`.


_model = cli.option(
    "--model",
    "Mechanical model: a TOML file, or air-bearing (air-bearing:as-printed).",
    click.Path(),
    required=True,
)


_ADDED = "An effect and where it acts, as in 'coulomb_friction x ground force=2'; repeatable."


def _changes(option: str, texts: tuple[str, ...]) -> list[tuple[str, list[str], dict[str, float]]]:
    """Read effects as kind, place and perhaps parameters, such as 'coulomb_friction x ground'."""
    found = []
    for text in texts:
        kind, *rest = text.split() or [""]
        given = cli.pairs(option, tuple(w for w in rest if "=" in w), "NAME=VALUE", "force=2")
        at = [word for word in rest if "=" not in word]
        if not at:
            remedy = f"Write {option} 'coulomb_friction x ground'."
            raise invalid(option, text, "a kind of effect and a place", remedy)
        try:
            found.append((kind, at, {name: float(value) for name, value in given.items()}))
        except ValueError:
            raise invalid(option, text, "numbers behind =", "Write force=2.") from None
    return found


@click.command("model")
@click.argument("name")
@cli.repeatable("--add added", "'KIND PLACE ... NUMBER=VALUE ...'", _ADDED)
@cli.option("--out", "Write the model to a file (.toml).", cli.FILE)
@cli.result_options
def model_(name: str, added: tuple[str, ...], out: str | None, force: bool) -> tuple[Any, ...]:
    """Show a mechanical model as TOML, to be changed and given to other commands.

    NAME is air-bearing, air-bearing:as-printed, air-bearing:as-corrected, a TOML file, or a ready
    machine such as cart_and_pendulum.
    """
    loaded = cli.mechanical_model(name)
    for kind, at, numbers in _changes("--add", added):
        loaded = loaded.with_effect(kind, at, numbers)
    shown = loaded.to_toml()
    if out is not None:
        with new_file(out, force, (".toml",)) as draft:
            draft.write_text(shown, encoding="utf-8")
    return {"toml": shown}, shown if out is None else f"The model is in {out}."


@click.command()
@cli.data_argument
@_model
@cli.option("--window", "Start anew after so many SECONDS: short free runs.", float)
@cli.option("--horizon", "Predict so many SECONDS ahead from the outputs.", float)
@cli.measurement_options
@cli.option("--residuals", "Show where the error is.", is_flag=True)
@cli.option("--plot", "Save the pictures (.png, .svg).", cli.FILE)
@cli.result_options
def compare(
    data: tuple[str, ...], model: str, window: float | None, horizon: float | None,
    reading: cli.Reading, residuals: bool, plot: str | None, force: bool,
) -> tuple[Any, ...]:  # fmt: skip
    """Simulate a model on measured inputs and compare it with the measured outputs.

    DATA is a measurement (CSV, MAT, HDF5, NPZ, WAV; TDMS and UFF with the extra [io]) with the
    model's inputs and outputs as columns, or several of them, to all of which the options apply:
    each is run by itself, and the error is told over all and of each. Or it holds frequency
    responses (CSV with a column "frequency [Hz]", UFF 58), which are compared with those of the
    model. The exit code is 0 however well the model fits, and 2 for bad input.
    """
    loaded = cli.mechanical_model(model)
    if any(holds_frequency_response(path) for path in data):
        given = {"--window": window, "--horizon": horizon, "--residuals": residuals or None}
        result = compare_model(loaded, cli.load_response(data, reading, given))
        content, lines = result.to_dict(), [repr(result)]
    else:
        records = cli.load_records(data, loaded, reading)
        result = compare_model(loaded, records, window=window, horizon=horizon)
        content = result.to_dict()
        lines = [repr(result)]
        if residuals:
            analysis = residual_analysis(result)
            content["residuals"] = analysis.to_dict()
            lines.append(analysis.explain())
    cli.to_json(content)  # nothing is written if anything fails
    cli.save_picture(plot, force, result.plot_panels)
    return content, "\n".join(lines)


# `robustpolish diagnose`.

_GOOD_ENOUGH = (
    "Error at which nothing more is sought: a share of every output's deviation, as 1%, or of one "
    "output in SI units, as x=2e-6; repeatable."
)


def _good_enough(
    context: click.Context, option: click.Parameter, given: tuple[str, ...]
) -> float | dict[str, float] | None:
    """Read ``1%`` or ``x=2e-6``."""
    shares = [text for text in given if text.endswith("%")]
    if shares and len(given) > 1:
        raise click.BadParameter("expected one share, or outputs by name", context, option)
    try:
        if shares:
            return float(shares[0][:-1]) / 100
        pairs = [text.partition("=")[::2] for text in given]
        return {name: float(value) for name, value in pairs} or None
    except ValueError:
        raise click.BadParameter(
            f"got {' '.join(given)!r}, expected 1% or x=2e-6", context, option
        ) from None


_PAIRS = 2
"""Pairs of alike effects that a report proposes experiments for: each costs a refit."""


@click.command()
@cli.data_argument
@_model
@cli.option("--save", "Save the extended model (.toml), or the whole diagnosis (.json).", cli.FILE)
@cli.option("--report", "Save a report (.html).", cli.FILE)
@cli.option("--time-limit", "Seconds after which the best so far is returned.", float)
@cli.option("--max-effects", "Effects that are added at most.", int, MOST_EFFECTS)
@click.option("--good-enough", multiple=True, callback=_good_enough, help=_GOOD_ENOUGH)
@cli.measurement_options
@cli.result_options
def diagnose(
    data: tuple[str, ...], model: str, save: str | None, report: str | None,
    time_limit: float | None, max_effects: int, good_enough: float | dict[str, float] | None,
    reading: cli.Reading, force: bool,
) -> tuple[Any, ...]:  # fmt: skip
    """Learn which physical effect a model lacks, and add it.

    DATA is a measurement (CSV, MAT, HDF5, NPZ, WAV; TDMS and UFF with the extra [io]) with the
    model's inputs and outputs as columns, or several of them, such as blows of different strength,
    to all of which the options apply: the numbers of the machine are common. Ctrl-C ends the search
    with the best so far, which is saved and reported as usual. The exit code is 0 whatever the
    verdict, and 2 for bad input.
    """
    loaded = cli.mechanical_model(model)
    for path in data:
        require_time_data(path)
    records = cli.load_records(data, loaded, reading)
    with ExitStack() as places:
        # The places are claimed first: nothing is computed that could not be saved.
        drafts = {}
        for path, suffixes in ((save, (".toml", ".json")), (report, (".html",))):
            if path is not None:
                replace = force or cli.replaceable(path, *data, model)
                drafts[path] = places.enter_context(new_file(path, replace, suffixes))
        tell = places.enter_context(cli.stages("Diagnosing"))
        result = diagnose_model(
            loaded,
            records,
            progress=tell,
            time_limit=time_limit,
            max_effects=max_effects,
            good_enough=good_enough,
        )
        content = result.to_dict()
        cli.to_json(content)  # nothing is written if anything fails
        if save is not None:
            if Path(save).suffix == ".json":
                result.save(drafts[save], force=True)
            else:
                drafts[save].write_text(result.model.to_toml(), encoding="utf-8")
        if report is not None:
            runs = step_runs(result, records)
            experiments = _told_apart(result, records, tell)
            shown = diagnosis_report(result, runs=runs, experiments=experiments)
            page = render_html(shown, robustpolish.__version__)
            drafts[report].write_text(page, encoding="utf-8")
    return content, "\n".join([result.explain(), *_steps_by_hand(result, data, model)])


def _steps_by_hand(result: Diagnosis, data: Sequence[str], model: str) -> list[str]:
    """Return the commands that take the steps of a diagnosis one by one."""
    lines = []
    for number, effect in enumerate(result.effects, 1):
        if effect.own is None and not effect.definition.over:  # it is named by words alone
            change, saved = " ".join([effect.kind, *effect.at]), f"step_{number}.toml"
            call = ["robustpolish", "try", *data, "--model", model, "--add", change]
            lines.append(f"   {shlex.join([*call, '--ledger', 'steps.json', '--save', saved])}")
            model = saved
    return ["", "To take the steps one by one:", *lines] if lines else []


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
@cli.data_argument
@_model
@cli.option("--save", "Save the fitted model (.toml).", cli.FILE)
@cli.measurement_options
@cli.result_options
def refit(
    data: tuple[str, ...], model: str, save: str | None, reading: cli.Reading, force: bool
) -> tuple[Any, ...]:
    """Fit the numbers of a model, those of its effects included.

    DATA is a measurement (CSV, MAT, HDF5, NPZ, WAV; TDMS and UFF with the extra [io]) with the
    model's inputs and outputs as columns, or several of them, to all of which the options apply:
    the numbers of the machine are common. Or it holds frequency responses (CSV with a column
    "frequency [Hz]", UFF 58). The exit code is 0 however well the model fits, and 2 for bad input.
    """
    loaded = cli.mechanical_model(model)
    if any(holds_frequency_response(path) for path in data):
        given = cli.load_response(data, reading, {})
    else:
        given = cli.load_records(data, loaded, reading)
    # The place is claimed first: nothing is computed that could not be saved.
    with new_file(save, force, (".toml",)) if save is not None else nullcontext() as draft:
        result = refit_model(loaded, given)
        content = result.to_dict()
        cli.to_json(content)  # nothing is written if anything fails
        if draft is not None:
            draft.write_text(result.model.to_toml(), encoding="utf-8")
    return content, repr(result)


# `robustpolish try`.


@click.command("try")
@cli.data_argument
@_model
@cli.repeatable("--add added", "'KIND PLACE ...'", _ADDED)
@cli.repeatable("--remove removed", "'KIND PLACE ...'", "The same, of an effect of the model.")
@cli.option("--save", "Save the model with the effect (.toml).", cli.FILE)
@cli.option("--ledger", "Errors of every step (.json): kept from call to call.", cli.FILE)
@cli.option("--plot", "Save the picture of the errors (.png, .svg).", cli.FILE)
@cli.measurement_options
@cli.result_options
def try_(
    data: tuple[str, ...], model: str, added: tuple[str, ...], removed: tuple[str, ...],
    save: str | None, ledger: str | None, plot: str | None, reading: cli.Reading, force: bool,
) -> tuple[Any, ...]:  # fmt: skip
    """Add an effect to a model by hand, or remove one, and show the held-out error.

    DATA is a measurement with the model's inputs and outputs as columns, or several of them. The
    model is fitted with the effect and without it, and the part of DATA that neither was fitted to
    judges. --save OTHER.toml, then --model OTHER.toml of the next call, goes on from there. The
    exit code is 0 whether the effect is worth its numbers or not, and 2 for bad input.
    """
    if not added and not removed:
        remedy = "Write --add 'coulomb_friction tool ground'."
        raise invalid("--add", described("nothing"), "a kind of effect and a place", remedy)
    changes = [(change, False) for change in _changes("--add", added)]
    changes += [(change, True) for change in _changes("--remove", removed)]
    loaded = cli.mechanical_model(model)
    records = cli.load_records(data, loaded, reading)
    with ExitStack() as places:
        drafts = {
            path: places.enter_context(new_file(path, force or path == ledger, suffixes))
            for path, suffixes in ((save, (".toml",)), (ledger, (".json",)))
            if path is not None
        }
        tell = places.enter_context(cli.stages("Fitting"))
        steps = Ledger()
        if ledger is not None and Path(ledger).exists():
            steps = ledger_from(read_saved(ledger, "ledger"))
        result: Any = loaded
        for (kind, at, numbers), remove in changes:
            result = try_effect(
                result, records, kind, at, parameters=numbers or None, remove=remove,
                ledger=steps, progress=tell,
            )  # fmt: skip
            steps = result.ledger
        content = result.to_dict()
        cli.to_json(content)  # nothing is written if anything fails
        if save is not None:
            drafts[save].write_text(result.model.to_toml(), encoding="utf-8")
        if ledger is not None:
            kept = {"ledger": steps.to_list(), "noise_floor": steps.noise_floor}
            write_saved(drafts[ledger], "ledger", kept, force=True)
    cli.save_picture(plot, force, lambda: result.plot().figure)
    return content, repr(result)


_NOISE = "Standard deviation in SI units, as in x=2e-6; repeatable."
_LIMIT = "Largest value of an input or output in SI units, as in F=50; repeatable."


@click.command("tell-apart")
@click.argument("data", type=click.Path())
@click.argument("machines", nargs=-1, required=True, type=click.Path())
@cli.option("--pair", "Which of a diagnosis's pairs.", default=1)
@cli.repeatable("--noise noises", "OUTPUT=SIZE", _NOISE)
@cli.repeatable("--limit limits", "SIGNAL=SIZE", _LIMIT)
@click.option("--fit/--no-fit", default=True, help="Fit the machines to DATA first, or not.")
@cli.measurement_options
@cli.option("--plot", "Save the picture (.png, .svg).", cli.FILE)
@cli.result_options
def tell_apart(
    data: str, machines: tuple[str, ...], pair: int, noises: tuple[str, ...],
    limits: tuple[str, ...], fit: bool, reading: cli.Reading, plot: str | None, force: bool,
) -> tuple[Any, ...]:  # fmt: skip
    """Find the experiment that tells two machines apart which DATA does not.

    MACHINES is a diagnosis, as `robustpolish diagnose --save found.json` writes it, or two models
    (TOML). Both machines are simulated in some twenty experiments, at 0.3 to 10 times the
    amplitudes of DATA. The exit code is 0 whether one tells them apart or none does, and 2 for
    bad input.
    """
    if len(machines) == 1 and Path(machines[0]).suffix == ".json":
        given: Any = Diagnosis.load(machines[0])
        model = given.model
    elif len(machines) == 2:
        given = tuple(map(cli.mechanical_model, machines))
        model = given[0]
    else:
        shown = described(f"{len(machines)} files: {', '.join(machines)}")
        want = "one diagnosis (.json), or two models (.toml)"
        raise invalid("MACHINES", shown, want, "Add the other one.")
    require_time_data(data)
    record = cli.load_data(data, model, reading)
    noise = _sizes("--noise", noises, "--noise x=2e-6")
    with cli.stages("Trying experiments") as tell:
        bounds = _sizes("--limit", limits, "--limit F=50")
        how: dict[str, Any] = {"noise": noise, "limits": bounds, "fit": fit, "progress": tell}
        found = tell_machines_apart(given, record, pair=pair - 1, **how)
    content = found.to_dict()
    cli.to_json(content)  # nothing is written if anything fails
    cli.save_picture(plot, force, found.plot_panels)
    return content, repr(found)


def _sizes(option: str, items: tuple[str, ...], example: str) -> dict[str, float]:
    given = cli.pairs(option, items, "NAME=SIZE", example)
    return {name: positive(option, value, "SI units") for name, value in given.items()}
