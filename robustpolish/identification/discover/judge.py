"""Which of the refitted effects earns its place, and which hide each other."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from robustpolish.arrays import Array
from robustpolish.effects import Effect
from robustpolish.identification.discover.own_numbers import held_inputs
from robustpolish.identification.discover.search import RefittedEffect, Search
from robustpolish.identification.findings.confused import confused
from robustpolish.identification.fit.homotopy import JudgedFit, left_by
from robustpolish.identification.fit.least_squares import Fit, covariance_of, errors_from
from robustpolish.identification.fit.parameters import connected
from robustpolish.identification.fit.prepared import PreparedRecord
from robustpolish.identification.policy import Policy
from robustpolish.identification.record import Record, repetition
from robustpolish.identification.screening.candidates import rivals
from robustpolish.identification.screening.screen import ScreenedEffect
from robustpolish.models.mechanical import MechanicalModel

_SHIFTS = 0.1
"""Share by which the frequency of a decay may shift with its amplitude."""

_LATE = 0.75
"""Samples by which an input acts later than a linear one, that no hold explains."""
_CERTAINLY = 5.0
"""Standard errors from which a fitted frequency is none of the lines of the inputs."""


def chosen(refits: Sequence[RefittedEffect], search: Search) -> list[RefittedEffect]:
    """Return the effect that is to be added, none if none earns its place; note what is like it.

    Parameters
    ----------
    refits : sequence of RefittedEffect
        The best first.
    search : Search
    """
    refits = _unbeaten(refits, search)
    earned = _first_earned(refits, search)
    if earned is None:
        return []
    if earned.constant:
        beside = _beside_constant(earned, refits, search)
        if beside:
            return beside
    here = judgement(earned.fitted, refits)
    for item in refits:
        apart = judgement(item.fitted, refits) - here
        if item.screened.place != earned.screened.place and apart < tolerance(search):
            pair = (each.fitted.model.effects[-1] for each in (earned, item))  # as fitted
            search.confusions.append(confused(*pair))
    return [earned]


def judgement(fitted: JudgedFit, among: Sequence[RefittedEffect | JudgedFit]) -> float:
    """Return the mean log of the errors that rank; of short windows unless all run reproducibly."""
    return left_by(fitted, [i if isinstance(i, JudgedFit) else i.fitted for i in among])


def more_left(one: JudgedFit, other: JudgedFit) -> float:
    """Return the log of the held-out error that one fit leaves over that which another leaves."""
    return judgement(one, [other]) - judgement(other, [one])


def objection(
    before: JudgedFit, after: JudgedFit, prepared: PreparedRecord, place: int = -1
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
    fall = visible_falls(before, after, prepared)
    if fall is None:
        most = max(float(np.max(falls(before, after))), 0)
        return f"the held-out error falls by {100 * most:.0f} % only"
    # likelihoods add up: an output that sees nothing of an effect says nothing against it
    if _mixed(fall, policy):
        return "one output gains what another loses"
    index = place % len(after.model.effects)
    effect = after.model.effects[index]
    refused = (
        effect.definition.implausible(effect.values)
        or _no_line_from_outside(before, after, prepared, index)
        or _within_a_sample(after.model, index, prepared.record)
        or _too_heavy(after.model, index, policy)
    )
    if refused:
        return refused
    lead = undetermined(after.fit, index, policy)
    # what takes the error away by far is there, though its numbers may stand for each other
    several = sum(p.fitted for p in effect.definition.parameters) > 1
    if lead and not (several and place == -1 and _by_far(before, after, policy)):
        return f"its {lead} is not determined"
    return None


def _by_far(before: JudgedFit, after: JudgedFit, policy: Policy) -> bool:
    """Return whether each held-out error falls by so much that no noise is involved."""
    return bool(np.all(policy.far * after.error < before.error))


def falls(before: JudgedFit, after: JudgedFit) -> Array:
    """Return the share by which each held-out error falls; of short windows unless both repeat."""
    if before.reproducible and after.reproducible:
        return 1 - after.free / before.free
    return 1 - after.short / before.short


def visible_falls(before: JudgedFit, after: JudgedFit, prepared: PreparedRecord) -> Array | None:
    """Return the share by which each error falls, None if none falls visibly.

    The held-out blocks may be the quieter part of a record. Where their errors fall at least half
    as much as they should, those of the blocks that were fitted to count too; where motion fades,
    those of both together do. Where an effect hardly acts there, the fitted blocks judge it: where
    those are far louder, their errors have to fall by far; where the held-out ones do not rise and
    beside the effect all blocks are alike, as after a sweep that passed a resonance in one of them,
    or where the held-out ones show noise alone in any case, as when a decay is over, by twice as
    much as held-out ones; where both holds, by as much.
    """
    policy = prepared.policy
    fall = falls(before, after)
    seen = fall if _visible(fall, policy.visible_fall) else None
    if seen is not None and not _mixed(fall, policy):
        return seen
    if before.reproducible and after.reproducible:
        over_all = 1 - after.over_all / before.over_all
        if _visible(over_all, policy.visible_fall) and not _mixed(over_all, policy):
            return over_all
    loud = _falls_where_loud(before, after, fall, prepared)
    return seen if loud is None else loud


def _mixed(fall: Array, policy: Policy) -> bool:
    """Return whether one output gains what another loses."""
    return _log_left(fall) > np.log(1 - policy.together)


def _falls_where_loud(
    before: JudgedFit, after: JudgedFit, fall: Array, prepared: PreparedRecord
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
    if _visible(fall, policy.together) and not _mixed(fall, policy):
        return fall if _visible(fitted, policy.visible_fall) else None
    quiet = np.all(policy.far * before.error < loud) and np.min(fall) > -policy.together
    if quiet and np.max(fitted) > 1 - 1 / policy.far:
        return fitted
    alike = np.all(np.abs(np.log(left / after.error)) < np.log(policy.at_floor))
    silent = np.all(before.error < policy.at_floor * prepared.scales.noise)
    if _log_left(fall) >= policy.together or not (alike or silent):
        return None
    if alike and silent:
        return fitted if _visible(fitted, policy.visible_fall) else None
    return fitted if np.max(fitted) > 2 * policy.visible_fall else None


def falls_where_fitted(before: JudgedFit, after: JudgedFit, policy: Policy) -> bool:
    """Return whether errors fall visibly over the pieces that fits are made to, run as a whole."""
    if not (before.reproducible and after.reproducible):
        return False
    return _visible(1 - after.fitted / before.fitted, policy.visible_fall)


def _visible(fall: Array, least: float) -> bool:
    """Return whether an error falls by at least a share, or several of them do together."""
    return bool(np.max(fall) >= least or _log_left(fall) <= np.log(1 - least))


def _log_left(fall: Array) -> float:
    """Return the log of what is left of the product of all errors."""
    with np.errstate(divide="ignore"):  # an infinite error falls by all of it
        return float(np.sum(np.log(1 - fall)))


def undetermined(fitted: Fit, index: int, policy: Policy, every: bool = False) -> str | None:
    """Return the first number of an effect of a fitted model, if the data leave it open.

    With `every`, any of its numbers that the data leave open.
    """
    effect = fitted.model.effects[index]
    if effect.definition.domain == "input":
        return None
    errors = errors_from(covariance_of(fitted))
    numbers = [p for p in effect.definition.parameters if p.fitted]
    # of a stop, the gap says where it is and the stiffness whether it is there
    sizes = [p for p in numbers if p.counts_force]
    signal = effect.definition.domain == "output"
    for lead in numbers if every else dict.fromkeys((numbers[0], *sizes[:1])):
        error = errors.get(f"effect[{index}].{lead.name}", 0.0)
        size = effect.values[lead.name] - (lead.default if signal else 0.0)  # a gain of 1 is none
        if not error < policy.determined * abs(size):
            return lead.name
    return None


def _no_line_from_outside(
    before: JudgedFit, after: JudgedFit, prepared: PreparedRecord, index: int
) -> str | None:
    """Say whether an effect is a force from outside with a line that the motion has by itself.

    Without inputs a mode may be near a force that is there. What a law of motion does to a decay
    no line takes away by far.
    """
    if _by_far(before, after, prepared.policy) and not after.model.inputs:
        return None
    error = _line_error(after.fit, index)
    return line_of_motion(after.model.effects[index], after.model, prepared.record, error)


def _within_a_sample(model: MechanicalModel, index: int, record: Record) -> str | None:
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
        if late < (_LATE - 0.5 * held) * record.dt:
            samples = late / record.dt
            return f"a {number.name} of {samples:.2g} samples is what its input does between them"
    return None


def _too_heavy(model: MechanicalModel, index: int, policy: Policy) -> str | None:
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
    errors = errors_from(covariance_of(fitted)) if name else {}
    return errors.get(f"effect[{index}].{name}", np.inf)


def line_of_motion(
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
    if not model.inputs and _swings_at(model, effect.values[frequency], record):
        return "in a free decay the machine swings at this frequency by itself"
    inputs = record.signals(model)
    for part in record.parts:
        period = repetition(part.own(inputs), part.dt)
        turns = effect.values[frequency] * (period or np.nan)
        near = min(0.5 / (part.samples * part.dt), _CERTAINLY * error) * (period or np.nan)
        if period and abs(turns - round(turns)) <= near:
            return f"the inputs repeat every {period:.4g} s, and what they move has this line too"
    return None


def _swings_at(model: MechanicalModel, frequency: float, record: Record) -> bool:
    """Return whether a model without inputs has a mode that its record cannot tell from a line."""
    poles = np.linalg.eigvals(model.matrices.first_order()[0])
    apart = np.abs(np.abs(poles.imag) / (2 * np.pi) - frequency)
    width = np.abs(poles.real) / np.pi + 2 / (record.samples * record.dt)
    return bool(np.any(apart < np.maximum(width, _SHIFTS * frequency)))


def _unbeaten(refits: Sequence[RefittedEffect], search: Search) -> list[RefittedEffect]:
    """Leave out what shows in free runs alone, and there no better than a mere repetition.

    Where a force that only repeats with the inputs explains as much, and the fine structure of
    the missing force speaks against an effect, the motion has a law that this effect is not.
    """
    record = search.prepared.record
    if not search.reference.inputs:
        return list(refits)
    lines = [
        item
        for item in refits
        if line_of_motion(item.fitted.model.effects[-1], search.reference, record)
    ]
    least = min((judgement(item.fitted, refits) for item in lines), default=np.inf)
    limit = least + np.log(1 - search.policy.visible_fall)
    beaten = [
        item
        for item in refits
        if item.screened.score < 0 and judgement(item.fitted, refits) > limit and item not in lines
    ]
    why = "a force that merely repeats with the inputs explains as much"
    search.reasons += [f"{item.effect} was not added: {why}." for item in beaten]
    return [item for item in refits if item not in beaten]


def tolerance(search: Search) -> float:
    """Return the relative difference of errors below which two effects are one to this data."""
    return search.policy.same(sum(p.record.samples for p in search.prepared.held_out))


def more_than_noise(fitted: JudgedFit, search: Search) -> bool:
    """Return whether a fit leaves so much more than noise that two kinds could differ by it.

    Far above white noise it does: what is left of the wrong kind may itself look like noise with a
    colour.
    """
    if not search.at_floor(fitted):
        return True
    floor = search.floor_beside(fitted.model, fitted.reproducible)
    return bool(np.any(fitted.error > (1 + tolerance(search)) * floor))


def advantage(item: RefittedEffect, numbers: int, search: Search) -> float:
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
    return tolerance(search)


def _in_turn(ranked: Sequence[RefittedEffect], search: Search) -> list[RefittedEffect]:
    """Return the candidates by error; among equals the one with the fewest parameters first."""
    if not ranked:
        return []
    limit = judgement(ranked[0].fitted, ranked) + tolerance(search)
    joined = connected(search.reference)

    def order(item: RefittedEffect) -> tuple[bool, int, bool, float]:
        error = judgement(item.fitted, ranked)
        if error > limit:
            return True, 0, False, error
        ends = set(item.effect.at) - {"ground"}
        apart = item.effect.definition.domain == "pair" and not any(ends <= g for g in joined)
        return False, item.size, apart, error

    return _simpler_first(_louder_first(sorted(ranked, key=order), search), search)


def _louder_first(ordered: list[RefittedEffect], search: Search) -> list[RefittedEffect]:
    """Put what does better in the louder part of decays ahead if the quiet one hardly differs.

    What is held out of a decay is its quieter part, where a wrong place may do as well.
    """
    best, policy = ordered[0], search.policy
    if search.reference.inputs:
        return ordered
    limit = judgement(best.fitted, ordered) + np.log(1 + policy.together)
    louder = [
        item
        for item in ordered[1:]
        if item.size <= best.size
        and judgement(item.fitted, ordered) < limit
        and falls_where_fitted(best.fitted, item.fitted, policy)
    ]
    if not louder:
        return ordered
    first = min(louder, key=lambda item: float(np.sum(np.log(item.fitted.fitted))))
    return [first, *(item for item in ordered if item is not first)]


def _simpler_first(ordered: list[RefittedEffect], search: Search) -> list[RefittedEffect]:
    """Put a simpler kind of the same family ahead if the first is not better enough."""
    best = ordered[0]
    error = judgement(best.fitted, ordered)
    simpler = [
        item
        for item in ordered
        if rivals(item.effect.definition, best.effect.definition)
        and item.effect.at == best.effect.at
        and item.size < best.size
        and judgement(item.fitted, ordered) < error + advantage(best, item.size, search)
    ]
    if not simpler:
        return ordered
    first = min(simpler, key=lambda item: (item.size, judgement(item.fitted, ordered)))
    # what is like the simpler kind, and simpler still, may be of any family: one that never slips
    # is a preload
    most = judgement(first.fitted, ordered) + tolerance(search)
    like = [i for i in ordered if i.size < first.size and judgement(i.fitted, ordered) < most]
    first = min([first, *like], key=lambda item: (item.size, judgement(item.fitted, ordered)))
    return [first, *(item for item in ordered if item is not first)]


def _first_earned(refits: Sequence[RefittedEffect], search: Search) -> RefittedEffect | None:
    """Return the first candidate that earns its place; those that are refused set no measure."""
    left = list(refits)
    while left:
        item = _in_turn(left, search)[0]
        remark = objection(search.stage, item.fitted, search.prepared)
        if not remark:
            return item
        search.reasons.append(f"{item.effect} was not added: {remark}.")
        left = [other for other in left if other is not item]
    return None


def _beside_constant(
    constant: RefittedEffect, ranked: Sequence[RefittedEffect], search: Search
) -> list[RefittedEffect]:
    """Return what earns its place beside a constant, and the constant; none if nothing does.

    An offset or a preload hides how well other effects do, and friction that never slips takes its
    place if it is left for later. Beside a law that is not linear an offset and a preload are no
    longer alike, so both are tried.
    """
    found: list[tuple[float, list[RefittedEffect]]] = []
    for item in _of_each_family(ranked)[: search.policy.most_paired]:
        for effect in constants_beside(constant, ranked, search):
            both = search.fitted_beside(item.fitted, effect)
            if both is None or objection(constant.fitted, both, search.prepared, place=-2):
                continue
            later = RefittedEffect(ScreenedEffect(effect, 0.0, 0.0), both)
            stays = not objection(item.fitted, both, search.prepared)
            found.append((judgement(both, [both]), [item, later] if stays else [item]))
    return min(found, key=lambda pair: pair[0])[1] if found else []


def _of_each_family(ranked: Sequence[RefittedEffect]) -> list[RefittedEffect]:
    """Return the first of each family at each place, constants left out."""
    first: dict[tuple[str, tuple[str, ...]], RefittedEffect] = {}
    for item in ranked:
        kind = item.effect.definition
        if not item.constant:
            first.setdefault((kind.family or kind.kind, item.effect.at), item)
    return list(first.values())


def constants_beside(
    constant: RefittedEffect, ranked: Sequence[RefittedEffect], search: Search
) -> list[Effect]:
    """Return a constant as fitted, and the likeliest one of each other kind.

    Where it is one of the refits, with the values that were fitted.
    """
    screened = search.screening.candidates if search.screening is not None else ()
    refitted = [item.fitted.model.effects[-1] for item in ranked if item.constant]
    likely = sorted((c for c in screened if c.constant), key=lambda c: -c.score)
    found = [constant.fitted.model.effects[-1], *refitted, *(c.effect for c in likely)]
    return list({effect.kind: effect for effect in reversed(found)}.values())[::-1]


def together(
    refits: Sequence[RefittedEffect],
    pairs: Sequence[tuple[ScreenedEffect, ...]],
    search: Search,
) -> list[RefittedEffect]:
    """Return two effects that earn their places only beside each other, none if there are none.

    Parameters
    ----------
    refits : sequence of RefittedEffect
        Of single effects, none of which earned its place, the best first.
    pairs : sequence of tuple of ScreenedEffect
        What free runs ask for.
    search : Search
    """
    policy, known = search.policy, {item.screened.place: item for item in refits}
    limit = judgement(search.stage, refits) + np.log(1 - policy.hiding_fall)
    near = [i for i in refits[: policy.most_paired] if judgement(i.fitted, refits) < limit]
    if near and not any(item.constant for item in near):
        near += _likeliest_constant(refits, search)
    tried = [*pairs, *((a.screened, b.screened) for a, b in combinations(near, 2))]
    known |= {item.screened.place: item for item in near}
    found: list[tuple[float, list[RefittedEffect]]] = []
    for pair in tried:
        if rivals(pair[0].effect.definition, pair[1].effect.definition):
            continue
        alone = [_alone(candidate, known, search) for candidate in pair]
        if None in alone:
            continue
        one, other = (item for item in alone if item is not None)
        search.say(f"refit with {one.effect} and {other.effect}")
        both = search.fitted_beside(one.fitted, pair[1].effect)
        first = search.fitted_with(search.stage.model, pair[0].effect, pair[1].effect)
        fits = [fitted for fitted in (both, first) if fitted is not None]
        if not fits:
            continue
        both = min(fits, key=lambda fitted: judgement(fitted, fits))
        kept = objection(other.fitted, both, search.prepared, place=-2)
        if not kept and not objection(one.fitted, both, search.prepared):
            found.append((judgement(both, [both]), [one, RefittedEffect(other.screened, both)]))
    if not found:
        return []
    earned = min(found, key=lambda item: item[0])[1]
    search.reasons.append(f"{earned[0].effect} earns its place only beside {earned[1].effect}.")
    return earned


def _alone(
    candidate: ScreenedEffect,
    known: dict[tuple[str, tuple[str, ...]], RefittedEffect],
    search: Search,
) -> RefittedEffect | None:
    """Return the fit of an effect without the other, made now if there is none yet."""
    if candidate.place not in known:
        fitted = search.fitted_with(search.stage.model, candidate.effect)
        if fitted is None:
            return None
        known[candidate.place] = RefittedEffect(candidate, fitted)
    return known[candidate.place]


def _likeliest_constant(ranked: Sequence[RefittedEffect], search: Search) -> list[RefittedEffect]:
    """Return an offset or preload, which alone shows next to nothing of what it hides."""
    refitted = [item for item in ranked if item.constant]
    if refitted or search.screening is None:
        return refitted[:1]
    constants = [c for c in search.screening.candidates if c.constant]
    for candidate in sorted(constants, key=lambda c: -c.score)[:1]:
        fitted = search.fitted_with(search.stage.model, candidate.effect)
        if fitted is not None:
            refitted.append(RefittedEffect(candidate, fitted))
    return refitted
