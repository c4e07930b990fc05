"""Lower bounds of the H-infinity norm, proven in long arithmetic.

Whether the Riccati equations fail is decided by numbers that doubles cannot hold: prices of 1e-12
beside one, zeros beside the axis. With hundreds of digits nothing is decided by rounding.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import flint

from robustpolish.base.budget import DeadlineError, check_deadline
from robustpolish.linear.arithmetic.balls import (
    Ball,
    UndecidedError,
    ball,
    block,
    has_eigenvalue_below,
    identity,
    independent_first,
    is_surely_not_semidefinite,
    part,
    precision,
    riccati_terms,
    stabilising_solution,
    zeros,
)
from robustpolish.synthesis.problem.matrices import PlantMatrices

# The H-infinity problem over a disc inside the right half plane, in long arithmetic.
#
# A loop that is stable has its largest gain over the right half plane on the axis (maximum
# principle), so that its gain over a disc inside is no larger. What no controller reaches over the
# disc none reaches at all: a bound there is a bound for the plant.
#
# Zeros on the axis and at infinity lie outside the disc. A bilinear map takes the disc to the half
# plane, so that in the new plant no zeros are on the axis, and D12 and D21 have full rank wherever
# some control does not depend on the others: the Riccati equations exist. Infinity costs many
# digits, for a price on u that comes after k integrations has the size 1 / radius^k in D12.
#
# Controls that all depend on others (more controls than outputs) can be chosen freely. They set a
# part of the state at will, which is then a control of the rest, until none is left: Stoorvogel,
# "The singular H-infinity control problem with dynamic measurement feedback", SIAM J. Control and
# Optimization 29 (1991) 160-184.


# Real numbers at which the circle meets the real axis, over the plant's unit of frequency. Rounding
# moves double zeros on the axis by 1e-8, and weights have poles at 1e-5. Bounds fall by about
# _BESIDE over the slowest and the fastest over _BEYOND.
_BESIDE, _BEYOND = 1e-8, 1e8
# A coupling has to be larger than gamma by so much, relative.
_MARGIN = 1e-9


@dataclass(frozen=True, eq=False)
class PreciseRiccati:
    """The equation of the controls, or of the measurements transposed, enclosed in balls.

    Attributes
    ----------
    A, B1, B2, C, D11, D12 : flint.arb_mat
        D12 of full column rank.
    basis : flint.arb_mat
        X of the plant is basis' X basis.
    """

    A: Ball
    B1: Ball
    B2: Ball
    C: Ball
    D11: Ball
    D12: Ball
    basis: Ball

    def is_below_floor(self, gamma: Any) -> bool:
        """Tell whether the feedthrough alone surely forces a larger norm than gamma."""
        D, free = self.D12, self.D11.transpose() * self.D11
        if D.ncols():
            cross = D.transpose() * self.D11
            free -= cross.transpose() * (D.transpose() * D).inv() * cross
        return has_eigenvalue_below(-1 * free, -(gamma**2) * (1 + _MARGIN))

    def solution(self, gamma: Any) -> Ball | None:
        """Return the stabilising X; None if there is none, or none that is semidefinite."""
        B, D = block([[self.B1, self.B2]]), block([[self.D11, self.D12]])
        price, Ct = D.transpose() * D, self.C.transpose()
        for i in range(self.B1.ncols()):
            price[i, i] -= gamma**2
        X = stabilising_solution(*riccati_terms(self.A, B, Ct * self.C, Ct * D, price))
        if X is None or is_surely_not_semidefinite(X):
            return None
        return self.basis.transpose() * X * self.basis


@dataclass(frozen=True, eq=False)
class PreciseRiccatiPair:
    """Both equations over the disc, and the feedthrough's on their own, which infinity adds."""

    halves: tuple[PreciseRiccati, PreciseRiccati]
    at_infinity: tuple[PreciseRiccati, PreciseRiccati]

    @classmethod
    def of(cls, plant: PlantMatrices) -> PreciseRiccatiPair:
        """Take a continuous plant; its D22 plays no part."""
        P = [ball(getattr(plant, name)) for name in ("A", "B1", "B2", "C1", "C2")]
        D = [ball(getattr(plant, name)) for name in ("D11", "D12", "D21")]
        nothing = (zeros(0, 0), *(zeros(0, M.ncols()) for M in P[1:3]))
        blank = (*nothing, *(zeros(M.nrows(), 0) for M in P[3:]))
        return cls(_halves(*_mapped(*P, *D)), _halves(*blank, *D))

    def is_out_of_reach(self, gamma: float) -> bool:
        """Tell whether surely no controller has a norm of gamma or less.

        Raises
        ------
        UndecidedError, ZeroDivisionError
            If the digits do not suffice.
        """
        level = flint.arb(gamma)
        if any(half.is_below_floor(level) for half in (*self.at_infinity, *self.halves)):
            return True
        X = self.halves[0].solution(level)
        Y = None if X is None else self.halves[1].solution(level)
        if X is None or Y is None:
            return True
        return has_eigenvalue_below(-1 * (X * Y), -(level**2) * (1 + _MARGIN))


