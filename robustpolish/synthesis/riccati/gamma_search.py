"""The smallest gamma for which both Riccati equations can be solved."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from robustpolish.synthesis.riccati.two_riccati import (
    Attempt,
    NormalisedPlant,
    attempt,
    lowest_gamma,
)

_GROWTH = 8.0
_MOST_STEPS = 60
_LEAST = 1e-12
_DROP = 1e-2


class GammaBracket(NamedTuple):
    """A feasible gamma and one below which nothing was feasible."""

    upper: float
    lower: float
    solution: Attempt
    attempts: int


def search_gamma(
    normal: NormalisedPlant,
    start: float,
    tolerance: float,
    expired: Callable[[], bool],
    shortcut: float = 0.0,
    known: GammaBracket | None = None,
) -> GammaBracket | None:
    """Narrow the optimal gamma down to a relative `tolerance`.

    rho(XY)^(1/2) falls as gamma rises and equals gamma at the optimum, unless X or Y ceases
    to exist before. Hence it is a lower bound at every feasible gamma, and its secant
    makes bisection rare.

    Parameters
    ----------
    normal : NormalisedPlant
    start : float
        A gamma that is expected to be feasible; raised until it is.
    tolerance : float
        Relative width at which to stop.
    expired : callable
        Tells whether time has run out; the bracket so far is returned then.
    shortcut : float
        If a gamma lower than `start` by this share is infeasible, stop there.
    known : GammaBracket, optional
        The result of a coarser search, to go on from.

    Returns
    -------
    GammaBracket or None
        None if no feasible gamma was found.
    """
    bracket = known or _first_feasible(normal, start, expired)
    if bracket is None:
        return None
    upper, lower, best, count = bracket
    if shortcut and lower < upper * (1 - shortcut) and not expired():
        found = attempt(normal, upper * (1 - shortcut))
        count += 1
        if not found.feasible:
            return GammaBracket(upper, max(lower, upper * (1 - shortcut)), best, count)
        upper, best = upper * (1 - shortcut), found
        lower = max(lower, best.coupling or 0.0)
    points = [(upper, (best.coupling or 0.0) - upper)]
    halve = True
    while upper > lower * (1 + tolerance) and count < _MOST_STEPS and not expired():
        width = _width(lower, upper)
        guess = None if halve else _secant(points, lower, upper, tolerance)
        trial = _middle(lower, upper) if guess is None else guess
        found = attempt(normal, trial)
        count += 1
        if found.feasible:
            upper, best = trial, found
            lower = max(lower, found.coupling or 0.0)
        else:
            lower = max(lower, trial)
        if found.coupling is not None:
            points.append((trial, found.coupling - trial))
        halve = _width(lower, upper) > 0.5 * width
    return GammaBracket(upper, lower, best, count)


def _first_feasible(
    normal: NormalisedPlant, start: float, expired: Callable[[], bool]
) -> GammaBracket | None:
    """Raise gamma until both equations can be solved."""
    floor = lowest_gamma(normal)
    lower, upper = floor, max(start, floor * (1 + 1e-6))
    for count in range(1, _MOST_STEPS):
        found = attempt(normal, upper)
        if found.feasible:
            return GammaBracket(upper, max(lower, found.coupling or 0.0), found, count)
        if expired():
            return None
        lower = upper
        # Above the optimum the coupling is smaller, so that it is an upper bound here.
        upper *= _GROWTH if found.coupling is None else min(_GROWTH, found.coupling / upper * 1.05)
        if not np.isfinite(upper):
            return None
    return None


def _width(lower: float, upper: float) -> float:
    return float(np.log(upper / max(lower, upper * _LEAST)))


def _middle(lower: float, upper: float) -> float:
    """Halve the bracket on the logarithmic scale, or drop far if nothing is known below."""
    return upper * max(np.sqrt(lower / upper), _DROP)


def _secant(
    points: list[tuple[float, float]], lower: float, upper: float, tolerance: float
) -> float | None:
    """Propose the zero of coupling - gamma, moved towards the unknown side by a little."""
    if len(points) < 2:
        return None
    (a, fa), (b, fb) = points[-2:]
    if fa == fb:
        return None
    root = b - fb * (b - a) / (fb - fa)
    inside = min(max(root * (1 + tolerance / 3), lower * (1 + tolerance / 3)), upper)
    return inside if lower < inside < upper * (1 - tolerance / 10) else None
