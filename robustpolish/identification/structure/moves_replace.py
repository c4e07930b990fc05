"""What was found, looked at again beside what was found later.

An effect that was added early was chosen while the others were missing. It may have nothing left to
do beside them, or another kind of its family may do it better.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from robustpolish.base.budget import parallel_map
from robustpolish.identification.diagnosis.findings import indistinguishable_pair
from robustpolish.identification.fit.least_squares import (
    EvaluatedFit,
    Fit,
    covariance_of,
    free_run_rms,
    with_effect_order,
)
from robustpolish.identification.fit.parameters import has_smoothing
from robustpolish.identification.fit.result import stderr_from_covariance
from robustpolish.identification.structure.candidates import family_alternatives
from robustpolish.identification.structure.evidence import find_force_equivalents
from robustpolish.identification.structure.score import (
    equivalence_tolerance,
    exceeds_noise_floor,
    log_error_ratio,
    ranking_error,
    rejection_reason,
    required_advantage,
    significant_improvement,
)
from robustpolish.identification.structure.screening import (
    ScreenedEffect,
    mutually_exclusive,
    places,
)
from robustpolish.identification.structure.state import RefittedEffect, Search, parameter_count
from robustpolish.machines.effects.effect import Effect, kinds
from robustpolish.machines.effects.kind import CONSTANT
from robustpolish.machines.mechanical.data import port_rows
from robustpolish.machines.mechanical.model import MechanicalModel


def backward_elimination(search: Search, last: bool = False) -> Search:
    """Return the search without effects that do not earn their place beside the others.

    Parameters
    ----------
    search : Search
    last : bool, optional
        Whether the last effect is asked too; it has just earned its place, unless it was added on
        trial.
    """
    first = len(search.reference.effects)
    some_stay = False
    for at in reversed(range(first, len(search.stage.model.effects) - (not last))):
        without = search.fit_without(search.stage.model, at)
        if (without is None or not _is_as_good_without(without, search)) and _is_rejected(
            search, at
        ):
            without = _refit_others_from_linear(search, at)
        if without is None or not _is_as_good_without(without, search):
            some_stay = True
            continue
        effect = search.stage.model.effects[at]
        search = search.copy()
        search.stage = without
        search.reasons.append(f"{effect} was not kept: the others explain as much.")
        if some_stay:  # beside the one that went; they are asked again
            return backward_elimination(search, last)
    return search


def _is_rejected(search: Search, at: int) -> bool:
    """Return whether an effect has no place, whatever goes wrong without it."""
    return rejection_reason(search.linear, search.stage, search.prepared, at) is not None


def _refit_others_from_linear(search: Search, at: int) -> EvaluatedFit | None:
    """Return the effects without one, as they are, fitted beside the numbers of none of them.

    What has no place may have bent the springs so far that no fit leads back from there.
    """
    model = search.stage.model
    others = [each for each in search.added_to(model) if each is not model.effects[at]]
    return search.fit_with(search.linear.model, *others)


def replace_kinds(search: Search) -> Search:
    """Return the search with the kinds of each family that are best beside all other effects.

    The rivals of the last effect have been tried beside all others when it was added, begun
    without any of them; where more than noise is left they are begun from each other, too.
    Constants at two places are rivals as well, the last one too: a fit from another start may tell
    them apart. Beside another kind some of the others may have nothing left to do: of two kinds
    that do as well the one that needs fewer others is taken.
    """
    first, count = len(search.reference.effects), len(search.stage.model.effects)
    before = search.stage
    for at in reversed(range(first, count)):
        effect = search.stage.model.effects[at]
        others = _replacement_fits(search, at, last=at == count - 1)
        ranked = sorted(others, key=lambda item: ranking_error(item.fitted, others))
        for item in ranked:
            apart = ranking_error(item.fitted, ranked) - ranking_error(search.stage, ranked)
            enough = required_advantage(item, parameter_count(effect), search)
            if apart < -enough and not rejection_reason(
                search.linear, item.fitted, search.prepared
            ):
                search = search.copy()
                search.stage = item.fitted
                break
            if apart < equivalence_tolerance(search) or _fits_whole_record_as_well(
                item.fitted, search
            ):
                fewer = _replacement_with_fewer(item, search)
                if fewer is not None:
                    search = fewer
                    break
                search.indistinguishable_pairs.append(
                    indistinguishable_pair(effect, item.fitted.model.effects[-1])
                )
    return search if search.stage is before else backward_elimination(search, last=True)


def _replacement_with_fewer(item: RefittedEffect, search: Search) -> Search | None:
    """Return the search with another effect in place of one, if that leaves others needless.

    The offset of a sensor beside a cubic spring is a constant force, a cubic and a quadratic one.
    """
    other = replace(search.copy(), stage=item.fitted)
    if rejection_reason(search.linear, item.fitted, search.prepared):
        return None
    fewer = backward_elimination(other)
    return fewer if fewer.added < search.added else None


def _fits_whole_record_as_well(other: EvaluatedFit, search: Search) -> bool:
    """Return whether a fit leaves as little of the whole record, fitted and held out.

    A kind that holds another as a special case may predict a little worse by the luck of its
    further numbers, and be the right one.
    """
    prepared = search.prepared
    predictable = other.reproducible and search.stage.reproducible
    pieces = prepared.everything if predictable else prepared.windows
    left, least = (
        float(np.mean(np.log(free_run_rms(fitted.model, prepared, pieces))))
        for fitted in (other, search.stage)
    )
    return left - least < equivalence_tolerance(search)


def _replacement_fits(search: Search, at: int, last: bool) -> list[RefittedEffect]:
    """Refit what may stand in place of an effect."""
    family = search.stage.model.effects[at].definition.family
    if not family:
        return []
    if family == CONSTANT:
        return _refit_constants_elsewhere(search, at)
    return [
        *([] if last else _refit_family_alternatives(search, at)),
        *_refit_force_equivalents(search, at),
    ]


def _refit_force_equivalents(search: Search, at: int) -> list[RefittedEffect]:
    """Refit the other kinds from the numbers that make the same force, if that is not enough."""
    if not exceeds_noise_floor(search.stage, search):
        return []
    tried = []
    for effect in close_force_equivalents(search, search.stage.model, at):
        fitted = _fit_with_replacement(search, search.stage.model, at, effect)
        if fitted is not None:
            tried.append(RefittedEffect(ScreenedEffect(effect, 0.0, 0.0), fitted))
    return tried


def _refit_constants_elsewhere(search: Search, at: int) -> list[RefittedEffect]:
    """Refit the other constants in place of one, beside all other effects."""
    model = search.stage.model
    taken = [(other.kind, other.at) for other in model.effects]
    constants = [kind for kind in kinds().values() if kind.family == CONSTANT]
    tried = []
    for kind, place in ((k, at_) for k in constants for at_ in places(model, k)):
        if (kind.kind, place) not in taken:
            same = kind.kind == model.effects[at].kind
            other = Effect.of(kind, place, model.effects[at].parameters if same else None)
            fitted = _fit_with_replacement(search, model, at, other)
            if fitted is not None:
                tried.append(RefittedEffect(ScreenedEffect(other, 0.0, 0.0), fitted))
    return tried


def _refit_family_alternatives(search: Search, at: int) -> list[RefittedEffect]:
    """Refit the other kinds that free runs find nearly as good, beside all other effects."""
    prepared, screening = search.prepared, search.screening
    assert screening is not None  # effects have been added
    without = search.fit_without(search.stage.model, at)
    if without is None:
        return []
    found = family_alternatives(search.stage.model.effects[at], without.fit, prepared, screening)
    most = search.policy.near_error * (1 - max((c.fall for c in found), default=0.0))
    tried = []
    for candidate in found:
        if 1 - candidate.fall < most:
            search.say(f"refit with {candidate.effect} instead")
            fitted = search.fit_with(without.model, candidate.effect)
            if fitted is not None:
                tried.append(RefittedEffect(candidate, fitted))
    return tried + fits_with_smoothing(tried, without.model, search)


def fits_of_simpler_kinds(
    search: Search, model: MechanicalModel, at: int
) -> Iterator[EvaluatedFit]:
    """Fit kinds with fewer numbers in place of an effect of a model, the fewest first.

    They begin with the values that they have in common with it, if it has all of theirs, and with
    the force that it makes.
    """
    effect = model.effects[at]
    near = close_force_equivalents(search, model, at)
    fewer = [
        e for e in (*_nested_kinds(effect), *near) if parameter_count(e) < parameter_count(effect)
    ]
    for instead in sorted(fewer, key=parameter_count):
        fitted = _fit_with_replacement(search, model, at, instead)
        if fitted is not None:
            yield fitted


def lower_error_kinds(search: Search) -> list[Effect]:
    """Return the kinds of the last effect's family that came closer in its place, as fitted.

    Where a simpler kind stands for another that errs less, so it does for those in between.
    """
    stage, last = search.stage, search.stage.model.effects[-1]
    found = {}
    for turn in search.selection_steps:
        for item in turn.others:
            other = item.fitted.model.effects[-1]
            if (
                other.kind != last.kind
                and mutually_exclusive(other.definition, last.definition)
                and other.at == last.at
                and _all_but_last(item.fitted) == _all_but_last(stage)
                and log_error_ratio(item.fitted, stage) < 0
            ):
                found[other.kind] = other
    return list(found.values())


def _all_but_last(fitted: EvaluatedFit) -> list[tuple[str, tuple[str, ...]]]:
    """Return the kinds and places of all effects but the last."""
    return sorted((effect.kind, effect.at) for effect in fitted.model.effects[:-1])


def _nested_kinds(effect: Effect) -> Iterator[Effect]:
    """Yield the kinds all of whose numbers an effect has, with the values that it has."""
    kind, values = effect.definition, effect.values
    for other in kinds().values():
        names = [p.name for p in other.parameters if p.fitted]
        if other.kind != kind.kind and mutually_exclusive(other, kind) and set(values) > set(names):
            turn = [other.turns_over] if other.turns_over in values else []
            yield Effect(other.kind, effect.at, {name: values[name] for name in (*names, *turn)})


def close_force_equivalents(search: Search, model: MechanicalModel, at: int) -> list[Effect]:
    """Return the rivals of an effect that make nearly its force, the nearest first."""
    found = find_force_equivalents(model, at, search.prepared)
    return [mimic.effect for mimic in found if mimic.left < search.policy.mimicked]


def prune_indistinguishable(search: Search) -> Search:
    """Return the search with those pairs that the data cannot tell apart beside all other effects.

    Parameters
    ----------
    search : Search
        At its end. Rivals of the last effect were tried beside all others; what looked alike while
        something else was missing may be told apart beside it, and two that were found are none.
    """
    first = len(search.reference.effects)
    here = [(effect.kind, effect.at) for effect in search.stage.model.effects]
    kept = []
    once = {
        (p.first.kind, p.first.at, p.second.kind, p.second.at): p
        for p in search.indistinguishable_pairs
    }
    for pair in once.values():
        one, other = ((effect.kind, effect.at) for effect in (pair.first, pair.second))
        if one not in here[first:] or other in here[first:]:
            continue
        at = here.index(one, first)
        if at == len(here) - 1 or _replacement_is_as_good(search, at, pair.second):
            kept.append(pair)
    return (
        search
        if len(kept) == len(search.indistinguishable_pairs)
        else replace(search, indistinguishable_pairs=kept)
    )


def fits_with_smoothing(
    refits: Sequence[RefittedEffect], start: MechanicalModel, search: Search
) -> list[RefittedEffect]:
    """Return the dry frictions that jump once more, the speeds of their turns being fitted.

    A friction that is fitted as a jump leaves something at every reversal if it is none, which
    kinds with memory and more numbers take for theirs.

    Parameters
    ----------
    refits : sequence of RefittedEffect
        At one place.
    start : MechanicalModel
        The model without any of them.
    search : Search

    Returns
    -------
    list of RefittedEffect
        None where a jump leaves noise alone. The one with the fewest numbers comes first; where it
        leaves noise alone, the others are not asked.
    """
    dry = [item for item in refits if item.effect.definition.turns_over]
    jumps = [item for item in dry if not has_smoothing(item.effect)]
    least = (1 + equivalence_tolerance(search)) * search.prepared.scales.noise
    if any(np.all(item.fitted.error < least) for item in jumps):
        return []
    found: list[RefittedEffect] = []
    for item in sorted(jumps, key=lambda item: len(item.effect.values)):
        rounded = _fit_with_smoothing(item, start, search)
        if rounded is None:
            continue
        found.append(rounded)
        if np.all(rounded.fitted.error < least):
            break
    return found


def _fit_with_smoothing(
    jump: RefittedEffect, start: MechanicalModel, search: Search
) -> RefittedEffect | None:
    """Return a friction fitted with the speed of its turn, None if the data leave that open."""
    jumping = jump.fitted.model
    gentle = with_smoothing_velocity(jumping, len(jumping.effects) - 1, search)
    if gentle is None:
        return None
    fitted = search.fit_with(start, gentle)
    if fitted is None or not smoothing_is_determined(fitted.fit, -1, search):
        return None
    return RefittedEffect(replace(jump.screened, effect=gentle), fitted)


def with_smoothing_velocity(model: MechanicalModel, at: int, search: Search) -> Effect | None:
    """Return a dry friction that turns over within some speed, None if nothing moves there.

    Where the turn is far wider than the true one, the other numbers are bent by it, and where it is
    far sharper, it makes no difference: from neither do slopes lead to the true one. So a ladder of
    speeds is run through first, all other numbers held.

    Parameters
    ----------
    model : MechanicalModel
        With the friction as it was fitted as a jump.
    at : int
        Where it stands among the effects.
    search : Search
    """
    policy, prepared, effects = search.policy, search.prepared, model.effects
    effect = effects[at]
    motion = prepared.motion(model, prepared.screened)
    speed = float(np.sqrt(np.mean((port_rows(model, effect) @ motion.v)[0] ** 2)))
    if not speed > 0:
        return None
    search.say(f"refit with {effect} that turns over gently")
    name = effect.definition.turns_over
    tried = [
        effect.with_values({**effect.parameters, name: share * speed})
        for share in policy.smoothing_shares
    ]

    def left(gentle: Effect) -> float:
        turned = replace(model, effects=(*effects[:at], gentle, *effects[at + 1 :]))
        return float(np.mean(np.log(free_run_rms(turned, prepared, prepared.windows))))

    errors = parallel_map(left, tried[::-1])  # the sharpest first: it takes the most steps
    return tried[int(np.argmin(errors[::-1]))]


def smoothing_is_determined(fitted: Fit, index: int, search: Search) -> bool:
    """Return whether the data determine the speed over which a friction of a fit turns over."""
    index %= len(fitted.model.effects)
    effect = fitted.model.effects[index]
    name = effect.definition.turns_over
    error = stderr_from_covariance(covariance_of(fitted)).get(f"effect[{index}].{name}", np.inf)
    return bool(error < search.policy.determined * effect.values[name])


def rebuild_steps(search: Search) -> Search:
    """Return the search with the steps that lead to the effects it has now, one after the other.

    What makes the error fall most comes first, as if they had been found one by one.
    """
    effects, known = search.stage.model.effects, len(search.reference.effects)
    order, left = list(range(known)), list(range(known, len(effects)))
    steps = search.steps[:2]
    while left:
        model = None if len(left) == 1 else _next_step(order[known:], left, search)
        order.append(left.pop(0))
        steps.append((effects[order[-1]].kind, model or search.stage.model))
    fitted = with_effect_order(search.stage.fit, order)
    steps[-1] = (steps[-1][0], fitted.model)
    return replace(search, stage=replace(search.stage, fit=fitted), steps=steps)


def _next_step(told: Sequence[int], left: list[int], search: Search) -> MechanicalModel | None:
    """Move the effect that comes after those told to the front; return a model fitted with them.

    None if no fit ended well.
    """
    effects = search.stage.model.effects
    before = [effects[i] for i in told]
    fits = {i: search.fit_with(search.linear.model, *before, effects[i]) for i in left}
    good = {i: fitted for i, fitted in fits.items() if fitted is not None}
    if not good:
        return None
    best = min(good, key=lambda i: ranking_error(good[i], list(good.values())))
    left.insert(0, left.pop(left.index(best)))
    return good[best].model


def _is_as_good_without(without: EvaluatedFit, search: Search) -> bool:
    """Return whether a model leaves no output visibly more than the search, and bends no effect."""
    return not makes_others_implausible(search, search.stage.model, without.model) and (
        significant_improvement(without, search.stage, search.prepared) is None
    )


def makes_others_implausible(
    search: Search, model: MechanicalModel, without: MechanicalModel
) -> bool:
    """Return whether effects are absurd without another one that are not in the model with it.

    They do not do its work then: a friction does that of a drag by falling with speed, to nothing.
    """

    def absurd(one: MechanicalModel) -> set[tuple[str, tuple[str, ...]]]:
        added = search.added_to(one)
        return {(e.kind, e.at) for e in added if e.definition.implausible(e.values)}

    return not absurd(without) <= absurd(model)


def _replacement_is_as_good(search: Search, at: int, other: Effect) -> bool:
    """Return whether another effect in place of one leaves as little."""
    fitted = _fit_with_replacement(search, search.stage.model, at, other)
    if fitted is None:
        return False
    return log_error_ratio(fitted, search.stage) < equivalence_tolerance(search)


def _fit_with_replacement(
    search: Search, model: MechanicalModel, at: int, other: Effect
) -> EvaluatedFit | None:
    """Refit a model with another effect in place of one, None if no fit ended well."""
    search.say(f"refit with {other} in place of {model.effects[at]}")
    return search.fit_without(model, at, other)
