"""A second look at what a search found, where more than noise is left.

The first effect is chosen while the others are still missing, so it may be the one that mimics them
all. What came close at its place in the search is followed in its stead, and what has nothing left
to do beside the others goes. In the end each effect is taken out to see what the others ask for in
its stead: beside them the screening sees what it could not see before.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from robustpolish.identification.fit.least_squares import EvaluatedFit
from robustpolish.identification.structure.decays import extrapolation_error, split_decays
from robustpolish.identification.structure.moves_replace import (
    backward_elimination,
    prune_indistinguishable,
    rebuild_steps,
    replace_kinds,
)
from robustpolish.identification.structure.score import ranking_error, rejection_reason
from robustpolish.identification.structure.state import RefittedEffect, Search, SelectionStep

_SAME_ERRORS = 1e-6
"""Relative difference of all errors below which two fits are one motion, by rounding."""


@dataclass
class VisitedSearches:
    """Searches as they were when they went on.

    Another one that comes to the motion of one of them, as with an effect more that does nothing,
    has nothing to find that has not been found.
    """

    searches: list[Search] = field(default_factory=list)

    def already_visited(self, search: Search) -> bool:
        """Return whether another search went on from this motion; from now on one does."""
        for each in self.searches:
            if each.excluded_effects == search.excluded_effects and _same_errors(
                each.stage, search.stage
            ):
                return True
        self.searches.append(search.copy())
        return False


def _same_errors(one: EvaluatedFit, other: EvaluatedFit) -> bool:
    pairs = (one.error, other.error), (one.fit.rmse, other.fit.rmse)
    return one.reproducible == other.reproducible and all(
        np.isfinite(a).all() and np.allclose(a, b, rtol=_SAME_ERRORS, atol=0.0) for a, b in pairs
    )


def backtrack(search: Search, grow: Callable[[Search, VisitedSearches], Search]) -> Search:
    """Return the search, or the one in which a runner-up was followed and left visibly less.

    Parameters
    ----------
    search : Search
        At its end.
    grow : callable
        Goes on with a search until nothing more earns its place, or another one came there before.
    """
    first = search.stage
    followed = VisitedSearches([turn.before for turn in search.selection_steps])
    search = backward_elimination(search)
    for turn, item in _runners_up(search):
        if (
            search.residual_is_noise(search.policy.at_noise_floor)
            or not search.prepared.work.left()
        ):
            break
        instead = f" in place of {turn.added[0].effect}" if turn.added else ", to see what follows"
        search.say(f"{item.effect}{instead}")
        other = turn.before.copy()
        other.accept([item])
        search = _better_search(
            search, backward_elimination(grow(other, followed), last=not turn.added)
        )
    search = prune_indistinguishable(replace_kinds(_leave_one_out(search, grow, followed)))
    return search if search.stage is first else rebuild_steps(search)


def _leave_one_out(
    search: Search, grow: Callable[[Search, VisitedSearches], Search], followed: VisitedSearches
) -> Search:
    """Return the search, or the one in which others came in place of an effect that was found.

    Where there is but one, what came close in its place has been followed already.
    """
    places = [(e.kind, e.at) for e in search.added_to(search.stage.model)]
    for place in places:
        there = [(e.kind, e.at) for e in search.stage.model.effects]
        if (
            place not in there
            or len(places) < 2
            or search.residual_is_noise(search.policy.shape_above)
        ):
            continue
        if not search.prepared.work.left():
            break
        without = search.fit_without(search.stage.model, there.index(place))
        if without is None:
            continue
        search.say(f"what comes without {search.stage.model.effects[there.index(place)]}")
        other = replace(search.copy(), stage=without, excluded_effects=(place,))
        search = _better_search(
            search, replace(backward_elimination(grow(other, followed)), excluded_effects=())
        )
    return search


def _better_search(search: Search, other: Search) -> Search:
    """Return the other search if it left visibly less, each effect counted, and is sound.

    Where all records are decays, it has to predict their ends as well as the search does.
    """
    least = _penalised_error(search, other) + np.log(1 - search.policy.together)
    if not (_penalised_error(other, search) < least and _all_determined(other)):
        return search
    return search if _extrapolates_worse(search, other) else other


def _extrapolates_worse(search: Search, other: Search) -> bool:
    """Return whether the other search predicts visibly worse how decays go on."""
    prepared, reference = search.prepared, search.reference
    cut = split_decays(reference, prepared.record)
    if cut is None or not (search.stage.reproducible and other.stage.reproducible):
        return False
    here, there = (
        extrapolation_error(each.stage.model, prepared, reference, cut) for each in (search, other)
    )
    return there > here - np.log(1 - search.policy.visible_fall)


def _runners_up(search: Search) -> list[tuple[SelectionStep, RefittedEffect]]:
    """Return what is followed: what came closest when the search ended, and at the first turns.

    Of a family at one place the simplest kind stands for all but the one that was added.
    """
    found = []
    ended = [turn for turn in search.selection_steps if not turn.added]
    selection_steps = [*ended, *(turn for turn in search.selection_steps if turn.added)]
    most = [*[search.policy.followed[0]] * len(ended), *search.policy.followed]
    for turn, count in zip(selection_steps, most, strict=False):
        seen: dict[tuple[str, tuple[str, ...]], RefittedEffect] = {}
        for item in sorted(turn.others, key=lambda item: item.size):
            seen.setdefault(item.family, item)
        different = [item for item in turn.others if item in seen.values()]
        found += [(turn, item) for item in different[:count]]
    return found


def _all_determined(search: Search) -> bool:
    """Return whether the data determine every effect, and none is absurd, beside the others."""
    effects = search.stage.model.effects
    return not any(
        rejection_reason(search.linear, search.stage, search.prepared, place)
        for place in range(len(search.reference.effects), len(effects))
    )


def _penalised_error(search: Search, other: Search) -> float:
    """Return what counts: the held-out error, and what each effect has to make it fall."""
    error = ranking_error(search.stage, [other.stage])
    return error - search.added * float(np.log(1 - search.policy.together))