def _mapped(
    A: Ball, B1: Ball, B2: Ball, C1: Ball, C2: Ball, D11: Ball, D12: Ball, D21: Ball
) -> tuple[Ball, ...]:
    """Put s = beside + p / (1 + p / beyond), which takes Re p > 0 to the disc."""
    share = 1 / flint.arb(_BEYOND)
    moved = A - identity(A.nrows()) * _BESIDE
    back = (identity(A.nrows()) - moved * share).inv()
    B1, B2 = back * B1, back * B2
    direct = D11 + C1 * B1 * share, D12 + C1 * B2 * share, D21 + C2 * B1 * share
    return (back * moved, B1, B2, C1 * back, C2 * back, *direct)


def _halves(
    A: Ball, B1: Ball, B2: Ball, C1: Ball, C2: Ball, D11: Ball, D12: Ball, D21: Ball
) -> tuple[PreciseRiccati, PreciseRiccati]:
    turned = [M.transpose() for M in (A, C1, C2, B1, D11, D21)]
    return _reduced(A, B1, B2, C1, D11, D12), _reduced(*turned)


def _reduced(A: Ball, B1: Ball, B2: Ball, C: Ball, D11: Ball, D12: Ball) -> PreciseRiccati:
    """Replace controls that D12 does not see by the states that they set at will."""
    basis = identity(A.nrows())
    while True:
        turn, used = independent_first(block([[B2], [D12]]))
        turn = part(turn, columns=slice(0, used))
        B2, D12 = B2 * turn, D12 * turn
        turn, priced = independent_first(D12)
        if priced == D12.ncols():
            return PreciseRiccati(A, B1, B2, C, D11, D12, basis)
        first, rest = slice(0, priced), slice(priced, None)
        B2, D12 = B2 * turn, part(D12 * turn, columns=first)
        turn, free = independent_first(part(B2, columns=rest).transpose())
        # The last of the new states are those that these controls do not move.
        into = turn.transpose()
        back = into.inv()
        left, right = part(into, slice(free, None)), part(back, columns=slice(free, None))
        at_will = part(back, columns=slice(0, free))
        B2 = left * block([[part(B2, columns=first), A * at_will]])
        D12 = block([[D12, C * at_will]])
        A, B1, C = left * A * right, left * B1, C * right
        basis = left * basis


PROVABLE_STATES = 20
"""Up to so many states a bound is proven; the work grows with their fourth power.

At 10 states a norm takes 0.1 s, at 20 states 1 to 5 s, and three norms are the least."""

PROVEN = "by Riccati equations in long arithmetic"
"""How a bound is known that holds for every controller."""


# Precisions that are tried where the digits do not suffice: most plants need the first.
_BITS = (768, 1536, 3072)
# How far below and above a guess is tried first, in tolerances, and by what factor the step grows
# where the guess was wrong.
_FIRST, _GROWTH = 0.5, 8.0
# Norms that are tried at most; most plants need three, a guess wrong by 1e40 needs 30.
_STEPS = 40
# Smaller bounds, in scaled units, are as good as zero, and larger ones as good as infinite.
_LEAST, _MOST = 1e-30, 1e30
# Share of the bound: the nearer a norm lies to the infimum, the more digits it takes.
_GIVEN_AWAY = 1e-9


def proven_lower_bound(plant: PlantMatrices, guess: float, tolerance: float) -> float:
    """Return a norm that surely no controller reaches, as large as that can be proven.

    Parameters
    ----------
    plant : PlantMatrices
        Scaled, continuous, without D22.
    guess : float
        Where the infimum may be. A wrong one takes longer.
    tolerance : float
        How much, relative, may be given away.

    Returns
    -------
    float
        Zero where nothing could be proven in the time there is.
    """
    bits, known = list(_BITS), None

    def is_out_of_reach(gamma: float) -> bool:
        """Tell whether surely no controller has this norm, in as many bits as norms have needed."""
        nonlocal known
        while bits:
            with precision(bits[0]):
                try:
                    known = known or PreciseRiccatiPair.of(plant)
                    return known.is_out_of_reach(gamma)
                except (UndecidedError, ZeroDivisionError):
                    bits.pop(0)
                    known = None
        return False

    lower, upper = 0.0, math.inf
    step = _FIRST * tolerance
    trial = max(guess, _LEAST) / (1 + step)
    for _ in range(_STEPS):
        try:
            check_deadline()
            out_of_reach = is_out_of_reach(trial)
        except DeadlineError:
            break
        lower, upper = (trial, upper) if out_of_reach else (lower, trial)
        if upper <= max(lower * (1 + tolerance), _LEAST) or lower >= _MOST:
            break
        if lower > 0 and upper < math.inf:
            trial = math.sqrt(lower * upper)
            continue
        # Beside the guess first, then ever farther.
        trial = lower * (1 + step) ** 2 if lower else upper / (1 + step)
        step *= _GROWTH
    return lower * (1 - _GIVEN_AWAY)
