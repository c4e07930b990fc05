"""A second look at what a search found, where more than noise is left.

The first effect is chosen while the others are still missing, so it may be the one that mimics them
all. What came close at its place in the search is followed in its stead, and what has nothing left
to do beside the others goes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from robustpolish.identification.discover.judge import judgement
from robustpolish.identification.discover.search import RefittedEffect, Search, Turn
from robustpolish.identification.fit.homotopy import JudgedFit


def second_look(search: Search, grow: Callable[[Search], Search]) -> Search:
    """Return the search, or the one in which a runner-up was followed and left visibly less.

    Parameters
    ----------
    search : Search
        At its end.
    grow : callable
        Goes on with a search until nothing more earns its place.
    """
    if search.added and not search.at_floor(search.stage):
        for turn, item in _runners_up(search):
            search.say(f"{item.effect} in place of {turn.added[0].effect}")
            other = turn.before.copy()
            other.accept([item])
            other = grow(other)
            if _worth(other, search) < _worth(search, other) + np.log(1 - search.policy.together):
                search = other
            if search.at_floor(search.stage):
                break
    return _without_the_needless(search)


def _runners_up(search: Search) -> list[tuple[Turn, RefittedEffect]]:
    """Return what is followed instead: what came closest at the first turns.

    Of a family at one place the simplest kind stands for all but the one that was added.
    """
    found = []
    for turn, most in zip(search.turns, search.policy.followed, strict=False):
        seen: dict[tuple[object, ...], RefittedEffect] = {}
        for item in sorted(turn.others, key=lambda item: item.size):
            kind = item.effect.definition
            seen.setdefault((kind.family or kind.kind, item.effect.at), item)
        different = [item for item in turn.others if item in seen.values()]
        found += [(turn, item) for item in different[:most]]
    return found


def _worth(search: Search, other: Search) -> float:
    """Return what counts: the held-out error, and what each effect has to make it fall."""
    error = judgement(search.stage, [other.stage])
    return error - search.added * float(np.log(1 - search.policy.visible_fall))


def _without_the_needless(search: Search) -> Search:
    """Return the search without effects that do not earn their place beside those after them."""
    first = len(search.reference.effects)
    for at in reversed(range(first, len(search.stage.model.effects) - 1)):
        effects = search.stage.model.effects
        rest = replace(search.stage.model, effects=(*effects[:at], *effects[at + 1 :]))
        without = search.fitted_with(rest)
        if without is not None and _as_good(without, search):
            search.stage = without
            del search.steps[2 + at - first]
            search.steps[-1] = (search.steps[-1][0], without.model)
            search.reasons.append(f"{effects[at]} was not kept: the others explain as much.")
    return search


def _as_good(without: JudgedFit, search: Search) -> bool:
    """Return whether a model leaves no output visibly more than that of the search."""
    stage, few = search.stage, 1 - search.policy.visible_fall
    if stage.reproducible and without.reproducible:
        return bool(np.all(stage.free > few * without.free))
    return bool(np.all(stage.short > few * without.short))
