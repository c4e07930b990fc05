"""Which of the refitted effects is added, with what, and which are alike."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from robustpolish.effects import Effect, kinds
from robustpolish.identification.discover.judge import (
    advantage,
    falls_where_fitted,
    judgement,
    line_of_motion,
    objection,
    tolerance,
)
from robustpolish.identification.discover.search import RefittedEffect, Search
from robustpolish.identification.findings.confused import confused
from robustpolish.identification.fit.parameters import connected
from robustpolish.identification.screening.candidates import rivals
from robustpolish.identification.screening.screen import ScreenedEffect


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
        if not item.constant:
            first.setdefault(item.family, item)
    return list(first.values())


def constants_beside(
    constant: RefittedEffect, ranked: Sequence[RefittedEffect], search: Search
) -> list[Effect]:
    """Return a constant as fitted, and the likeliest one of each other kind.

    Where it is one of the refits, with the values that were fitted.
    """
    refitted = [item.fitted.model.effects[-1] for item in ranked if item.constant]
    likely = [candidate.effect for candidate in _likely_constants(search)]
    found = [constant.fitted.model.effects[-1], *refitted, *likely]
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
    tried += _unbending(near)
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


def _unbending(near: Sequence[RefittedEffect]) -> list[tuple[ScreenedEffect, ScreenedEffect]]:
    """Return pairs of what is absurd by itself with the laws of one number at its place.

    What else is missing there bends it: a friction beside a drag falls with speed, to nothing.
    """
    found = []
    for item in near:
        effect = item.fitted.model.effects[-1]
        if not effect.definition.implausible(effect.values):
            continue
        for kind in kinds().values():
            numbers = [p.name for p in kind.parameters if p.fitted]
            if kind.domain == "pair" and kind.linear_in == tuple(numbers) and len(numbers) == 1:
                law = Effect(kind.kind, effect.at, {numbers[0]: 0.0})
                found.append((item.screened, ScreenedEffect(law, 0.0, 0.0)))
    return found


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
    if refitted:
        return refitted[:1]
    for candidate in _likely_constants(search)[:1]:
        fitted = search.fitted_with(search.stage.model, candidate.effect)
        if fitted is not None:
            refitted.append(RefittedEffect(candidate, fitted))
    return refitted


def _likely_constants(search: Search) -> list[ScreenedEffect]:
    """Return what was screened and never changes, the likeliest first."""
    screened = search.screening.candidates if search.screening is not None else ()
    return sorted((each for each in screened if each.constant), key=lambda each: -each.score)
