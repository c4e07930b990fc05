"""A fit whose effects stand in another order: the same numbers, starts and errors."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from robustpolish.identification.fit.least_squares import Fit
from robustpolish.identification.observer.run import Start, StartedPiece

_NUMBER = re.compile(r"effect\[(\d+)\](.*)")


def reordered(fitted: Fit, order: Sequence[int]) -> Fit:
    """Return a fit whose model has its effects in another order; nothing is fitted again.

    Parameters
    ----------
    fitted : Fit
    order : sequence of int
        Where the first effect stands now, the second one, and so on.
    """
    effects = fitted.model.effects
    internal = np.cumsum([0, *(effect.definition.states for effect in effects)])
    states = [np.arange(internal[old], internal[old + 1]) for old in order]
    rows = np.concatenate([*states, np.zeros(0, dtype=int)])

    def renamed(key: str) -> str:
        found = _NUMBER.fullmatch(key)
        return f"effect[{order.index(int(found[1]))}]{found[2]}" if found else key

    def started(piece: StartedPiece) -> StartedPiece:
        start = piece.start
        return StartedPiece(piece.record, Start(start.state, start.internal[rows]))

    return replace(
        fitted,
        model=replace(fitted.model, effects=tuple(effects[old] for old in order)),
        pieces=tuple(started(piece) for piece in fitted.pieces),
        free=[replace(f, key=renamed(f.key), at_least=renamed(f.at_least)) for f in fitted.free],
    )
