"""Why a candidate that was screened was not refitted, in the words of the table of candidates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from robustpolish.identification.discover.hopeful import Hopeful
from robustpolish.identification.discover.judge import line_of_motion, objection
from robustpolish.identification.discover.search import RefittedEffect, Search
from robustpolish.identification.screening.candidates import rivals
from robustpolish.identification.screening.screen import ScreenedEffect

Place = tuple[str, tuple[str, ...]]


def passed_over(
    screened: Sequence[ScreenedEffect],
    found: Hopeful,
    refits: Sequence[RefittedEffect],
    search: Search,
) -> Mapping[Place, str]:
    """Say why each candidate that was only screened was not refitted.

    Parameters
    ----------
    screened : sequence of ScreenedEffect
        All candidates of one round.
    found : Hopeful
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
    good = [c for c in good if not _line(c, search)]
    winner = next(
        (r for r in refits if not objection(search.stage, r.fitted, search.prepared)), None
    )
    floor = next((r for r in refits if search.at_floor(r.fitted)), None)
    planned = [*found.first, *found.further]
    return {
        c.place: "screened only: " + _why(c, good, planned, winner, floor, refits, search)
        for c in screened
        if c.place not in done and c.sensible
    }


def _why(
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
    line = _line(candidate, search)
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
        if r.effect.at == candidate.effect.at and rivals(r.effect.definition, kind)
    ]
    return f"{why}; {kin[0]} of its family was refitted there" if kin else why


def _line(candidate: ScreenedEffect, search: Search) -> str | None:
    return line_of_motion(candidate.effect, search.stage.model, search.prepared.record)
