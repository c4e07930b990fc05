"""Whether a refitted effect earns its place."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from robustpolish.base.arrays import Array
from robustpolish.identification.fit.least_squares import (
    EvaluatedFit,
    Fit,
    covariance_of,
    ranking_log_error,
)
from robustpolish.identification.fit.prepared import PreparedRecord
from robustpolish.identification.fit.result import stderr_from_covariance
from robustpolish.identification.policy import Policy
from robustpolish.identification.record import Record, input_period, poles_of
from robustpolish.identification.refit import held_inputs
from robustpolish.identification.residual_tests import residual_noise_floor
from robustpolish.identification.structure.state import RefittedEffect, Search
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.mechanical.model import MechanicalModel

_FREQUENCY_SHIFT = 0.1
"""Share by which the frequency of a decay may shift with its amplitude."""

_UNEXPLAINED_DELAY = 0.75
"""Samples by which an input acts later than a linear one, that no hold explains."""
_LINE_STDERRS = 5.0
"""Standard errors from which a fitted frequency is none of the lines of the inputs."""


def ranking_error(fitted: EvaluatedFit, among: Sequence[RefittedEffect | EvaluatedFit]) -> float:
    """Return the mean log of the errors that rank; of short windows unless all run reproducibly."""
    return ranking_log_error(
        fitted, [i if isinstance(i, EvaluatedFit) else i.fitted for i in among]
    )


def log_error_ratio(one: EvaluatedFit, other: EvaluatedFit) -> float:
    """Return the log of the held-out error that one fit leaves over that which another leaves."""
    return ranking_error(one, [other]) - ranking_error(other, [one])


def rejection_reason(
    before: EvaluatedFit, after: EvaluatedFit, prepared: PreparedRecord, place: int = -1
) -> str | None:
    """Say why an effect does not earn its place.

    Parameters
    ----------
    before, after : JudgedFit
        Without and with it.
    prepared : PreparedRecord
    place : int, optional
        Where it stands among the effects of the model; by default it is the last one, which has
        just come. Beside others that take the error away, only its own numbers speak for one.
    """
    policy = prepared.policy
    fall = significant_improvement(before, after, prepared)
    if fall is None:
        most = max(float(np.max(error_reduction(before, after))), 0)
        return f"the held-out error falls by {100 * most:.0f} % only"
    # likelihoods add up: an output that sees nothing of an effect says nothing against it
    if _outputs_disagree(fall, policy):
        return "one output gains what another loses"
    index = place % len(after.model.effects)
    effect = after.model.effects[index]
    refused = (
        effect.definition.implausible(effect.values)
        or _line_rejection(before, after, prepared, index)
        or _delay_rejection(after.model, index, prepared.record)
        or _mass_rejection(after.model, index, policy)
    )
    if refused:
        return refused
    lead = undetermined_parameter(after.fit, index, policy)
    # what takes the error away by far is there, though its numbers may stand for each other
    several = sum(p.fitted for p in effect.definition.parameters) > 1
    if lead and not (several and place == -1 and _falls_beyond_noise(before, after, policy)):
        return f"its {lead} is not determined"
    return None


def _falls_beyond_noise(before: EvaluatedFit, after: EvaluatedFit, policy: Policy) -> bool:
    """Return whether each held-out error falls by so much that no noise is involved."""
    return bool(np.all(policy.far * after.error < before.error))


def error_reduction(before: EvaluatedFit, after: EvaluatedFit) -> Array:
    """Return the share by which each held-out error falls; of short windows unless both repeat."""
    if before.reproducible and after.reproducible:
        return 1 - after.free / before.free
    return 1 - after.short / before.short


def significant_improvement(
    before: EvaluatedFit, after: EvaluatedFit, prepared: PreparedRecord
) -> Array | None:
    """Return the share by which each error falls, None if none falls visibly.

    The held-out blocks may be the quieter part of a record. Where their errors fall at least half
    as much as they should, those of the blocks that were fitted to count too; where motion fades
    and these have far more error, those of both together do. Where an effect hardly acts there, the
    fitted blocks judge it: where those are far louder, their errors have to fall by far; where the
    held-out ones do not rise and beside the effect all blocks are alike, as after a sweep that
    passed a resonance in one of them, or where the held-out ones show noise alone in any case, as
    when a decay is over, by twice as much as held-out ones; where both holds, by as much.
    """
    policy = prepared.policy
    fall = error_reduction(before, after)
    seen = fall if _is_significant(fall, policy.visible_fall) else None
    if seen is not None and not _outputs_disagree(fall, policy):
        return seen
    counted = _improvement_of_all_blocks(before, after, fall, policy)
    if counted is None:
        counted = _improvement_with_fitted_blocks(before, after, fall, prepared)
    return seen if counted is None else counted


def _improvement_of_all_blocks(
    before: EvaluatedFit, after: EvaluatedFit, fall: Array, policy: Policy
) -> Array | None:
    """Return the falls of held-out and fitted blocks together, where a fading motion counts so."""
    if not (before.quieter_held_out and before.reproducible and after.reproducible):
        return None
    over_all = 1 - after.over_all / before.over_all
    if not np.all(policy.far * before.error < before.fitted):
        return None
    # with what is still missing, quiet blocks may lose some of what far louder errors gain
    gained = np.max(1 - after.fitted / before.fitted) > 1 - 1 / policy.far
    counts = gained or np.min(fall) > -policy.together
    visible = _is_significant(over_all, policy.visible_fall) and not _outputs_disagree(
        over_all, policy
    )
    return over_all if counts and visible else None


def _outputs_disagree(fall: Array, policy: Policy) -> bool:
    """Return whether one output gains what another loses."""
    return _log_error_product(fall) > np.log(1 - policy.together)


def _improvement_with_fitted_blocks(
    before: EvaluatedFit, after: EvaluatedFit, fall: Array, prepared: PreparedRecord
) -> Array | None:
    """Return the falls that count where those of the blocks that were fitted to do, too."""
    policy = prepared.policy
    if len(before.fit.pieces) == len(after.fit.pieces):
        loud, left = before.fit.rmse, after.fit.rmse
    elif before.reproducible and after.reproducible:
        loud, left = before.fitted, after.fitted
    else:
        return None
    fitted = 1 - left / loud
    if _is_significant(fall, policy.together) and not _outputs_disagree(fall, policy):
        return fall if _is_significant(fitted, policy.visible_fall) else None
    quiet = np.all(policy.far * before.error < loud) and np.min(fall) > -policy.together
    if quiet and np.max(fitted) > 1 - 1 / policy.far:
        return fitted
    alike = np.all(np.abs(np.log(left / after.error)) < np.log(policy.at_noise_floor))
    silent = _held_out_is_noise(before, prepared)
    if _log_error_product(fall) >= policy.together or not (alike or silent):
        return None
    if alike and silent:
        return fitted if _is_significant(fitted, policy.visible_fall) else None
    return fitted if np.max(fitted) > 2 * policy.visible_fall else None


def _held_out_is_noise(fitted: EvaluatedFit, prepared: PreparedRecord) -> bool:
    """Return whether the held-out blocks show noise alone: white, or where motion fades coloured.

    Of the noise of a decay its end shows the colour, and so how much of it is below the motion.
    """
    most = prepared.policy.at_noise_floor
    if np.all(fitted.error < most * prepared.scales.noise):
        return True
    if not (fitted.quieter_held_out and fitted.reproducible):
        return False
    return bool(
        np.all(fitted.error < most * residual_noise_floor(fitted.model, prepared, predictable=True))
    )


def improves_fitted_pieces(before: EvaluatedFit, after: EvaluatedFit, policy: Policy) -> bool:
    """Return whether errors fall visibly over the pieces that fits are made to, run as a whole."""
    if not (before.reproducible and after.reproducible):
        return False
    return _is_significant(1 - after.fitted / before.fitted, policy.visible_fall)


def _is_significant(fall: Array, least: float) -> bool:
    """Return whether an error falls by at least a share, or several of them do together."""
    return bool(np.max(fall) >= least or _log_error_product(fall) <= np.log(1 - least))


def _log_error_product(fall: Array) -> float:
    """Return the log of what is left of the product of all errors."""
    with np.errstate(divide="ignore"):  # an infinite error falls by all of it
        return float(np.sum(np.log(1 - fall)))


def undetermined_parameter(
    fitted: Fit, index: int, policy: Policy, every: bool = False
) -> str | None:
    """Return the first number of an effect of a fitted model, if the data leave it open.

    With `every`, any of its numbers that the data leave open. One that is at least another says
    something by what it is more: a friction at rest that may be the sliding one is open, however
    well both are known.
    """
    effect = fitted.model.effects[index]
    if effect.definition.domain == "input":
        return None
    covariance = covariance_of(fitted)
    errors = stderr_from_covariance(covariance)
    numbers = [p for p in effect.definition.parameters if p.fitted]
    # of a stop, the gap says where it is and the stiffness whether it is there
    sizes = [p for p in numbers if p.counts_force]
    signal = effect.definition.domain == "output"
    for lead in numbers if every else dict.fromkeys((numbers[0], *sizes[:1])):
        error = errors.get(f"effect[{index}].{lead.name}", 0.0)
        size = effect.values[lead.name] - (lead.default if signal else 0.0)  # a gain of 1 is none
        if not error < policy.determined * abs(size):
            return lead.name
        if every and lead.at_least:
            more = size - effect.values[lead.at_least]
            pair = [f"effect[{index}].{name}" for name in (lead.name, lead.at_least)]
            if not _stderr_of_difference(covariance, *pair) < policy.determined * more:
                return lead.name
    return None


def _stderr_of_difference(covariance: xr.DataArray, one: str, other: str) -> float:
    """Return the standard error of the difference of two numbers, 0 if either was not fitted."""
    if not {one, other} <= set(covariance["parameter"].values.tolist()):
        return 0.0
    both = covariance.sel(parameter=[one, other], other=[one, other]).values
    return float(np.sqrt(max(both[0, 0] + both[1, 1] - 2 * both[0, 1], 0.0)))


def _line_rejection(
    before: EvaluatedFit, after: EvaluatedFit, prepared: PreparedRecord, index: int
) -> str | None:
    """Say whether an effect is a force from outside with a line that the motion has by itself.

    Without inputs a mode may be near a force that is there. What a law of motion does to a decay
    no line takes away by far.
    """
    if _falls_beyond_noise(before, after, prepared.policy) and not after.model.inputs:
        return None
    error = _line_error(after.fit, index)
    return motion_line_reason(after.model.effects[index], after.model, prepared.record, error)


def _delay_rejection(model: MechanicalModel, index: int, record: Record) -> str | None:
    """Say whether an effect delays an input by less than a record can tell from a hold.

    A held input is half a sample late by itself. What is as near to that as to a whole sample no
    hold explains: a velocity that is the difference of two positions is late by half a sample, too.
    """
    effect = model.effects[index]
    if effect.definition.domain != "input":
        return None
    held = effect.at[0] in held_inputs(model)
    for number in effect.definition.parameters:
        late = effect.values[number.name] if number.dimension == "T" else np.inf
        if late < (_UNEXPLAINED_DELAY - 0.5 * held) * record.dt:
            samples = late / record.dt
            return f"a {number.name} of {samples:.2g} samples is what its input does between them"
    return None


def _mass_rejection(model: MechanicalModel, index: int, policy: Policy) -> str | None:
    """Say whether an effect hangs far more mass on a machine than that has.

    What cannot be moved is the ground: as a resonator it drifts for ever, as the offset of a sensor
    makes a motion seem to.
    """
    effect = model.effects[index]
    mass = effect.values.get("mass", 0.0) if effect.definition.swinging else 0.0
    known = sum(dof.mass for dof in model.dofs)
    if known > 0 and mass > policy.heavy * known:  # of a motion that is imposed none is known
        return f"a mass of {mass:.3g} kg is far more than the machine has"
    return None


def _line_error(fitted: Fit, index: int) -> float:
    """Return the standard error of the frequency of a force from outside, else infinity."""
    name = fitted.model.effects[index].definition.line
    errors = stderr_from_covariance(covariance_of(fitted)) if name else {}
    return errors.get(f"effect[{index}].{name}", np.inf)


def motion_line_reason(
    effect: Effect, model: MechanicalModel, record: Record, error: float = np.inf
) -> str | None:
    """Say whether a force from outside has a line that the motion has by itself.

    What depends on the motion repeats with the inputs, so such a line may be any law of motion. It
    is one of the inputs' lines if it is nearer than the record's length resolves, or, of a force
    that was fitted, nearer than some standard errors of its frequency.
    """
    frequency = effect.definition.line
    if frequency is None:
        return None
    if not model.inputs and _has_mode_at(model, effect.values[frequency], record):
        return "in a free decay the machine swings at this frequency by itself"
    inputs = record.signals(model)
    for part in record.parts:
        period = input_period(part.own(inputs), part.dt)
        turns = effect.values[frequency] * (period or np.nan)
        near = min(0.5 / (part.samples * part.dt), _LINE_STDERRS * error) * (period or np.nan)
        if period and abs(turns - round(turns)) <= near:
            return f"the inputs repeat every {period:.4g} s, and what they move has this line too"
    return None


def _has_mode_at(model: MechanicalModel, frequency: float, record: Record) -> bool:
    """Return whether a model without inputs has a mode that its record cannot tell from a line."""
    poles = poles_of(model)
    apart = np.abs(np.abs(poles.imag) / (2 * np.pi) - frequency)  # pyright: ignore[reportAttributeAccessIssue]
    width = np.abs(poles.real) / np.pi + 2 / (record.samples * record.dt)  # pyright: ignore[reportAttributeAccessIssue]
    return bool(np.any(apart < np.maximum(width, _FREQUENCY_SHIFT * frequency)))


def equivalence_tolerance(search: Search) -> float:
    """Return the relative difference of errors below which two effects are one to this data."""
    return search.policy.same(sum(p.record.samples for p in search.prepared.held_out))


def exceeds_noise_floor(fitted: EvaluatedFit, search: Search) -> bool:
    """Return whether a fit leaves so much more than noise that two kinds could differ by it.

    Far above white noise it does: what is left of the wrong kind may itself look like noise with a
    colour.
    """
    if not search.at_noise_floor(fitted):
        return True
    floor = search.residual_noise_floor(fitted.model, fitted.reproducible)
    return bool(np.any(fitted.error > (1 + equivalence_tolerance(search)) * floor))


def required_advantage(item: RefittedEffect, numbers: int, search: Search) -> float:
    """Return the log of the error by which a kind has to beat another of its family.

    Far above the noise something else is missing too, and a kind with more parameters bends itself
    to that: there its error has to be visibly lower.

    Parameters
    ----------
    item : RefittedEffect
    numbers : int
        Of the other kind.
    search : Search
    """
    far = np.all(item.fitted.error >= search.policy.far * search.prepared.scales.noise)
    if far and item.size > numbers:
        return -float(np.log(1 - search.policy.visible_fall))
    return equivalence_tolerance(search)
