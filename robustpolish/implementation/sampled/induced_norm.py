"""The induced L2 norm of a sampled loop from w to z, what happens between samples included.

A gain gamma is tested by joining stretches of the loop: within a period from a first step so short
that nothing can go wrong, then period by period, doubling each time. If no join fails, the
gain of every finite time lies below gamma, and with it the norm of the stable loop.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robustpolish.arrays import Matrix
from robustpolish.implementation.sampled.energy_section import (
    Conflict,
    Section,
    joined,
    phase_section,
)
from robustpolish.implementation.sampled.scaled_map import ScaledMap

_DOUBLINGS = 60
_SETTLED = 1e-12
_NOTHING = 1e-30
"""Below this part of what the matrices suggest a norm counts as zero."""


@dataclass(frozen=True)
class GainTest:
    """Whether the gain of a loop lies below gamma, and what shows it.

    Attributes
    ----------
    gamma : float
    below : bool
    storage : ndarray or None
        If below: s'P s is the largest energy that may still come, of z less gamma^2 times w.
    phase, stage : int
        If not: the phase in which a gain of gamma is reached (number of phases: where phases are
        joined; one more: over periods), and after how many doublings.
    costate : ndarray or None
        If not: the direction in which it is reached.
    """

    gamma: float
    below: bool
    storage: Matrix | None = None
    phase: int = -1
    stage: int = -1
    costate: Matrix | None = None


def period_section(loop: ScaledMap, gamma: float) -> Section | GainTest:
    """Return a period at gamma in the states at the samples, or a test if gamma is reached in it.

    Parameters
    ----------
    loop : ScaledMap
    gamma : float

    Returns
    -------
    Section or GainTest
    """
    flow: Section | None = None
    for i, phase in enumerate(loop.phases):
        found = phase_section(phase, gamma)
        if isinstance(found, Conflict):
            return GainTest(gamma, False, None, i, found.stage, found.costate)
        both = found if flow is None else joined(flow, found)
        if not isinstance(both, Section):
            return GainTest(gamma, False, None, len(loop.phases), 0, both)
        flow = both
    assert flow is not None
    return Section(
        loop.N + loop.M @ flow.A @ loop.L,
        loop.M @ flow.G @ loop.M.T,
        loop.L.T @ flow.Q @ loop.L,
    )


def judge_gain(loop: ScaledMap, gamma: float, margin: float = 0.0) -> GainTest:
    """Test whether the gain of a stable loop lies below gamma.

    Parameters
    ----------
    loop : ScaledMap
    gamma : float
    margin : float, optional
        Energy of s added to that of z in every period, relative to what z has; what is left of it
        makes the inequality of the storage function strict.

    Returns
    -------
    GainTest
    """
    section = period_section(loop, gamma)
    if isinstance(section, GainTest):
        return section
    if margin:
        level = margin * max(float(np.linalg.norm(section.Q, 2)), 1e-300)
        section = section._replace(Q=section.Q + level * np.eye(len(section.Q)))
    for stage in range(_DOUBLINGS):
        twice = joined(section, section)
        if not isinstance(twice, Section):
            return GainTest(gamma, False, None, len(loop.phases) + 1, stage, twice)
        change = np.linalg.norm(twice.Q - section.Q)
        section = twice
        settled = change <= _SETTLED * np.linalg.norm(section.Q)
        if settled and section.size < math.sqrt(_SETTLED):
            return GainTest(gamma, True, section.Q)
    # Neither settled nor refuted: gamma is nearer to the norm than doubles can tell.
    return GainTest(gamma, False)


def bracket(
    loop: ScaledMap, start: float, tolerance: float = 1e-6
) -> tuple[GainTest, GainTest] | None:
    """Enclose the norm of a stable loop between two tests.

    Parameters
    ----------
    loop : ScaledMap
    start : float
        A first guess, positive.
    tolerance : float, optional
        Relative width.

    Returns
    -------
    (GainTest, GainTest) or None
        The last that failed and the last that passed; None if none passed. A norm of zero has a
        first one with gamma = 0.
    """
    low, high = GainTest(0.0, False), judge_gain(loop, start)
    factor = 2.0
    while not high.below:
        low = high
        factor **= 2
        if low.gamma * factor > start * 1e30:
            return None
        high = judge_gain(loop, low.gamma * factor)
    factor = 2.0
    while low.gamma == 0.0:
        factor **= 2
        test = judge_gain(loop, max(high.gamma / factor, start * _NOTHING))
        if not test.below:
            low = test
        elif test.gamma <= start * _NOTHING:
            return low, test
        else:
            high = test
    while high.gamma > low.gamma * (1 + tolerance):
        middle = judge_gain(loop, math.sqrt(low.gamma * high.gamma))
        low, high = (low, middle) if middle.below else (middle, high)
    return low, high
