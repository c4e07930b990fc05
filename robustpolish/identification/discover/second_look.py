"""A second look at what a search found, where more than noise is left.

The first effect is chosen while the others are still missing, so it may be the one that mimics them
all. What came close at its place in the search is followed in its stead, and what has nothing left
to do beside the others goes.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from robustpolish.identification.discover.judge import judgement, objection
from robustpolish.identification.discover.reconsider import (
    renamed,
    retold,
    still_alike,
    without_the_needless,
)
from robustpolish.identification.discover.search import RefittedEffect, Search, Turn


def second_look(search: Search, grow: Callable[[Search], Search]) -> Search:
    """Return the search, or the one in which a runner-up was followed and left visibly less.

    Parameters
    ----------
    search : Search
        At its end.
    grow : callable
        Goes on with a search until nothing more earns its place.
    """
    search = without_the_needless(search)
    for turn, item in _runners_up(search):
        if _noise_alone(search):
            break
        instead = f" in place of {turn.added[0].effect}" if turn.added else ", to see what follows"
        search.say(f"{item.effect}{instead}")
        other = turn.before.copy()
        other.accept([item])
        other = without_the_needless(grow(other), last=not turn.added)
        least = _worth(search, other) + np.log(1 - search.policy.together)
        if _worth(other, search) < least and _sound(other):
            search = other
    return retold(still_alike(renamed(search)))


def _runners_up(search: Search) -> list[tuple[Turn, RefittedEffect]]:
    """Return what is followed: what came closest when the search ended, and at the first turns.

    Of a family at one place the simplest kind stands for all but the one that was added.
    """
    found = []
    ended = [turn for turn in search.turns if not turn.added]
    turns = [*ended, *(turn for turn in search.turns if turn.added)]
    most = [*[search.policy.followed[0]] * len(ended), *search.policy.followed]
    for turn, count in zip(turns, most, strict=False):
        seen: dict[tuple[object, ...], RefittedEffect] = {}
        for item in sorted(turn.others, key=lambda item: item.size):
            kind = item.effect.definition
            seen.setdefault((kind.family or kind.kind, item.effect.at), item)
        different = [item for item in turn.others if item in seen.values()]
        found += [(turn, item) for item in different[:count]]
    return found


def _noise_alone(search: Search) -> bool:
    """Return whether the model leaves noise alone: white noise, or the coloured one it shows."""
    stage = search.stage
    if search.at_floor(stage):
        return True
    floor = search.floor_beside(stage.model, stage.reproducible)
    return bool(np.all(stage.error < search.policy.at_floor * floor))


def _sound(search: Search) -> bool:
    """Return whether the data determine every effect, and none is absurd, beside the others."""
    effects = search.stage.model.effects
    return not any(
        objection(search.linear, search.stage, search.prepared, place)
        for place in range(len(search.reference.effects), len(effects))
    )


def _worth(search: Search, other: Search) -> float:
    """Return what counts: the held-out error, and what each effect has to make it fall."""
    error = judgement(search.stage, [other.stage])
    return error - search.added * float(np.log(1 - search.policy.together))
