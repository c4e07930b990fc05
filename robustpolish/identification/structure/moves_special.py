"""Gains that a refit hides in masses and springs.

The gain of the only input is a common factor of all masses and springs. That of a sensor may be
hidden as well, where masses have no sensor: then other numbers explain the record as exactly as the
gain. What the data do not tell, what was known beforehand does: that machine is named whose numbers
are the likelier, at odds that count as very strong evidence (Kass and Raftery 1995, Journal of the
American Statistical Association 90, 773-795).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from robustpolish.identification.diagnosis.findings import (
    IndistinguishablePair,
    indistinguishable_pair,
)
from robustpolish.identification.fit.least_squares import (
    EvaluatedFit,
    evaluate_fit,
    homotopy,
    log_odds,
    with_original_widths,
)
from robustpolish.identification.fit.parameters import (
    chain_keys,
    connected,
    free_parameters,
    inputs_of_chain,
)
from robustpolish.identification.fit.prepared import with_initial_memory
from robustpolish.identification.structure.decays import (
    DampingFits,
    DecaySplit,
    LawSet,
    damped_places,
    damping_laws,
    split_decays,
)
from robustpolish.identification.structure.score import log_error_ratio, undetermined_parameter
from robustpolish.identification.structure.state import Search, parameter_count
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.effects.kind import CONSTANT
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import FORCE

# Selection of damping laws in free decays, by fit error and extrapolation error.
#
# Every law of damping takes energy away, and beside a viscous damper whose size is open nearly
# every other one explains most of a decay: a search that adds one effect at a time ends with those
# that came first. Here all sets of laws at a place compete at once, the own damper being one of
# them.


def select_damping_laws(search: Search) -> Search:
    """Give each damped place of free decays the laws that fit it and predict how it goes on.

    Parameters
    ----------
    search : Search
        At its end.

    Returns
    -------
    Search
        As it was where a record is no decay.
    """
    prepared, known = search.prepared, len(search.reference.effects)
    cut = split_decays(search.reference, prepared.record)
    whole = len(prepared.everything) == len(prepared.record.parts)  # not judged in windows
    if cut is None or not search.stage.reproducible or not whole:
        return search
    for at in damped_places(search.stage.model, known):
        search.say(f"laws of damping at {', '.join(at)}")
        here = [(e.kind, e.at) for e in search.stage.model.effects[known:]]
        # of one family: what looks like something else, beside a damper, damps nothing here
        alike = [
            p.second
            for p in search.indistinguishable_pairs
            if (p.first.kind, p.first.at) in here
            and p.first.definition.family == p.second.definition.family
        ]
        trials = _damping_fits(search, search.stage.model, at, cut, alike)
        if not np.isfinite(trials.found.dissipated_power):
            continue  # no observer follows a law far stronger than the springs
        good = trials.plausible_sets(partial(_is_identifiable, trials))
        if not all(trials.found.effects(laws) for laws in good):
            continue  # a damper alone does about as well, and nothing else was found
        if good:
            chosen = _select_damping_set(trials, good)
            settled = search.copy()
            settled.indistinguishable_pairs = _indistinguishable_laws(search, trials, chosen, good)
            _note_replaced_laws(settled, trials, chosen)
            _accept(settled, _drop_unneeded_effects(settled, trials, chosen), chosen)
            if not (
                settled.added > search.added and _is_worse_held_out(search, settled, trials, chosen)
            ):
                search = settled
    return search


def _is_worse_held_out(before: Search, after: Search, trials: DampingFits, chosen: LawSet) -> bool:
    """Return whether laws leave more when held out than what was found, or predict visibly worse.

    A fit of all laws at once may end elsewhere than the one that the search had reached; and a law
    may take what another force of the machine, which is not known, does to the loud part alone.
    """
    if log_error_ratio(after.stage, before.stage) > -np.log(1 - before.policy.together):
        return True
    found = trials.found.found
    if not np.isfinite(trials.error(found)):
        return False
    ahead = trials.extrapolation_error(chosen) - trials.extrapolation_error(found)
    return bool(ahead > -np.log(1 - before.policy.visible_fall))


def _damping_fits(
    search: Search,
    model: MechanicalModel,
    at: tuple[str, ...],
    cut: DecaySplit,
    alike: Sequence[Effect],
) -> DampingFits:
    prepared, known = search.prepared, len(search.reference.effects)
    motion = prepared.motion(model, prepared.record)
    laws = damping_laws(model, known, at, motion, prepared.record, alike)
    return DampingFits(prepared, search.reference, laws, cut)


def _is_identifiable(trials: DampingFits, laws: LawSet) -> bool:
    """Return whether the data determine every effect of a set, and its numbers are physical.

    Friction whose memory the data leave open is friction without.
    """
    fitted, first = trials.fits[laws], trials.found.first
    return all(
        not effect.definition.implausible(effect.values)
        and not undetermined_parameter(
            fitted, first + i, trials.prepared.policy, bool(effect.definition.states)
        )
        for i, effect in enumerate(fitted.model.effects[first:])
        if i < len(trials.found.effects(laws))
    )


def _select_damping_set(trials: DampingFits, good: list[LawSet]) -> LawSet:
    """Return the set of laws that predicts best, of those as good the one with the fewest effects.

    The own damper is known to be there: it goes only where it does harm. Where the beginning of a
    decay leaves a law open, luck decides how it goes on: what a fit to all of it does not need is
    no finding.
    """
    verdict, found = trials.extrapolation_error, trials.found
    plain = [laws for laws in good if not _adds_friction_parameters(trials, laws)] or good
    chosen = _best_predicting_set(trials, plain)
    # the numbers of a richer kind make a decay's end a matter of luck; but it may be the one law
    # that takes several others to mimic it
    fewer = [
        laws
        for laws in good
        if len(found.effects(laws)) < len(found.effects(chosen))
        and (
            verdict(laws) <= verdict(chosen) + trials.same
            or _log_odds_of_set(trials, chosen, laws) > trials.prepared.policy.least_odds
        )
    ]
    return _best_predicting_set(trials, fewer) if fewer else chosen


def _adds_friction_parameters(trials: DampingFits, laws: LawSet) -> bool:
    """Return whether a set has a kind of friction with more numbers than the one that was found."""
    found = trials.found
    most = max((parameter_count(e) for e in found.here if e.definition.family), default=0)
    return any(
        parameter_count(effect) > most
        for effect in found.effects(laws)
        if effect.kind in {other.kind for other in found.alike}
    )


def _best_predicting_set(trials: DampingFits, good: list[LawSet]) -> LawSet:
    """Return the set that predicts best, of those as good the one with the fewest effects."""
    verdict, found = trials.extrapolation_error, trials.found
    good = [
        laws
        for laws in good
        if not any(_has_unneeded_effects(trials, laws, fewer) for fewer in good)
    ]
    least = min(verdict(laws) for laws in good)
    good = [laws for laws in good if verdict(laws) <= least + trials.same]
    fewest = min(len(found.effects(laws)) for laws in good)
    good = [laws for laws in good if len(found.effects(laws)) == fewest]
    best = min(good, key=verdict)
    damped = [laws for laws in good if not found.held(laws)]
    kept = min(damped, key=verdict, default=best)
    return kept if verdict(kept) < verdict(best) + trials.same else best


def _has_unneeded_effects(trials: DampingFits, laws: LawSet, fewer: LawSet) -> bool:
    """Return whether a set of laws is another and effects that the whole record does not need."""
    effects = trials.found.effects
    if not (fewer < laws and len(effects(fewer)) < len(effects(laws))):
        return False
    samples, policy = trials.prepared.record.Y.size, trials.prepared.policy
    return samples * (trials.error(fewer) - trials.error(laws)) < policy.least_odds


def _drop_unneeded_effects(search: Search, trials: DampingFits, chosen: LawSet) -> DampingFits:
    """Return the trials without other effects that these laws leave next to nothing to do.

    Beside the wrong laws of damping something else had to do their work. A constant fits any
    record a little better; it has to predict.
    """
    near, known = -np.log(1 - search.policy.together), len(search.reference.effects)
    for effect in [e for e in trials.found.model.effects[known:] if e not in trials.found.here]:
        if effect.definition.acts_on_signals and effect.definition.family != CONSTANT:
            continue  # a gain stands for numbers that the fit would bend again
        model = trials.found.model
        rest = replace(model, effects=tuple(e for e in model.effects if e is not effect))
        without = _damping_fits(search, rest, trials.found.at, trials.cut, trials.found.alike)
        worse = without.error(chosen) - trials.error(chosen)
        if not np.isfinite(worse) or (worse > near and effect.definition.family != CONSTANT):
            continue
        if without.extrapolation_error(chosen) < trials.extrapolation_error(chosen) + near:
            search.reasons.append(f"{effect} was not kept: the damping explains as much.")
            trials = without
    return trials


def _note_replaced_laws(search: Search, trials: DampingFits, chosen: LawSet) -> None:
    """Say what the search had found instead."""
    found = trials.found
    if chosen == found.found:
        return
    before, after = ([e.kind for e in found.effects(laws)] for laws in (found.found, chosen))
    damper = " and no viscous damper" if found.held(chosen) else ""
    search.reasons.append(
        f"At {', '.join(found.at)} {', '.join(after)}{damper} fit the decay and predict its end "
        f"from its beginning better than {', '.join(before) or 'a viscous damper'}, found one by "
        "one, or as well with fewer effects."
    )


def _indistinguishable_laws(
    search: Search, trials: DampingFits, chosen: LawSet, good: list[LawSet]
) -> list[IndistinguishablePair]:
    """Return the pairs that data cannot tell apart: of other effects, and of the laws chosen."""
    kept = {(e.kind, e.at) for e in trials.found.effects(chosen)}
    gone = {(e.kind, e.at) for e in trials.found.here} - kept
    pairs = [p for p in search.indistinguishable_pairs if (p.first.kind, p.first.at) not in gone]
    for laws in good:
        near = (
            abs(trials.extrapolation_error(laws) - trials.extrapolation_error(chosen)) < trials.same
        )
        if near or _differs_in_friction_only(trials, chosen, laws):
            mine = _fitted_effects(trials, chosen, but=laws)
            pairs += [
                indistinguishable_pair(one, other)
                for one in mine
                for other in _fitted_effects(trials, laws, chosen)
            ]
    return list({(p.first.kind, p.first.at, p.second.kind, p.second.at): p for p in pairs}.values())


def _differs_in_friction_only(trials: DampingFits, chosen: LawSet, other: LawSet) -> bool:
    """Return whether two sets differ in the kind of friction alone, and fit all as well.

    How a decay goes on says little there: its beginning may leave more numbers of one kind open.
    """
    kinds = [trials.found.laws[i].effect for i in chosen ^ other]
    if len(kinds) != 2 or any(e is None or not e.definition.family for e in kinds):
        return False
    return abs(_log_odds_of_set(trials, chosen, other)) < trials.prepared.policy.strong_odds


def _log_odds_of_set(trials: DampingFits, one: LawSet, other: LawSet) -> float:
    """Return the log odds by which the whole record prefers another set of laws to one."""
    return log_odds(trials.fits[other], trials.fits[one])


def _fitted_effects(trials: DampingFits, laws: LawSet, but: LawSet) -> list[Effect]:
    """Return the effects of a set of laws, as they were fitted in it, that another has not."""
    kinds = [effect.kind for effect in trials.found.effects(laws - but)]
    effects = trials.fits[laws].model.effects[trials.found.first :]
    return [e for e in effects[: len(trials.found.effects(laws))] if e.kind in kinds]


def _accept(search: Search, trials: DampingFits, chosen: LawSet) -> None:
    """Go on with the model that has a set of laws, and its numbers at their minimum."""
    found, reference = trials.found, search.reference
    prepared = replace(search.prepared, held=search.prepared.held | found.held(chosen))
    fitted = with_original_widths(
        trials.fits[chosen], found.model_with(chosen), prepared, reference
    )
    before, known = search.stage.model.effects, len(reference.effects)
    search.prepared, search.stage = prepared, evaluate_fit(fitted, prepared)
    effects = fitted.model.effects
    # steps up to the first effect that is another one stay as they were
    same = known
    while same < min(len(before), len(effects)) and _same_effect(before[same], effects[same]):
        same += 1
    same = min(same, len(effects) - 1)
    del search.steps[2 + same - known :]
    search.steps += [(effects[i].kind, _fit_partial_model(search, fitted.model, i))
                     for i in range(same, len(effects) - 1)]  # fmt: skip
    search.steps.append((effects[-1].kind, fitted.model))


def _same_effect(one: Effect, other: Effect) -> bool:
    return (one.kind, one.at) == (other.kind, other.at)


def _fit_partial_model(search: Search, model: MechanicalModel, last: int) -> MechanicalModel:
    """Return the model with its effects up to one, fitted, the own damper being free again."""
    prepared = replace(search.prepared, held=frozenset())
    part = replace(model, effects=model.effects[: last + 1])
    spans = prepared.spans(prepared.trial, prepared.policy.growth)
    pieces = with_initial_memory(part, prepared.trial)
    fits = homotopy(part, prepared, pieces, search.reference, spans)
    return fits[-1].model if fits else part


@dataclass(frozen=True)
class GainError:
    """A gain that explains what a refit did to masses and springs.

    Attributes
    ----------
    effect : Effect
    alike : tuple of Effect
        Effects that would explain it as well.
    """

    effect: Effect
    alike: tuple[Effect, ...]


def add_gain_errors(search: Search) -> None:
    """Add the gains that explain what the refit did to masses and springs, if there are any."""
    _relocate_gain(search)
    for wrong in _common_gain_errors(search):
        _add(search, wrong)
    _add_most_likely_gain(search)


def _relocate_gain(search: Search) -> None:
    """Put a gain that was found where the data do not tell it from, if numbers are likelier so."""
    pairs = [
        p for p in search.indistinguishable_pairs if p.first.kind == p.second.kind == "sensor_gain"
    ]
    for pair in pairs:
        here = [(e.kind, e.at) for e in search.stage.model.effects]
        if (pair.first.kind, pair.first.at) not in here:
            continue
        at = here.index((pair.first.kind, pair.first.at))
        moved = _with_gain(search, pair.second, at)
        if moved is None or _log_odds_with_priors(moved, search) <= search.policy.strong_odds:
            continue
        before, search.stage = search.stage, moved
        named = moved.model.effects[at]
        search.indistinguishable_pairs[search.indistinguishable_pairs.index(pair)] = (
            indistinguishable_pair(named, pair.first)
        )
        _note_prior_evidence(search, named, before)
        search.steps[-1] = (search.steps[-1][0], moved.model)


def _add_most_likely_gain(search: Search) -> None:
    """Add the gain beside which the numbers are far likelier than they are without any gain."""
    policy, model = search.policy, search.stage.model
    # where more than noise is left, numbers bend to what is missing, and so would a gain
    if _prior_penalty(search.stage, search) <= policy.strong_odds or not search.residual_is_noise(
        policy.at_noise_floor
    ):
        return
    # numbers that one effect after the other has bent may lie far out in a flat valley
    straight = _refit_from_reference(search, model.effects)
    if straight is not None and _log_odds_with_priors(straight, search) > 0:
        search.stage = straight
        search.steps[-1] = (search.steps[-1][0], straight.model)
        if _prior_penalty(straight, search) <= policy.strong_odds:
            return
    there = {(e.kind, e.at) for e in model.effects}
    gains = [("sensor_gain", (o.name,)) for o in model.outputs if o.quantity != FORCE]
    gains += [("input_gain", (i.name,)) for i in model.inputs if i.imposes is None]
    tried = [Effect(kind, at, {"gain": 1.0}) for kind, at in gains if (kind, at) not in there]
    fits = [fitted for effect in tried if (fitted := _with_gain(search, effect)) is not None]
    ranked = sorted(
        ((_log_odds_with_priors(fitted, search), i) for i, fitted in enumerate(fits)), reverse=True
    )
    if not ranked or ranked[0][0] <= policy.strong_odds:
        return
    before, search.stage = search.stage, fits[ranked[0][1]]
    named = search.stage.model.effects[-1]
    search.indistinguishable_pairs += [
        indistinguishable_pair(named, fits[i].model.effects[-1])
        for odds, i in ranked[1:]
        if ranked[0][0] - odds <= policy.strong_odds
    ]
    _note_prior_evidence(search, named, before)
    search.steps.append((named.kind, search.stage.model))


def _note_prior_evidence(search: Search, named: Effect, before: EvaluatedFit) -> None:
    search.reasons.append(
        f"Other numbers explain as much as {named}, but "
        f"{_largest_deviation(before, search)}, and that is "
        "known better."
    )


def _log_odds_with_priors(fitted: EvaluatedFit, search: Search) -> float:
    """Return the log odds of a fit over the best so far, by held-out errors and what was known.

    A lower error is no evidence here: screening would have seen it.
    """
    samples = sum(piece.record.samples for piece in search.prepared.held_out)
    fall = float(np.sum(np.log(search.stage.error / fitted.error)))
    return (
        samples * min(fall, 0.0)
        + _prior_penalty(search.stage, search)
        - _prior_penalty(fitted, search)
    )


def _prior_deviations(fitted: EvaluatedFit, search: Search) -> dict[str, float]:
    """Return how far numbers moved from what was known, in standard deviations of that."""
    model, prepared = fitted.model, search.prepared
    values = model.parameters
    free = free_parameters(model, prepared.scales.bandwidth, search.policy, search.reference)
    return {f.key: (values[f.key] - f.centre) / f.prior for f in free if np.isfinite(f.prior)}


def _prior_penalty(fitted: EvaluatedFit, search: Search) -> float:
    """Return by how much less likely the numbers are than what was known, as log odds."""
    return 0.5 * sum(moved**2 for moved in _prior_deviations(fitted, search).values())


def _largest_deviation(fitted: EvaluatedFit, search: Search) -> str:
    """Say which number moved furthest."""
    moved = _prior_deviations(fitted, search)
    key = max(moved, key=lambda name: abs(moved[name]))
    before, after = (m.parameters[key] for m in (search.reference, fitted.model))
    return f"{key} would be {after:.3g} instead of {before:.3g}"


def _add(search: Search, wrong: GainError) -> None:
    """Add the gain of an input, if the error does not mind."""
    effect, stage = wrong.effect, _with_gain(search, wrong.effect)
    if stage is None:
        return
    if _log_error_increase(search.stage, stage) > search.policy.gain_loss:
        return
    search.stage = stage
    search.indistinguishable_pairs += [
        indistinguishable_pair(effect, other) for other in wrong.alike
    ]
    search.reasons.append(
        f"Masses and springs err by one factor: {effect.at[0]} acts {effect.values['gain']:.3g} "
        "times as strongly as the record says."
    )
    search.steps.append((effect.kind, stage.model))


def _log_error_increase(before: EvaluatedFit, after: EvaluatedFit) -> float:
    """Return the log of the error that is lost; near chaos only long runs part by chance."""
    pairs = (after.error, before.error), (after.short, before.short)
    return min(float(np.mean(np.log(new / old))) for new, old in pairs)


def _with_gain(search: Search, gain: Effect, at: int | None = None) -> EvaluatedFit | None:
    """Return the model with a gain, fitted from its numbers as they were; None if nothing ended.

    It comes last, or takes the place of the effect that stands at `at`.
    """
    search.say(f"refit with {gain}")
    there = search.stage.model.effects
    effects = (*there, gain) if at is None else (*there[:at], gain, *there[at + 1 :])
    return _refit_from_reference(search, effects)


def _refit_from_reference(search: Search, effects: tuple[Effect, ...]) -> EvaluatedFit | None:
    """Return the model with these effects, fitted from its own numbers as they were."""
    spans = search.prepared.spans(search.prepared.trial)
    return search.fit_over_windows(replace(search.reference, effects=effects), spans)


def _common_gain_errors(search: Search) -> list[GainError]:
    """Return the gains that a refit hides in a common factor of masses and springs."""
    before, after = search.reference, search.stage.model
    old, new = before.parameters, after.parameters
    found = []
    there = {(e.kind, e.at) for e in after.effects}
    for chain in connected(before):
        names = inputs_of_chain(before, chain)
        if len(names) != 1 or ("input_gain", (names[0],)) in there:
            continue
        masses, springs, _ = chain_keys(before, chain)
        gain = np.log(new[f"input.{names[0]}.gain"] / old[f"input.{names[0]}.gain"])
        moved = [
            gain - np.array([np.log(new[k] / old[k]) for k in keys if old[k] > 0 and new[k] > 0])
            for keys in (masses, springs)
        ]
        if not all(logs.size for logs in moved):
            continue
        # masses are weighed, springs are known roughly: each may err by itself, their mean hardly
        common = float(np.mean(moved[0]))
        apart = max(float(np.ptp(moved[0])), abs(float(np.mean(moved[1])) - common))
        spread = search.policy.gain_spread * abs(common)
        if abs(common) < search.policy.gain_least or apart > spread:
            continue
        effect = Effect("input_gain", (names[0],), {"gain": float(np.exp(common))})
        outputs = [o.name for o in before.outputs if chain.intersection(o.of)]
        alike = [Effect("sensor_gain", (outputs[0],))] if len(outputs) == 1 else []
        found.append(GainError(effect, tuple(alike)))
    return found
