"""The infimum of the H-infinity norm: the smallest gamma for which both Riccati equations hold.

Where some control has no price or some measurement no noise they are those of
:mod:`robustpolish.synthesis.riccati.reduction`. In double precision they say where the infimum may
be; what is claimed of it is proven by :mod:`robustpolish.synthesis.riccati.proof`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from robustpolish.long_calls import Budget, step_cost
from robustpolish.synthesis.problem.matrices import PlantMatrices, regularise, shifted
from robustpolish.synthesis.riccati.proof import PROVABLE_STATES, PROVEN, proven_bound
from robustpolish.synthesis.riccati.reduction import reduced_halves
from robustpolish.synthesis.riccati.two_riccati import (
    Attempt,
    TwoHalves,
    has_full_rank,
    normalise,
)


@dataclass(frozen=True)
class GammaPolicy:
    """Thresholds of the search for gamma.

    Attributes
    ----------
    growth, drop : float
        How far gamma is raised until it is feasible, and lowered while nothing is known below.
    most_steps : int
        Attempts of one search; bisection from 1e12 to 1e-4 takes 50.
    least : float
        Relative size of a lower end that says nothing.
    zero : float
        An infimum so far below the first feasible gamma counts as zero: AC1, AC12 and UWV of
        COMPleib reach 1e-14 before rounding ends the descent.
    hardly : float
        How little a plant with zeros on the axis is regularised for an estimate: less, and
        rounding decides (the Riccati solutions hold 1 / hardly^2).
    beside : float
        By how much the axis is moved for another: less than the poles of weights, 1e-5, and more
        than rounding moves double zeros, 1e-8.
    """

    growth: float = 8.0
    drop: float = 1e-2
    most_steps: int = 60
    least: float = 1e-12
    zero: float = 1e-10
    hardly: float = 1e-6
    beside: float = 1e-6


_POLICY = GammaPolicy()


class GammaBracket(NamedTuple):
    """A feasible gamma and one below which nothing was feasible."""

    upper: float
    lower: float
    solution: Attempt
    attempts: int


class LowerBound(NamedTuple):
    """A norm below which no controller comes, and how that is known."""

    value: float
    how: str
    proven: bool = True  # an estimate may lie above norms that are reached
    bracket: GammaBracket | None = None  # of the equations of a regular plant, in doubles


def lower_bound(plant: PlantMatrices, tolerance: float, budget: Budget) -> LowerBound | None:
    """Bound the H-infinity norm of every stabilising controller's loop from below.

    Equations in double precision say where the infimum may be, and those in long arithmetic prove
    how much of it is true.

    Parameters
    ----------
    plant : PlantMatrices
        Scaled, continuous, without D22.
    tolerance : float
        How much of the infimum, relative, may be given away.
    budget : Budget
        For the search in double precision. Like a certificate, a proof is made in any case.

    Returns
    -------
    LowerBound or None
        Proven, or for a plant too large for that an estimate; None where the equations have no
        solution in double precision for any gamma.
    """
    guess = estimated_bound(plant, tolerance, budget)
    if plant.nx <= PROVABLE_STATES:
        proven = proven_bound(plant, 1.0 if guess is None else guess.value, tolerance)
        return LowerBound(proven, PROVEN, bracket=guess and guess.bracket)
    return guess


def estimated_bound(plant: PlantMatrices, tolerance: float, budget: Budget) -> LowerBound | None:
    """Estimate the infimum in double precision, as :func:`lower_bound` without its proof."""
    regular = has_full_rank(plant)
    halves = _regular_halves if regular else reduced_halves
    found = [_infimum(halves, plant, tolerance, budget)]
    if not regular or found == [None]:
        # Zeros on the axis are the commonest reason to fail; with it moved they lie beside it.
        beside = shifted(plant, -_POLICY.beside)
        found.append(_infimum(halves, beside, tolerance, budget))
    known = [bracket.lower for bracket in found if bracket is not None]
    how = "estimated by Riccati equations in double precision"
    if known:
        return LowerBound(min(known), how, False, found[0] if regular else None)
    bracket = _infimum(reduced_halves, regularise(plant, _POLICY.hardly), tolerance, budget)
    how += f" of a plant with a price and a noise of {_POLICY.hardly:.0e}"
    return None if bracket is None else LowerBound(bracket.lower, how, False)


def is_out_of_reach(plant: PlantMatrices, gamma: float) -> bool:
    """Tell whether the equations of a plant have no solution in doubles for a norm."""
    halves = (_regular_halves if has_full_rank(plant) else reduced_halves)(plant)
    return halves is not None and not halves.attempt(gamma).feasible


def _infimum(
    halves: Callable[[PlantMatrices], TwoHalves | None],
    plant: PlantMatrices,
    tolerance: float,
    budget: Budget,
) -> GammaBracket | None:
    found = halves(plant)
    return None if found is None else search_gamma(found, 1.0, tolerance, budget)


def _regular_halves(plant: PlantMatrices) -> TwoHalves:
    """Return the equations of a plant whose D12 and D21 have full rank."""
    return normalise(plant).halves


def search_gamma(
    halves: TwoHalves,
    start: float,
    tolerance: float,
    budget: Budget,
    shortcut: float = 0.0,
    known: GammaBracket | None = None,
) -> GammaBracket | None:
    """Narrow the optimal gamma down to a relative `tolerance`.

    rho(XY)^(1/2) falls as gamma rises and equals gamma at the optimum, unless X or Y ceases
    to exist before. Hence it is a lower bound at every feasible gamma, and its secant
    makes bisection rare.

    Parameters
    ----------
    halves : TwoHalves
    start : float
        A gamma that is expected to be feasible; raised until it is.
    tolerance : float
        Relative width at which to stop; an optimum far below `start` is not told from zero.
    budget : Budget
        The bracket so far is returned when it is over.
    shortcut : float
        If a gamma lower than `start` by this share is infeasible, stop there.
    known : GammaBracket, optional
        The result of a coarser search, to go on from.

    Returns
    -------
    GammaBracket or None
        None if no feasible gamma was found.
    """
    bracket = known or _first_feasible(halves, start, budget)
    if bracket is None:
        return None
    upper, lower, best, count = bracket
    if shortcut and lower < upper * (1 - shortcut) and not budget.over:
        found = _tried(halves, upper * (1 - shortcut), budget)
        count += 1
        if not found.feasible:
            return GammaBracket(upper, max(lower, upper * (1 - shortcut)), best, count)
        upper, best = upper * (1 - shortcut), found
        lower = max(lower, best.coupling or 0.0)
    points = [(upper, (best.coupling or 0.0) - upper)]
    zero = upper * _POLICY.zero
    halve = True
    while (
        upper > max(lower * (1 + tolerance), zero)
        and count < _POLICY.most_steps
        and not budget.over
    ):
        width = _width(lower, upper)
        guess = None if halve else _secant(points, lower, upper, tolerance)
        trial = _middle(lower, upper) if guess is None else guess
        found = _tried(halves, trial, budget)
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


def _first_feasible(halves: TwoHalves, start: float, budget: Budget) -> GammaBracket | None:
    """Raise gamma until both equations can be solved."""
    floor = halves.floor
    lower, upper = floor, max(start, floor * (1 + 1e-6))
    for count in range(1, _POLICY.most_steps):
        found = _tried(halves, upper, budget)
        if found.feasible:
            return GammaBracket(upper, max(lower, found.coupling or 0.0), found, count)
        if budget.over:
            return None
        lower = upper
        # Above the optimum the coupling is smaller, so that it is an upper bound here.
        upper *= (
            _POLICY.growth
            if found.coupling is None
            else min(_POLICY.growth, found.coupling / upper * 1.05)
        )
        if not np.isfinite(upper):
            return None
    return None


def _tried(halves: TwoHalves, gamma: float, budget: Budget) -> Attempt:
    budget.spend(step_cost(halves.states))
    return halves.attempt(gamma)


def _width(lower: float, upper: float) -> float:
    return float(np.log(upper / max(lower, upper * _POLICY.least)))


def _middle(lower: float, upper: float) -> float:
    """Halve the bracket on the logarithmic scale, or drop far if nothing is known below."""
    return upper * max(np.sqrt(lower / upper), _POLICY.drop)


def _secant(
    points: list[tuple[float, float]], lower: float, upper: float, tolerance: float
) -> float | None:
    """Propose the zero of coupling - gamma, moved towards the unknown side by a little.

    None where it lies outside of the bracket: there X or Y ceases to exist before.
    """
    if len(points) < 2:
        return None
    (a, fa), (b, fb) = points[-2:]
    if fa == fb:
        return None
    root = (b - fb * (b - a) / (fb - fa)) * (1 + tolerance / 3)
    return root if lower < root < upper * (1 - tolerance / 10) else None
