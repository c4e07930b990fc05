"""Parameter estimation of a model, effects included, by least squares of free runs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from robustpolish.base.arrays import Array
from robustpolish.base.budget import parallel_map, progress_bar, single_threaded_blas
from robustpolish.identification.fit import least_squares
from robustpolish.identification.fit.parameters import chain_keys, inputs_of_chain
from robustpolish.identification.fit.prepared import PreparedRecord, prepare, reduced_data
from robustpolish.identification.fit.result import Refit, refit_of
from robustpolish.identification.free_runs import free_run_error, free_runs, record_errors
from robustpolish.identification.frequency.fit import refit_frequency_response
from robustpolish.identification.policy import POLICY
from robustpolish.identification.record import output_sizes
from robustpolish.identification.sanity import implausible_changes, sanity_warnings
from robustpolish.identification.search.screening import null_score, numbers_along_motion, screen
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.effects.kind import CONSTANT
from robustpolish.machines.mechanical.data import connected
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import FORCE
from robustpolish.signals.frequency_response import holds_frequency_response

# Estimation of a model's own numbers and of the holds of its inputs, before effects are sought.
#
# Holds of inputs: a record made with a zero-order hold and read as linear
# looks like half a sample of delay; a smooth one with content near the sampling rate like an error
# of every model.

_HOLD = "input_hold"
_LINEAR = 1.0
# Orders that are tried beside the linear one, and delays in samples: a long delay looks half like a
# hold ("input delay").
_HOLD_ORDERS, _HOLD_DELAYS = (0.0, 3.0), (1, 2, 4)
# Log odds from which a hold is believed.
_HOLD_ODDS = 20.0
# Samples to either side of a first delay that are tried.
_AROUND = 4
# Regressions along the motion, each with the motion that the numbers of the one before show.
_REGRESSIONS = 4
# Share of a fit's error that has to lie above the noise for a regression to be worth its time.
_BETTER = 0.8
# Log of a common factor, and of the error it may cost, that is not worth settling.
_UNCHANGED = 0.01
# Samples of a window that still tells a curvature from a slope.
_SHORTEST = 8


def with_selected_holds(model: MechanicalModel, prepared: PreparedRecord) -> MechanicalModel:
    """Return the model with other holds of its force inputs, if the data speak for them.

    All inputs are taken to be of one kind, linear if nothing is said. The linear model's
    innovations judge, its own numbers being corrected at the same time.
    """
    choices = _hold_choices(model)
    if not choices:
        return model
    bare = replace(model, effects=tuple(split_holds(model.effects)[1]))
    tried = {o: replace(bare, effects=(*bare.effects, *holds)) for o, holds in choices.items()}
    found = parallel_map(lambda candidate: null_score(candidate, prepared), tried.values())
    scores = dict(zip(tried, found, strict=True))
    now, best = next(iter(scores)), min(scores, key=lambda order: scores[order])
    if scores[now] - scores[best] <= 2 * _HOLD_ODDS:
        return model
    late = (
        null_score(bare.with_effect("input_delay", (item.name,), {"delay": delay}), prepared)
        for item in model.inputs
        if item.imposes is None
        for delay in (n * prepared.record.dt for n in _HOLD_DELAYS)
    )
    if best == 0.0 and min(late) < scores[best]:
        return model  # a longer delay, of which a hold would take half a sample
    return tried[best]


def split_holds(effects: Sequence[Effect]) -> tuple[list[Effect], list[Effect]]:
    """Return the holds of inputs among effects, and the others."""
    holds = [effect for effect in effects if effect.kind == _HOLD]
    return holds, [effect for effect in effects if effect.kind != _HOLD]


def held_inputs(model: MechanicalModel) -> set[str]:
    """Return the names of the inputs that stay as they are between their samples."""
    holds, _ = split_holds(model.effects)
    return {hold.at[0] for hold in holds if hold.values["order"] == 0.0}


def _hold_choices(model: MechanicalModel) -> dict[float, list[Effect]]:
    """Return by their order what holds the force inputs may have: as they are now, and others.

    A linear hold is none. There is no choice without force inputs, or if these are not of one kind.
    """
    names = [(i.name,) for i in model.inputs if i.imposes is None and i.name not in model.driven]
    now = {hold.values["order"] for hold in split_holds(model.effects)[0]} or {_LINEAR}
    orders = dict.fromkeys((*now, _LINEAR, *_HOLD_ORDERS))
    return {
        order: [Effect(_HOLD, at, {"order": order}) for at in names if order != _LINEAR]
        for order in (orders if names and len(now) == 1 else ())
    }


def with_reselected_holds(
    model: MechanicalModel, reference: MechanicalModel, prepared: PreparedRecord
) -> tuple[MechanicalModel, least_squares.Fit] | None:
    """Return the reference with other holds, if runs beside the effects that were found ask for it.

    What is missing from a model may look like a hold that is none, or hide one, and a delay takes
    the half sample for its own by which a held input lags. So the model is fitted with each hold,
    and its delays less what the hold is late; the likelihood decides.

    Parameters
    ----------
    model : MechanicalModel
        With the effects that were found.
    reference : MechanicalModel
        Without, with the holds that were taken for its inputs.
    prepared : PreparedRecord

    Returns
    -------
    (MechanicalModel, Fit) or None
        The reference, and the fit of the model, effects included, with these holds.
    """
    choices = _hold_choices(reference)
    if not choices:
        return None
    order_now, orders = next(iter(choices)), sorted(choices)
    _, bare = split_holds(reference.effects)
    _, fitted = split_holds(model.effects[: len(reference.effects)])
    added = model.effects[len(reference.effects) :]
    spans = prepared.spans(prepared.trial)[-1:]
    held = {o: replace(reference, effects=(*bare, *choices[o])) for o in orders}

    def fits_with(order: float) -> list[least_squares.Fit]:
        later = 0.5 * prepared.record.dt * ((order == 0.0) - (order_now == 0.0))
        # delays less what the hold has of them
        moved = (
            e.with_values({**e.parameters, "delay": max(e.values["delay"] - later, 0.0)})
            if e.kind == "input_delay" else e
            for e in added
        )  # fmt: skip
        tried = replace(model, effects=(*fitted, *choices[order], *moved))
        return least_squares.homotopy(tried, prepared, prepared.trial, held[order], spans)

    found = parallel_map(fits_with, orders)
    left = {order: fits[-1] for order, fits in zip(orders, found, strict=True) if fits}
    if order_now not in left:
        return None
    now = left[order_now]
    best = min(left, key=lambda order: float(np.sum(np.log(left[order].rmse))))
    likelier = least_squares.log_odds(left[best], now) > _HOLD_ODDS
    if not (likelier and np.any(left[best].rmse <= now.rmse)):
        return None
    return held[best], left[best]


def with_resolved_delay(effect: Effect, model: MechanicalModel, prepared: PreparedRecord) -> Effect:
    """Return the delay of a held input that is right within a sample; other effects as they are.

    What an accelerometer shows of a held force jumps with it: whatever the delay within a sample,
    it sees the same, and no slope leads from one sample to the next.

    Parameters
    ----------
    effect : Effect
    model : MechanicalModel
        Without it.
    prepared : PreparedRecord
    """
    if effect.kind != "input_delay" or effect.at[0] not in held_inputs(model):
        return effect
    dt = prepared.record.dt
    first = int(effect.values["delay"] / dt)
    whole = {*range(_AROUND), *range(max(first - _AROUND, 0), first + _AROUND + 1)}
    tried = [effect.with_values({"delay": (samples + 0.5) * dt}) for samples in sorted(whole)]

    def left(late: Effect) -> float:
        delayed = model.with_effect(late.definition, late.at, late.values)
        return least_squares.windows_log_error(delayed, prepared)

    return min(tried, key=left)


def fit_own_parameters(
    model: MechanicalModel, prepared: PreparedRecord
) -> tuple[least_squares.EvaluatedFit, MechanicalModel]:
    """Fit the numbers of a model as it is, effects of its own included.

    A fit that is led by the data finds numbers that are far off; one that runs freely from the
    start keeps those that are nearly right already, where the data says little about them while it
    leads. Chains that hang together by nothing are judged apart.

    Parameters
    ----------
    model : MechanicalModel
    prepared : PreparedRecord

    Returns
    -------
    stage : EvaluatedFit
        The refitted model, judged.
    short_window_model : MechanicalModel
        The one whose fit was led by the data.
    """
    pieces = prepared.trial if model.free else prepared.estimation  # quick where nothing swings
    spans = prepared.spans(pieces)
    shortest = [span for span in (spans[0] // 4, spans[0] // 2) if span >= _SHORTEST]
    # springs that are far too stiff swing several times where the machine swings once
    stages = least_squares.homotopy(model, prepared, pieces, model, [*shortest, *spans])
    stage = least_squares.best_stage(stages, prepared)
    short_window_model = stages[min(1, len(stages) - 1)].model
    begun = _begun_along_motion(model, stage.model, stage.error, prepared)
    if begun is not None:
        stages = least_squares.homotopy(begun, prepared, pieces, model, [*shortest, *spans])
        found = [stage, least_squares.best_stage(stages, prepared)] if stages else [stage]
        stage = min(found, key=lambda s: float(np.mean(np.log(s.error))))
    return _with_fixed_scale(stage, model, prepared), short_window_model


def _begun_along_motion(
    model: MechanicalModel, fitted: MechanicalModel, error: Array, prepared: PreparedRecord
) -> MechanicalModel | None:
    """Return a model from which a better fit may begin, None if none is better than a fitted one.

    Slopes of runs that swing at another frequency than the machine lead nowhere; a regression along
    the measured motion, repeated with the motion that its numbers show, does. What runs better over
    short windows than a fit shows that this ended in a wrong minimum.
    """
    if np.all(error * _BETTER <= prepared.scales.noise):
        return None
    best, least, moved = None, least_squares.short_window_log_error(fitted, prepared), model
    for _ in range(_REGRESSIONS if model.free else 0):
        try:
            moved = numbers_along_motion(moved, model, prepared)
        except np.linalg.LinAlgError:  # numbers with which no observer follows the record
            break
        now = least_squares.short_window_log_error(moved, prepared)
        if now < least:
            best, least = moved, now
    return best


def _with_fixed_scale(
    stage: least_squares.EvaluatedFit, model: MechanicalModel, prepared: PreparedRecord
) -> least_squares.EvaluatedFit:
    """Return the stage with its common factors settled, if the error does not mind."""
    rested = scaled_to_priors(stage.model, model)
    if rested is stage.model or not stage.reproducible:
        return stage
    whole = prepared.spans(prepared.trial)[-1:]
    fits = least_squares.homotopy(rested, prepared, prepared.trial, model, whole)
    stages = [least_squares.evaluate_fit(fitted, prepared) for fitted in fits]
    kept = [s for s in stages if np.mean(np.log(s.error / stage.error)) < _UNCHANGED]
    return kept[0] if kept else stage


def scaled_to_priors(model: MechanicalModel, reference: MechanicalModel) -> MechanicalModel:
    """Return the model with chains scaled to what is known of their masses and gains.

    A chain whose masses, springs, dampers and gains are all larger by one factor moves alike. Where
    the chain has two inputs or more the fit is free to wander along this factor.
    """
    known, found = reference.parameters, model.parameters
    changes: dict[str, float] = {}
    for group in connected(model):
        forces = any(o.quantity == FORCE and group.intersection(o.of) for o in model.outputs)
        bent = any(group.intersection(part.at) for part in model.effects) or model.equations
        if len(inputs_of_chain(model, group)) < 2 or forces or bent:
            continue
        keys = [key for kind in chain_keys(model, group) for key in kind]
        keys += [f"input.{i.name}.gain" for i in model.inputs if i.on[0] in group]
        told = [key for key in keys if not key.startswith(("spring", "damper")) and known[key]]
        ratios = np.array([found[key] / known[key] for key in told])
        if ratios.size and np.all(ratios > 0):
            factor = float(np.sum(ratios) / np.sum(ratios**2))  # nearest to one, all alike likely
            if abs(np.log(factor)) > _UNCHANGED:
                changes |= {key: factor * found[key] for key in keys}
    return model.with_parameters(changes) if changes else model


# Warnings about a record and a fit.


def collect_warnings(
    model: MechanicalModel, fitted: MechanicalModel, prepared: PreparedRecord
) -> tuple[str, ...]:
    """Return the remarks of a record and the warnings that a fit gives cause for, each once.

    Parameters
    ----------
    model : MechanicalModel
        As it was given, effects without numbers started.
    fitted : MechanicalModel
        What a refit or a diagnosis made of it.
    prepared : PreparedRecord

    Returns
    -------
    tuple of str
    """
    data, simulated = prepared.record.data, None
    said = [str(note) for note in data.attrs.get("notes", ())]
    # an offset or a preload that was found says what the mean is
    if not any(effect.definition.family == CONSTANT for effect in fitted.effects):
        run, started = prepared.run_with_fitted_starts(model, prepared.everything)
        with np.errstate(all="ignore"):
            outputs = run.over_all(started).outputs
        columns = zip(model.output_names, outputs.T, strict=True)
        simulated = xr.Dataset({name: ("time", column) for name, column in columns})
    said += sanity_warnings(model, data, simulated, fitted)
    return tuple(dict.fromkeys(said))


@single_threaded_blas
def refit(
    model: MechanicalModel,
    data: Any,
    progress: Callable[[], None] | None = None,
    *,
    outputs: Sequence[str] | None = None,
) -> Refit:
    """Fit the parameters of a model, those of its effects included.

    Masses and input gains are known to about 5 % beforehand; data may move them further.
    Of a long record as many samples are used as the fastest motion, the forces and the error ask
    for, or a part of it; ``notes`` of the result says so.

    Parameters
    ----------
    model : MechanicalModel
        Start values; effects that were added without parameters get theirs from screening.
    data : xarray.Dataset, path or pandas.DataFrame, or a sequence or mapping of them
        Inputs and outputs by name over ``time``, SI units. Several records have the numbers of the
        machine in common and each a start of its own; phases are those at time 0 of every record,
        see :func:`robustpolish.diagnose`. Or frequency responses, as
        :func:`robustpolish.read_frequency_response` reads and returns them: the linear part is
        fitted to them, effects linearised.
    progress : callable, optional
        Called after every step.
    outputs : sequence of str, optional
        Outputs that are used and that the data must hold. By default those that the data hold, and
        ``notes`` names the others.

    Returns
    -------
    Refit

    Raises
    ------
    InvalidInputError
        If columns are missing or a record is too short; if there is no record, or several that
        differ in their channels.

    Examples
    --------
    >>> import numpy as np, xarray as xr
    >>> import robustpolish as rp
    >>> from robustpolish.simulation import linear_response
    >>> def oscillator(k):
    ...     return rp.MechanicalModel(
    ...         [rp.Dof("x", 1.0)],
    ...         [rp.Spring(("x", "ground"), k)],
    ...         [rp.Damper(("x", "ground"), 0.4)],
    ...         [rp.Input("F", ("x", "ground"))], [rp.Output("x", ("x", "ground"))])
    >>> t = np.arange(2000) * 0.01
    >>> rng = np.random.default_rng(0)
    >>> force, noise = rng.standard_normal(t.size), 1e-3 * rng.standard_normal(t.size)
    >>> x = linear_response(oscillator(25.0).state_space(), t, force[:, None]).outputs[:, 0]
    >>> data = xr.Dataset({"F": ("time", force), "x": ("time", x + noise)}, coords={"time": t})
    >>> fitted = refit(oscillator(22.0), data)
    >>> m, k = (fitted.model.parameters[n] for n in ("dof.x.mass", "spring[0].stiffness"))
    >>> bool(abs(k / m - 25) < 0.1)
    True
    """
    if holds_frequency_response(data):
        with progress_bar("Refitting"):
            found = refit_frequency_response(model, data, progress)
        moved = implausible_changes(model.parameters, found.model.parameters)
        return replace(found, notes=tuple(moved))
    fewer = reduced_data(model, data, outputs)
    model, prepared = fewer.model, prepare(fewer.model, fewer.record, POLICY)
    started = with_start_values(model, prepared)
    spans = prepared.spans(prepared.everything)
    with progress_bar("Refitting"):
        last = POLICY.follows(prepared.record.Y.size)

        def fits_from(start: MechanicalModel) -> list[least_squares.Fit]:
            return least_squares.homotopy(
                start, prepared, prepared.everything, model, spans, progress=progress, last=last
            )

        fits = fits_from(started)
        begun = None
        if fits:
            begun = _begun_along_motion(model, fits[-1].model, fits[-1].rmse, prepared)
        if begun is not None:
            again = fits_from(begun)
            errors = _run_errors([f.model for f in (*fits[-1:], *again[-1:])], prepared)
            fits = again if errors[-1] < errors[0] else fits
        best = _best_not_worse_than_start(fits[-2:][::-1], [model, started], prepared)
        share = (best.rmse / np.std(prepared.record.Y, axis=0)).tolist()
        nrmse = dict(zip(best.model.output_names, share, strict=True))
        found = refit_of(best.model, best.free, least_squares.covariance_of(best), nrmse)
        records = record_errors(found.model, free_runs(found.model, fewer.record))
    notes = (*fewer.notes, *collect_warnings(started, found.model, prepared))
    notes += _hold_notes(found.model, prepared)
    return replace(found, model=fewer.restored(found.model), notes=notes, records=records)


def _hold_notes(fitted: MechanicalModel, prepared: PreparedRecord) -> tuple[str, ...]:
    """Say so if the inputs of a linear model look otherwise between samples than it has them."""
    holds, others = split_holds(fitted.effects)
    found = holds if others else split_holds(with_selected_holds(fitted, prepared).effects)[0]
    now, best = (each[0].values["order"] if each else _LINEAR for each in (holds, found))
    names = ", ".join(item.name for item in fitted.inputs if item.imposes is None)
    how = {0.0: "held", _LINEAR: "straight"}
    shape = f"{how.get(best, 'smooth')} between samples, not {how.get(now, 'smooth')}"
    remedy = f"the effect input_hold with order {best:g} says so, and changes parameters and errors"
    return (f"{names}: looks {shape}: {remedy}",) * (best != now)


def _best_not_worse_than_start(
    fits: Sequence[least_squares.Fit], starts: Sequence[MechanicalModel], prepared: PreparedRecord
) -> least_squares.Fit:
    """Return the first fit that runs no worse than the starts do, or the best start as it is.

    A fit goes by starts of its own, by priors, and by the likelihood, which may give up a little of
    a loud output for a quiet one.
    """
    models = [fitted.model for fitted in fits] + list(starts)
    errors = _run_errors(models, prepared)
    of_fits, of_starts = errors[: len(fits)], errors[len(fits) :]
    for fitted, error in zip(fits, of_fits, strict=True):
        if error <= min(of_starts):
            return fitted
    best = starts[int(np.argmin(of_starts))]
    if not np.isfinite(min(of_starts)):
        raise ArithmeticError("no stage of the fit ended with finite errors")
    _, pieces = prepared.run_with_fitted_starts(best, prepared.everything)
    return least_squares.evaluate_unfitted(
        least_squares.residuals_of(best, pieces, prepared, starts[0])
    )


def _run_errors(models: Sequence[MechanicalModel], prepared: PreparedRecord) -> list[float]:
    """Return the mean square of relative errors of free runs, over windows if no run repeats."""
    size = output_sizes(prepared.record.Y)
    runs = [free_run_error(model, prepared.record) for model in models]
    found = [error for error, _ in runs]
    if not all(predictable or not np.isfinite(error).all() for error, predictable in runs):
        found = [least_squares.free_run_rms(model, prepared, prepared.windows) for model in models]
    return [float(np.mean((error / size) ** 2)) for error in found]


def with_start_values(model: MechanicalModel, prepared: PreparedRecord) -> MechanicalModel:
    """Give effects that came without parameters those that screening finds."""
    effects = list(model.effects)
    for i, effect in enumerate(effects):
        if effect.parameters:
            continue
        others = replace(model, effects=tuple(e for e in effects if e is not effect))
        found = screen(others, prepared, [effect])
        values = found.candidates[0].effect.values if found.candidates else effect.values
        effects[i] = effect.with_values(values)
    return replace(model, effects=tuple(effects))
