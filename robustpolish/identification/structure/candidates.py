"""Why a candidate that was screened was not refitted, in the words of the table of candidates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from robustpolish.identification.fit.least_squares import Fit
from robustpolish.identification.fit.prepared import PreparedRecord
from robustpolish.identification.observer.missing_force import SmoothedMotion
from robustpolish.identification.structure.evidence import Evidence, evidence
from robustpolish.identification.structure.score import motion_line_reason, rejection_reason
from robustpolish.identification.structure.screening import (
    ScreenedEffect,
    Screening,
    candidate_columns,
    mutually_exclusive,
    places,
)
from robustpolish.identification.structure.state import RefittedEffect, Search
from robustpolish.machines.effects.effect import Effect, kinds
from robustpolish.machines.effects.kind import EffectKind
from robustpolish.machines.mechanical.data import port_rows

# Candidate selection for refits: by the odds of the innovations, and by the gain in free runs.


class RefitCandidates(NamedTuple):
    """What is to be refitted.

    Attributes
    ----------
    first, further : list of ScreenedEffect
        Single effects, the likeliest first; the further ones if none of the first earns its place.
    pairs : list of tuple of ScreenedEffect
        Two effects that would help together far more than alone.
    seen : list of ScreenedEffect
        All single effects that the look at free runs could judge, the largest first.
    """

    first: list[ScreenedEffect]
    further: list[ScreenedEffect]
    pairs: list[tuple[ScreenedEffect, ...]]
    seen: list[ScreenedEffect]

    def candidates_elsewhere(self, effect: Effect, near: float) -> list[ScreenedEffect]:
        """Return an effect at other places where it would leave at most `near` times as much."""
        alike = [c for c in self.seen if c.effect.kind == effect.kind]
        here = next((c for c in alike if c.effect.at == effect.at), None)
        if here is None:
            return []
        return [c for c in alike if c is not here and 1 - c.fall < near * (1 - here.fall)]

    def without(self, excluded_effects: Sequence[tuple[str, tuple[str, ...]]]) -> RefitCandidates:
        """Return what is left when some kinds at some places are not to be refitted."""

        def left(found: Sequence[ScreenedEffect]) -> list[ScreenedEffect]:
            return [c for c in found if c.place not in excluded_effects]

        pairs = [pair for pair in self.pairs if len(left(pair)) == len(pair)]
        return RefitCandidates(left(self.first), left(self.further), pairs, left(self.seen))


def select_candidates(
    screening: Screening, stage: Fit, prepared: PreparedRecord
) -> RefitCandidates:
    """Choose among all candidates.

    Parameters
    ----------
    screening : Screening
    stage : Fit
        The model as it is, for the look at free runs.
    prepared : PreparedRecord
    """
    policy = prepared.policy
    twice = _redundant_delays(screening)
    likeliest = [
        c
        for c in screening.candidates
        if c.sensible and c.score > policy.least_odds and c.place not in twice
    ]
    finalists = [c for c in screening.finalists if (c.kind.kind, c.at) not in twice]
    good = [c for c in likeliest if not _has_spectral_line(c.effect, stage, prepared)]
    first: list[ScreenedEffect] = []
    pairs: list[tuple[ScreenedEffect, ...]] = []
    seen: list[ScreenedEffect] = []
    for span in _screening_windows(prepared):
        singles, couples = (
            [
                e
                for e in found
                if not any(_has_spectral_line(effect, stage, prepared) for effect in e.effects)
            ]
            for found in evidence(stage, prepared, finalists, span)
        )
        _add_single_candidates(first, singles, screening, prepared)
        pairs += _candidate_pairs(singles, couples, screening, prepared)
        seen += [_screened_from_evidence(found, 0, screening) for found in singles]
    taken = {c.place for c in first}
    likely = [c for c in good if c.score > policy.near_best * good[0].score]
    # a fit tells how far its frequency is from the lines that the motion has by itself, and in a
    # decay whether it takes the error away by far
    outside = [c for c in likeliest if c not in good][:1]
    first += [
        c for c in _most_likely_candidates(likely, policy.most_likely) if c.place not in taken
    ]
    taken = {c.place for c in first}
    further = [c for c in good if c.place not in taken][: policy.most_further] + outside
    unique = {tuple(sorted(c.place for c in pair)): pair for pair in reversed(pairs)}
    largest = {c.place: c for c in sorted(seen, key=lambda c: c.fall)}
    by_size = sorted(largest.values(), key=lambda c: -c.fall)
    return RefitCandidates(first, further, list(unique.values())[: policy.most_pairs], by_size)


def _redundant_delays(screening: Screening) -> set[tuple[str, tuple[str, ...]]]:
    """Return what makes an input late and is less likely than another that does.

    A delay explains most of a lag and a lag most of a delay: two of the few refits for one finding.
    """
    first = {c.effect.at: c for c in sorted(screening.late, key=lambda c: c.score)}
    return {c.place for c in screening.late if c is not first[c.effect.at]}


def _most_likely_candidates(likely: Sequence[ScreenedEffect], most: int) -> list[ScreenedEffect]:
    """Return the first few, and the first of another kind where these are all of one kind.

    Of two gains or constants at different places one explains as much as the other.
    """
    first = list(likely[:most])
    same = {c.effect.kind for c in first}
    other = next((c for c in likely if c.effect.kind not in same), None)
    return [*first, other] if len(same) == 1 and other is not None else first


def _has_spectral_line(effect: Effect, stage: Fit, prepared: PreparedRecord) -> bool:
    return bool(motion_line_reason(effect, stage.model, prepared.record))


def _screening_windows(prepared: PreparedRecord) -> list[int]:
    """Return the windows to look through: some swings, and as long as the shortest piece."""
    spans = prepared.spans(prepared.trial, prepared.policy.growth)
    return spans[1:-1] or spans[-1:]


def _add_single_candidates(
    first: list[ScreenedEffect],
    singles: Sequence[Evidence],
    screening: Screening,
    prepared: PreparedRecord,
) -> None:
    policy = prepared.policy
    taken = {c.place for c in first}
    left = policy.near_error * (1 - max((found.fall for found in singles), default=0.0))
    large = [e for e in singles if e.fall > policy.visible_fall / 2 and 1 - e.fall < left]
    for found in large[: policy.most_large]:
        if found.places[0] not in taken:
            first.append(_screened_from_evidence(found, 0, screening))
            taken.add(found.places[0])


def _candidate_pairs(
    singles: Sequence[Evidence],
    couples: Sequence[Evidence],
    screening: Screening,
    prepared: PreparedRecord,
) -> list[tuple[ScreenedEffect, ...]]:
    """Return the pairs that take away visibly more than each of the two does alone."""
    policy = prepared.policy
    alone = {found.places[0]: found.fall for found in singles}
    found = []
    for couple in couples:
        best = max(alone.get(place, 0.0) for place in couple.places)
        if 1 - couple.fall < (1 - policy.visible_fall) * (1 - best):
            found.append(tuple(_screened_from_evidence(couple, i, screening) for i in range(2)))
        if len(found) == policy.most_pairs:
            break
    return found


def _screened_from_evidence(found: Evidence, i: int, screening: Screening) -> ScreenedEffect:
    effect = found.effects[i]
    return ScreenedEffect(effect, screening.score(effect), found.fall)


def family_alternatives(
    effect: Effect, stage: Fit, prepared: PreparedRecord, screening: Screening
) -> list[ScreenedEffect]:
    """Return the other kinds of an effect's family at its place, with the values that suit best.

    Parameters
    ----------
    effect : Effect
    stage : Fit
        The model without it.
    prepared : PreparedRecord
    screening : Screening
    """
    kind = effect.definition
    others = [k for k in kinds().values() if k.kind != kind.kind and mutually_exclusive(k, kind)]
    motion = prepared.motion(stage.model, prepared.screened)
    return _screen_family(others, effect.at, motion, stage, prepared, screening)


def stick_slip_candidates(
    stage: Fit, prepared: PreparedRecord, screening: Screening
) -> list[ScreenedEffect]:
    """Return the dry frictions at the place that stands still for longest, with suitable values.

    Parameters
    ----------
    stage : Fit
        The model without any.
    prepared : PreparedRecord
    screening : Screening

    Returns
    -------
    list of ScreenedEffect
        None where all places move nearly all of the time. A harmonic motion is as slow as asked
        for in 5 % of its time, and noise in 8 %.
    """
    slow, least = prepared.policy.standstill
    motion = prepared.motion(stage.model, prepared.screened)
    dry = [kind for kind in kinds().values() if kind.turns_over]

    def standstill(at: tuple[str, ...]) -> float:
        (speed,) = np.abs(port_rows(stage.model, Effect(dry[0].kind, at)) @ motion.v)
        return float(np.mean(speed < slow * np.sqrt(np.mean(speed**2))))

    shares = {at: standstill(at) for at in places(stage.model, dry[0])}
    stillest = max(shares, key=lambda at: shares[at], default=None)
    if stillest is None or shares[stillest] < least:
        return []
    return _screen_family(dry, stillest, motion, stage, prepared, screening)


def _screen_family(
    tried: Sequence[EffectKind],
    at: tuple[str, ...],
    motion: SmoothedMotion,
    stage: Fit,
    prepared: PreparedRecord,
    screening: Screening,
) -> list[ScreenedEffect]:
    """Return kinds of one family at a place, with the values that suit free runs best."""
    model, record = stage.model, prepared.screened
    entries = [c for kind in tried for c in candidate_columns(model, kind, at, motion, record)]
    # among its like a kind needs no evidence of each of its parts: they show once it is refitted
    found = [
        e
        for span in _screening_windows(prepared)
        for e in evidence(stage, prepared, entries, span, True)[0]
    ]
    best = {e.places[0]: e for e in sorted(found, key=lambda e: e.fall)}
    return [_screened_from_evidence(e, 0, screening) for e in best.values()]


Place = tuple[str, tuple[str, ...]]


def reasons_not_refitted(
    screened: Sequence[ScreenedEffect],
    found: RefitCandidates,
    refits: Sequence[RefittedEffect],
    search: Search,
) -> Mapping[Place, str]:
    """Say why each candidate that was only screened was not refitted.

    Parameters
    ----------
    screened : sequence of ScreenedEffect
        All candidates of one round.
    found : RefitCandidates
        Those that were to be refitted.
    refits : sequence of RefittedEffect
        Those that were.
    search : Search
        As it was when the round began.

    Returns
    -------
    mapping of (str, tuple of str) to str
        By kind and place; nothing of those that were refitted.
    """
    done = {item.screened.place for item in refits}
    good = [c for c in screened if c.sensible and c.score > search.policy.least_odds]
    good = [c for c in good if not _line_remark(c, search)]
    winner = next(
        (r for r in refits if not rejection_reason(search.stage, r.fitted, search.prepared)), None
    )
    floor = next((r for r in refits if search.at_noise_floor(r.fitted)), None)
    planned = [*found.first, *found.further]
    return {
        c.place: "screened only: "
        + _reason_not_refitted(c, good, planned, winner, floor, refits, search)
        for c in screened
        if c.place not in done and c.sensible
    }


def _reason_not_refitted(
    candidate: ScreenedEffect,
    good: Sequence[ScreenedEffect],
    planned: Sequence[ScreenedEffect],
    winner: RefittedEffect | None,
    floor: RefittedEffect | None,
    refits: Sequence[RefittedEffect],
    search: Search,
) -> str:
    """Say what stood in the way of one candidate, and which of its family was refitted there."""
    policy, odds = search.policy, candidate.score
    line = _line_remark(candidate, search)
    if line:
        return line
    if odds <= policy.least_odds:
        return f"log odds of {odds:.3g}, and a refit begins above {policy.least_odds:.3g}"
    best = good[0]
    if candidate.place not in {c.place for c in planned}:
        if odds <= policy.near_best * best.score:
            why = (
                f"log odds of {odds:.3g}, less than {policy.near_best:.3g} of the {best.score:.4g} "
                f"of {best.effect}"
            )
        else:
            rank = 1 + sum(c.score > odds for c in good)
            why = f"{rank - 1} others had better odds, and the round was over before its turn"
    elif floor is not None and odds < policy.near_score * planned[0].score:
        why = (
            f"{floor.effect} had left nothing but noise, and log odds of {odds:.3g} are less than "
            f"{policy.near_score:.3g} of the {planned[0].score:.4g} of {planned[0].effect}"
        )
    elif winner is not None:
        why = f"{winner.effect} had earned its place before its turn came"
    else:
        why = "no fit with it ended"
    kind = candidate.effect.definition
    kin = [
        r.effect
        for r in refits
        if r.effect.at == candidate.effect.at and mutually_exclusive(r.effect.definition, kind)
    ]
    return f"{why}; {kin[0]} of its family was refitted there" if kin else why


def _line_remark(candidate: ScreenedEffect, search: Search) -> str | None:
    return motion_line_reason(candidate.effect, search.stage.model, search.prepared.record)
