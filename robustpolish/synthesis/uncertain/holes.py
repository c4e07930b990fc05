"""Where a level rises between the frequencies of a set: holes that a descent has found."""

from __future__ import annotations

import math

import numpy as np

from robustpolish.arrays import Array, Vector
from robustpolish.robust.scaled.centre import Level, lowered, started
from robustpolish.robust.scaled.scalings import Inequality, Space
from robustpolish.synthesis.problem.static_loop import StaticLoop
from robustpolish.synthesis.uncertain.responses import LoopResponses
from robustpolish.synthesis.uncertain.scaled_gain import ScaledGain, Scalings

# Frequencies that are looked at between two of the set, and beyond its ends in decades.
_BETWEEN = 12
_BEYOND = 3.0
# Share of its rate by which a lightly damped pole is looked at on both sides.
_BESIDE = np.array([-2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0])
# Peaks that are looked at closely in one go.
_MOST = 12


def holes(
    loop: StaticLoop, scalings: Scalings, omega: Vector, weights: Array, level: float
) -> tuple[Vector, Array]:
    """Return frequencies at which no scalings prove a level, with the best scalings there.

    Parameters
    ----------
    loop : StaticLoop
        Stable.
    scalings : Scalings
    omega : ndarray, shape (k,)
        The set.
    weights : ndarray, shape (k, scalings.size)
        Scalings of the set; between its frequencies they are interpolated.
    level : float
    """
    dense, between = _dense(loop, omega, weights)
    M = LoopResponses.of(loop, dense).M
    squares = np.linalg.eigvalsh(ScaledGain(scalings, between, M).H)[:, -1]
    found_omega, found_weights = [], []
    space = Space(scalings.structure, (False,) * len(scalings.structure.blocks))
    high = squares > level**2
    peaks = [i for i in np.flatnonzero(high).tolist() if _is_top(squares, i)]
    peaks.sort(key=lambda i: -squares[i])
    for i in peaks[:_MOST]:
        inequality = Inequality(space, M[i][None])
        start = started(inequality)
        if not math.isfinite(start.square):
            continue
        best: Level = lowered(inequality, start, level**2)
        if best.square > level**2 * (1 - 1e-9):
            found_omega.append(dense[i])
            found_weights.append(scalings.of_weights(best.x, space, 1.0))
    shape = len(found_omega), scalings.size
    return np.array(found_omega), np.array(found_weights).reshape(shape)


def _is_top(squares: Vector, i: int) -> bool:
    before = squares[i - 1] if i else -np.inf
    after = squares[i + 1] if i + 1 < len(squares) else -np.inf
    return bool(squares[i] >= before and squares[i] > after)


def _dense(loop: StaticLoop, omega: Vector, weights: Array) -> tuple[Vector, Array]:
    """Return frequencies between those of a set and beside the poles, and scalings there."""
    order = np.argsort(omega)
    inner = order[(omega[order] > 0) & np.isfinite(omega[order])]
    logs, values = np.log(omega[inner]), weights[inner]
    steps = np.linspace(0, 1, _BETWEEN + 1, endpoint=False)[1:]
    found = [logs[:-1] + step * np.diff(logs) for step in steps]
    ends = np.linspace(0, _BEYOND * np.log(10), 3 * _BETWEEN)[1:]
    poles = loop.poles[loop.poles.imag > 0]
    beside = poles.imag[:, None] + poles.real[:, None] * _BESIDE
    beside = np.log(beside[beside > 0])
    all_logs = np.sort(np.concatenate([*found, logs[0] - ends, logs[-1] + ends, beside]))
    between = np.array([np.interp(all_logs, logs, column) for column in values.T]).T
    return np.exp(all_logs), between.reshape(len(all_logs), -1)
