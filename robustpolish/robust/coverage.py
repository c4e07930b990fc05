"""An upper bound of the structured singular value that holds between all frequencies."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robustpolish.arrays import AnyMatrix, Vector
from robustpolish.deadline import look_at_the_clock
from robustpolish.exact.realisation import Realisation
from robustpolish.robust.loop_model import LoopModel
from robustpolish.robust.proof import ProvenModel, Weights
from robustpolish.robust.scaled.centre import Level, at, lowered, started
from robustpolish.robust.scaled.scalings import Inequality, Space


@dataclass(frozen=True)
class CoveragePolicy:
    """How intervals are laid.

    Attributes
    ----------
    slack : float
        What the level is above the largest one that was needed anywhere, relative: the room that
        constant scalings have around the worst frequency. With half of the 0.2 % that a
        bracket may be wide, the other half is left for the lower bound.
    most : int
        Intervals before the bound is given up.
    narrow : float
        Width, relative to its frequency, of an interval that gets nowhere: the level is raised.
    raised : float
        By how much, relative.
    """

    slack: float = 1e-3
    most: int = 600
    narrow: float = 1e-7
    raised: float = 1e-3


POLICY = CoveragePolicy()


@dataclass(frozen=True, eq=False)
class Coverage:
    """A level that is proven over intervals of frequency.

    Attributes
    ----------
    level : float
        beta: no Delta with all sizes below 1 / beta makes the loop singular on the intervals.
    intervals : tuple of (float, float)
        In the units of the model, ascending.
    complete : bool
        Whether they cover the axis from 0 to infinity.
    peaks : tuple of (float, float, Level)
        Frequencies at which a level was needed, the level, and its scalings; the largest first.
    """

    level: float
    intervals: tuple[tuple[float, float], ...]
    complete: bool
    peaks: tuple[tuple[float, float, Level], ...]


def response(model: Realisation, omega: float) -> AnyMatrix:
    """Return M at a frequency, infinity included, in double precision.

    Raises
    ------
    numpy.linalg.LinAlgError
        If rounding sees a pole there.
    """
    D = model.D.astype(complex)
    if not model.states or not math.isfinite(omega):
        return D
    return D + model.C @ np.linalg.solve(1j * omega * np.eye(model.states) - model.A, model.B + 0j)


class _Cover:
    """The state of one coverage: the level so far, and what it was needed for."""

    def __init__(self, loop: LoopModel, space: Space, level: float, slack: float):
        self.model, self.space, self.slack = loop.model, space, slack
        self.level = level * (1 + slack)
        self.proven = ProvenModel(loop.balls)
        self.peaks: list[tuple[float, float, Level]] = []
        self.last: list[Vector] = []

    def scalings(self, omega: float) -> Level | None:
        """Return scalings that prove the level at a frequency, or raise the level.

        None where there are none, or where rounding sees a pole at the frequency.
        """
        try:
            gain = response(self.model, omega)
        except np.linalg.LinAlgError:
            return None
        inequality = Inequality(self.space, gain[None])
        starts = [started(inequality), *(at(inequality, Level(0.0, x)) for x in self.last)]
        start = min(starts, key=lambda level: level.square)
        if not math.isfinite(start.square):
            return None
        found = lowered(inequality, start, self.level**2)
        needed = math.sqrt(max(found.square, 0.0))
        if not needed < self.level:
            self.peaks.append((omega, needed, found))
            self.level = needed * (1 + self.slack)
            found = lowered(inequality, found, self.level**2)
        self.last = [found.x, *self.last][:2]
        return found


def cover(
    loop: LoopModel,
    space: Space,
    level: float,
    seeds: Sequence[float],
    slack: float = POLICY.slack,
    most: int = POLICY.most,
) -> Coverage:
    """Lay intervals with constant scalings until they cover the axis.

    Parameters
    ----------
    loop : LoopModel
        Stable.
    space : Space
        What scalings there are.
    level : float
        A lower bound of the peak, or where else to begin; it is raised where it has to be.
    seeds : sequence of float
        Frequencies to look at first.
    slack : float, optional
        Of :class:`CoveragePolicy`: more of it makes longer intervals.
    most : int, optional
        Of the same.

    Returns
    -------
    Coverage
    """
    state = _Cover(loop, space, level, slack)
    for omega in dict.fromkeys([0.0, math.inf, *seeds]):
        if state.scalings(omega) is None:
            return Coverage(math.inf, (), False, tuple(state.peaks))
    gaps, intervals, complete = [(0.0, math.inf)], [], True
    rate = loop.rate
    for _ in range(most):
        if not gaps:
            break
        look_at_the_clock()
        low, high = gaps.pop()
        omega = _inside(low, high, rate)
        found = state.scalings(omega)
        interval = None
        if found is not None:
            weights = Weights.of(space, found.x, state.level)
            interval = weights and state.proven.interval(weights, omega)
        if interval is None or interval[1] <= interval[0] * (1 + POLICY.narrow):
            if found is None or not math.isfinite(state.level):
                return Coverage(math.inf, (), False, tuple(state.peaks))
            state.level *= 1 + POLICY.raised
            gaps.append((low, high))
            continue
        intervals.append(interval)
        if interval[0] > low:
            gaps.append((low, interval[0]))
        if interval[1] < high:
            gaps.append((interval[1], high))
    complete = not gaps
    peaks = sorted(state.peaks, key=lambda peak: -peak[1])
    return Coverage(state.level, tuple(sorted(intervals)), complete, tuple(peaks))


def _inside(low: float, high: float, rate: float) -> float:
    """Return a frequency of a gap: an end of the axis first, else the middle of logarithms."""
    if low == 0 and high == math.inf:
        return rate
    if high == math.inf:
        return math.inf
    if low == 0:
        return 0.0
    return math.sqrt(low) * math.sqrt(high)
