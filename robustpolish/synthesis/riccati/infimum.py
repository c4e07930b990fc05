"""The infimum of the H-infinity norm: the smallest gamma for which both Riccati equations hold.

Where some control has no price or some measurement no noise the equations do not exist as they
stand. There a measurement without noise tells a part of the state exactly, and its derivative is
a new measurement, of the other states and with the noise of the process. Repeated until all that
is left is noisy, this reduces the equation to the states that stay uncertain, without changing
the infimum; and likewise, transposed, for controls without price.

Stoorvogel, "The singular H-infinity control problem with dynamic measurement feedback", SIAM J.
Control and Optimization 29 (1991) 160-184.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.long_calls import Budget, step_cost
from robustpolish.synthesis.problem.matrices import PlantMatrices, regularise, shifted
from robustpolish.synthesis.riccati.two_riccati import (
    Attempt,
    Half,
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
    noiseless : float
        Relative size of noise on a measurement, or of a price on a control, that counts as none;
        its inverse squared enters the equations.
    unseen : float
        Relative size of what a measurement without noise sees that counts as nothing.
    rounding : float
        Size of an entry beside the largest one that is nothing but rounding (ROC6 in other units).
    hardly : float
        How little a plant with zeros on the axis is regularised for an estimate: less, and
        rounding decides (the Riccati solutions hold 1 / hardly^2).
    shifts : tuple of float
        By how much the axis is moved, over the plant's unit of frequency, where zeros lie on it, as
        those of a weighted servo with an integrator do. Rounding moves double zeros by 1e-8, and
        weights have poles at 1e-5.
    """

    growth: float = 8.0
    drop: float = 1e-2
    most_steps: int = 60
    least: float = 1e-12
    zero: float = 1e-10
    noiseless: float = 1e-7
    unseen: float = 1e-9
    rounding: float = 1e-12
    hardly: float = 1e-6
    shifts: tuple[float, ...] = (1e-7, 1e-8, 1e-6, 1e-5)


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
    halves: Callable[[PlantMatrices], TwoHalves],
    tolerance: float,
    budget: Budget,
) -> float | None:
    """Return a gamma below which the equations have no solution; None if they never have one.

    Where zeros lie on the axis the equations fail for every gamma or for too many. That shows
    if they hold once the axis is moved to the left, which makes the problem harder; then what
    they say with the axis moved to the right, where it is easier, holds for the plant too.
    """
    exact = search_gamma(halves(plant), 1.0, tolerance, budget)
    for shift in _POLICY.shifts:
        if exact is not None:
            harder = halves(shifted(plant, shift))
            if not _tried(harder, exact.lower * (1 - tolerance), budget).feasible:
                continue
        easier = search_gamma(halves(shifted(plant, -shift)), 1.0, tolerance, budget)
        if easier is not None:
            return easier.lower
    return None if exact is None else exact.lower


def _regular_halves(plant: PlantMatrices) -> TwoHalves:
    """Return the equations of a plant whose D12 and D21 have full rank."""
    return normalise(plant).halves


def reduced_halves(plant: PlantMatrices) -> TwoHalves:
    """Return the equations of a plant, reduced where D12 or D21 is rank-deficient."""
    P = plant
    return TwoHalves(
        _reduced(P.A, P.B1, P.B2, P.C1, P.D11, P.D12),
        _reduced(P.A.T, P.C1.T, P.C2.T, P.B1.T, P.D11.T, P.D21.T),
    )


def _reduced(A: Matrix, B1: Matrix, B2: Matrix, C: Matrix, D11: Matrix, D12: Matrix) -> Half:
    """Replace controls without price by the states that they set at will, until none is left.

    Written for controls; measurements are their transpose.
    """
    basis: Matrix | None = None
    nothing = 0.0
    while True:
        size = np.linalg.norm(np.vstack([B2, D12]), axis=0)
        used = size > nothing
        B2, D12 = B2[:, used] / size[used], D12[:, used] / size[used]
        U, s, Vt = np.linalg.svd(D12)
        priced = int((s > _POLICY.noiseless).sum())
        if priced == D12.shape[1]:
            break
        B2, D12 = B2 @ Vt.T, D12 @ Vt.T
        W, reach, _ = np.linalg.svd(B2[:, priced:])
        free = int((reach > _POLICY.unseen).sum())
        B2, D12 = B2[:, :priced], D12[:, :priced]
        if free:
            # The states that cost nothing become controls of the others, at the price of z.
            at_will, left = W[:, :free], W[:, free:]
            B2 = left.T @ np.hstack([B2, A @ at_will])
            D12 = np.hstack([D12, C @ at_will])
            A, B1, C = left.T @ A @ left, left.T @ B1, C @ left
            basis = left if basis is None else basis @ left
            nothing = _POLICY.rounding * max(np.abs(A).max(initial=0), np.abs(C).max(initial=0))
    nu = D12.shape[1]
    turn = np.vstack([U[:, nu:].T, U[:, :nu].T])
    price = np.vstack([np.zeros((len(D12) - nu, nu)), np.eye(nu)])
    return Half(A, B1, B2 @ Vt.T / s[:nu], turn @ C, turn @ D11, price, basis)


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
