"""The infimum of the H-infinity norm: the smallest gamma for which both Riccati equations hold.

Where some control has no price or some measurement no noise they are those of
:mod:`robustpolish.synthesis.riccati.reduction`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.long_calls import Budget, step_cost
from robustpolish.synthesis.problem.matrices import PlantMatrices, regularise, shifted
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
    shifts : tuple of float
        By how much the axis is moved, over the plant's unit of frequency, where zeros lie on it, as
        those of a weighted servo with an integrator do. Rounding moves double zeros by 1e-8, and
        weights have poles at 1e-5.
    copies : int
        Copies of a plant, of other units and last digits, in which a bound has to hold too.
    below, above : tuple of float
        Factors on a bracket at which the equations of copies have to fail, and to hold.
    last_digits : float
        Relative change of the numbers of a copy, as data in doubles are known.
    octaves : int
        The units of its states change by up to so many factors of two.
    costly_states : int
        Above so many states a single copy is tried, at fewer norms.
    """

    growth: float = 8.0
    drop: float = 1e-2
    most_steps: int = 60
    least: float = 1e-12
    zero: float = 1e-10
    hardly: float = 1e-6
    shifts: tuple[float, ...] = (1e-7, 1e-8, 1e-6, 1e-5)
    copies: int = 3
    below: tuple[float, ...] = (0.995, 0.9, 0.97, 0.6, 0.2)
    above: tuple[float, ...] = (1.005, 1.3, 3.0)
    last_digits: float = 1e-14
    octaves: int = 6
    costly_states: int = 24


_POLICY = GammaPolicy()


class GammaBracket(NamedTuple):
    """A feasible gamma and one below which nothing was feasible."""

    upper: float
    lower: float
    solution: Attempt
    attempts: int


EXACT = "by Riccati equations in double precision"
"""How a bound is known that holds without any regularisation."""


class LowerBound(NamedTuple):
    """A norm below which no controller comes, and how that is known."""

    value: float
    how: str
    proven: bool = True  # but for rounding; an estimate holds for a changed plant only


def lower_bound(
    plant: PlantMatrices, tolerance: float, budget: Budget, below: float = np.inf
) -> LowerBound | None:
    """Bound the H-infinity norm of every stabilising controller's loop from below.

    Parameters
    ----------
    plant : PlantMatrices
        Scaled, continuous, without D22.
    tolerance : float
        How much of the infimum, relative, may be given away.
    budget : Budget
    below : float
        A norm that was reached: larger bounds are spoilt by rounding, and left out.

    Returns
    -------
    LowerBound or None
        None where the equations have no solution in double precision for any gamma.
    """
    hardly = regularise(plant, _POLICY.hardly)
    size = f"{_POLICY.hardly:.0e}"
    estimated = f"estimated by Riccati equations of a plant with a price and a noise of {size}"
    ways = [(reduced_halves, plant, EXACT), (reduced_halves, hardly, estimated)]
    if has_full_rank(plant):
        ways.insert(0, (_regular_halves, plant, EXACT))
    for halves, P, how in ways:
        value = _largest_infeasible(P, halves, tolerance, budget)
        if value is not None and value <= below:
            return LowerBound(value, how, how != estimated)
    return None


def _largest_infeasible(
    plant: PlantMatrices,
    halves: Callable[[PlantMatrices], TwoHalves | None],
    tolerance: float,
    budget: Budget,
) -> float | None:
    """Return a gamma below which the equations have no solution; None if they never have one.

    Where zeros lie on the axis the equations fail for every gamma or for too many. That shows
    if they hold once the axis is moved to the left, which makes the problem harder; then what
    they say with the axis moved to the right, where it is easier, holds for the plant too.
    """
    own = halves(plant)
    if own is None:
        return None
    exact = search_gamma(own, 1.0, tolerance, budget)
    for shift in _POLICY.shifts:
        harder, easier = halves(shifted(plant, shift)), shifted(plant, -shift)
        if harder is None:
            continue
        bound = None if exact is None else exact.lower * (1 - tolerance)
        if bound is not None and not _tried(harder, bound, budget).feasible:
            continue
        if (left := halves(easier)) is None:
            continue
        bracket = search_gamma(left, 1.0, tolerance, budget)
        if bracket is not None and _is_beyond_rounding(bracket, easier, halves):
            return bracket.lower
    if exact is None or not _is_beyond_rounding(exact, plant, halves):
        return None
    return exact.lower


def _is_beyond_rounding(
    bracket: GammaBracket,
    plant: PlantMatrices,
    halves: Callable[[PlantMatrices], TwoHalves | None],
) -> bool:
    """Tell whether the equations fail below a bracket and hold above it in other units too.

    Where rounding decides, it decides otherwise in copies of the plant whose numbers and units
    of states differ a little. Like a certificate, this is done in any case and takes no work
    from the search.
    """
    if bracket.lower <= bracket.upper * _POLICY.zero:
        return True  # nothing is claimed
    draw = np.random.default_rng(0)
    costly = plant.nx > _POLICY.costly_states
    for _ in range(1 if costly else _POLICY.copies):
        copy = halves(_rounded(plant, draw))
        if copy is None:
            return False
        for factor in _POLICY.below[:2] if costly else _POLICY.below:
            if copy.attempt(bracket.lower * factor).feasible:
                return False
        for factor in _POLICY.above[:1] if costly else _POLICY.above:
            if not copy.attempt(bracket.upper * factor).feasible:
                return False
    return True


def _rounded(plant: PlantMatrices, draw: np.random.Generator) -> PlantMatrices:
    """Return a copy of a plant in other units of states, its numbers changed in their last digits.

    Zeros stay zeros.
    """

    def changed(M: Matrix) -> Matrix:
        return M * (1 + _POLICY.last_digits * draw.standard_normal(M.shape))

    unit = 2.0 ** draw.integers(-_POLICY.octaves, _POLICY.octaves + 1, plant.nx)
    copy = plant.in_states(np.diag(1 / unit), np.diag(unit))
    names = ("A", "B1", "B2", "C1", "C2")
    return copy.replace(**{name: changed(getattr(copy, name)) for name in names})


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
    """Propose the zero of coupling - gamma, moved towards the unknown side by a little."""
    if len(points) < 2:
        return None
    (a, fa), (b, fb) = points[-2:]
    if fa == fb:
        return None
    root = b - fb * (b - a) / (fb - fa)
    inside = min(max(root * (1 + tolerance / 3), lower * (1 + tolerance / 3)), upper)
    return inside if lower < inside < upper * (1 - tolerance / 10) else None
