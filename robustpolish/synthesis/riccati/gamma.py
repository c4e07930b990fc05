"""The infimum of the H-infinity norm: the smallest gamma for which both Riccati equations hold.

Where some control has no price or some measurement no noise they are those of
:mod:`robustpolish.synthesis.riccati.gamma`. In double precision they say where the infimum may
be; what is claimed of it is proven by :mod:`robustpolish.synthesis.riccati.gamma`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import flint
import numpy as np
from numpy.typing import NDArray

from robustpolish.base.arrays import NOTHING, ROUNDING, SAME, Vector
from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.budget import Budget, DeadlineError, check_deadline, step_cost
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
from robustpolish.synthesis.problem.matrices import (
    Controller,
    PlantMatrices,
    regularise,
    shifted,
    solve_riccati,
)

# Lower bounds of the H-infinity norm, proven in long arithmetic.
#
# Whether the Riccati equations fail is decided by numbers that doubles cannot hold: prices of 1e-12
# beside one, zeros beside the axis. With hundreds of digits nothing is decided by rounding.


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
# _SLOWER over the slowest and the fastest over _FASTER.
_SLOWER, _FASTER = 1e-8, 1e8


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
        # A coupling has to be larger than gamma by so much, relative.
        return has_eigenvalue_below(-1 * free, -(gamma**2) * (1 + SAME))

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
        return has_eigenvalue_below(-1 * (X * Y), -(level**2) * (1 + SAME))


def _mapped(
    A: Ball, B1: Ball, B2: Ball, C1: Ball, C2: Ball, D11: Ball, D12: Ball, D21: Ball
) -> tuple[Ball, ...]:
    """Put s = beside + p / (1 + p / beyond), which takes Re p > 0 to the disc."""
    share = 1 / flint.arb(_FASTER)
    moved = A - identity(A.nrows()) * _SLOWER
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
_FIRST, _WIDENING = 0.5, 8.0
# Norms that are tried at most; most plants need three, a guess wrong by 1e40 needs 30.
_STEPS = 40
# Smaller bounds, in scaled units, are as good as zero, and larger ones as good as infinite.
_MOST = 1e30


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
    trial = max(guess, NOTHING) / (1 + step)
    for _ in range(_STEPS):
        try:
            check_deadline()
            out_of_reach = is_out_of_reach(trial)
        except DeadlineError:
            break
        lower, upper = (trial, upper) if out_of_reach else (lower, trial)
        if upper <= max(lower * (1 + tolerance), NOTHING) or lower >= _MOST:
            break
        if lower > 0 and upper < math.inf:
            trial = math.sqrt(lower * upper)
            continue
        # Beside the guess first, then ever farther.
        trial = lower * (1 + step) ** 2 if lower else upper / (1 + step)
        step *= _WIDENING
    # Share of the bound: the nearer a norm lies to the infimum, the more digits it takes.
    return lower * (1 - SAME)


# Riccati and Lyapunov equations, solved so that failure is seen.
#
# ``scipy.linalg.solve_continuous_are`` can return a wrong solution without an error near the
# optimum of an H-infinity problem, and wants a definite quadratic term. The solver here balances
# the Hamiltonian with a scaling that keeps its structure, orders its real Schur form and answers
# None when the stable subspace is no graph.


# The central H-infinity controller from two Riccati equations.
#
# Zhou, Doyle and Glover, "Robust and Optimal Control" (1996), theorem 17.1, for plants with
# D11. D12 must have full column rank, D21 full row rank and no zeros may lie on the axis;
# :func:`robustpolish.synthesis.problem.matrices.regularise` provides for that.


class Attempt(NamedTuple):
    """The two Riccati solutions at one gamma.

    Attributes
    ----------
    feasible : bool
        X, Y >= 0 exist and rho(XY) < gamma^2.
    coupling : float or None
        The square root of rho(XY); None where X or Y does not exist.
    """

    feasible: bool
    coupling: float | None
    X: Matrix | None = None
    Y: Matrix | None = None


@dataclass(frozen=True, eq=False)
class RiccatiEquation:
    """What one of the two equations needs: that of the controls, or of the measurements transposed.

    Attributes
    ----------
    A, B1, B2, C, D11, D12 : ndarray
        In coordinates in which D12 = [0; I].
    basis : ndarray or None
        Where the states of a reduced half lie among those of the plant; None for all of them.
    """

    A: Matrix
    B1: Matrix
    B2: Matrix
    C: Matrix
    D11: Matrix
    D12: Matrix
    basis: Matrix | None = None

    @property
    def floor(self) -> float:
        """The norm that the feedthrough alone forces."""
        free = self.D11[: self.D11.shape[0] - self.B2.shape[1]]
        return float(np.linalg.norm(free, 2)) if free.size else 0.0

    def solve(self, gamma: float) -> Matrix | None:
        """Solve the Riccati equation; None unless its solution exists and is semidefinite.

        With an infinite gamma it is that of the H2 norm.
        """
        # Without a bound the disturbances play no part.
        nw = self.B1.shape[1] if np.isfinite(gamma) else 0
        A, B, C = self.A, np.hstack([self.B1[:, :nw], self.B2]), self.C
        D = np.hstack([self.D11[:, :nw], self.D12])
        n = len(A)
        R = D.T @ D
        R[:nw, :nw] -= gamma**2 * np.eye(nw)
        try:
            inverse = np.linalg.solve(R, np.hstack([D.T @ C, B.T]))
        except np.linalg.LinAlgError:
            return None
        RDC, RB = inverse[:, :n], inverse[:, n:]
        quadratic = -B @ RB
        constant = C.T @ C - (C.T @ D) @ RDC
        X = solve_riccati(A - B @ RDC, (quadratic + quadratic.T) / 2, (constant + constant.T) / 2)
        if X is None:
            return None
        # X >= 0 if and only if the full-information controller stabilises with w = 0; unlike the
        # eigenvalues of X, which may span many decades, this can be seen in doubles.
        F = -(RDC + RB @ X)
        direct = self.D11[len(C) - self.B2.shape[1] :, :nw]
        feedback = F[nw:] + direct @ F[:nw]
        if not np.linalg.eigvals(A + self.B2 @ feedback).real.max(initial=-np.inf) < 0:
            return None
        return X if self.basis is None else self.basis @ X @ self.basis.T


@dataclass(frozen=True, eq=False)
class RiccatiPair:
    """The pair of equations whose common solvability decides whether a gamma can be reached."""

    control: RiccatiEquation
    measurement: RiccatiEquation

    @property
    def states(self) -> int:
        """Number of states, which the cost of an attempt follows from."""
        return max(len(self.control.A), len(self.measurement.A))

    @property
    def floor(self) -> float:
        """The norm that the feedthrough alone forces."""
        return max(self.control.floor, self.measurement.floor)

    def attempt(self, gamma: float) -> Attempt:
        """Solve both equations at `gamma`."""
        if gamma <= self.floor:
            return Attempt(False, None)
        # Overflow makes the equations unsolvable, which is an answer.
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            X = self.control.solve(gamma)
            Y = None if X is None else self.measurement.solve(gamma)
            if X is None or Y is None:
                return Attempt(False, None)
            coupling = float(np.sqrt(np.abs(np.linalg.eigvals(X @ Y)).max(initial=0.0)))
        return Attempt(coupling < gamma, coupling, X, Y)


@dataclass(frozen=True, eq=False)
class NormalisedPlant:
    """A plant in coordinates of w, u, z, y in which D12 = [0; I] and D21 = [0, I].

    Attributes
    ----------
    plant : PlantMatrices
    control, measurement : ndarray
        u = control times the normalised u; normalised y = measurement times y.
    """

    plant: PlantMatrices
    control: Matrix
    measurement: Matrix

    @cached_property
    def halves(self) -> RiccatiPair:
        """Its two Riccati equations."""
        return RiccatiPair(
            *(
                RiccatiEquation(P.A, P.B1, P.B2, P.C1, P.D11, P.D12)
                for P in (self.plant, self.plant.dual)
            )
        )

    def controller(self, K: Controller) -> Controller:
        """Return the controller in the original u and y."""
        U, Y = self.control, self.measurement
        return Controller(K.A, K.B @ Y, U @ K.C, U @ K.D @ Y)


def has_full_rank(plant: PlantMatrices) -> bool:
    """Tell whether D12 and D21 have full column and row rank, whatever the sizes of signals."""
    return _full_rank(plant.D12) and _full_rank(plant.D21.T)


def _full_rank(D: Matrix) -> bool:
    size = np.linalg.norm(D, axis=0)
    if D.shape[0] < D.shape[1] or not size.all():
        return False
    return bool(np.linalg.svd(D / size, compute_uv=False)[-1] > 1e-8)


def normalise(plant: PlantMatrices) -> NormalisedPlant:
    """Rotate w and z and rescale u and y so that D12 and D21 are as the formulas want."""
    nz, nu = plant.D12.shape
    ny, nw = plant.D21.shape
    U12, s12, V12 = np.linalg.svd(plant.D12)
    U21, s21, V21 = np.linalg.svd(plant.D21)
    z_turn = np.vstack([U12[:, nu:].T, U12[:, :nu].T])
    w_turn = np.hstack([V21[ny:].T, V21[:ny].T])
    control = V12.T / s12
    measurement = (U21 / s21).T
    D12 = np.vstack([np.zeros((nz - nu, nu)), np.eye(nu)])
    D21 = np.hstack([np.zeros((ny, nw - ny)), np.eye(ny)])
    turned = plant.replace(
        B1=plant.B1 @ w_turn,
        B2=plant.B2 @ control,
        C1=z_turn @ plant.C1,
        C2=measurement @ plant.C2,
        D11=z_turn @ plant.D11 @ w_turn,
        D12=D12,
        D21=D21,
    )
    return NormalisedPlant(turned, control, measurement)


def central_controller(normal: NormalisedPlant, gamma: float, X: Matrix, Y: Matrix) -> Controller:
    """Return the central controller of theorem 17.1, in the original u and y."""
    P = normal.plant
    n, nw, nz = P.A.shape[0], P.B1.shape[1], P.C1.shape[0]
    nu, ny = P.B2.shape[1], P.C2.shape[0]
    w1, z1, g2 = nw - ny, nz - nu, gamma**2
    B, C = np.hstack([P.B1, P.B2]), np.vstack([P.C1, P.C2])
    D1, D_1 = np.hstack([P.D11, P.D12]), np.vstack([P.D11, P.D21])
    R, S = D1.T @ D1, D_1 @ D_1.T
    R[:nw, :nw] -= g2 * np.eye(nw)
    S[:nz, :nz] -= g2 * np.eye(nz)
    F = -np.linalg.solve(R, D1.T @ P.C1 + B.T @ X)
    L = -np.linalg.solve(S, (P.B1 @ D_1.T + Y @ C.T).T).T
    F12, F2 = F[w1:nw], F[nw:]
    L12, L2 = L[:, z1:nz], L[:, nz:]
    D = P.D11
    D1111, D1112, D1121, D1122 = D[:z1, :w1], D[:z1, w1:], D[z1:, :w1], D[z1:, w1:]
    left = g2 * np.eye(z1) - D1111 @ D1111.T
    Dk = -D1121 @ D1111.T @ np.linalg.solve(left, D1112) - D1122
    # The square roots D12^ and D21^ of the theorem cancel in the central controller.
    Z = np.eye(n) - Y @ X / g2
    C2F = P.C2 + F12
    Bk = np.linalg.solve(Z, -L2 + (P.B2 + L12) @ Dk)
    Ck = F2 - Dk @ C2F
    Ak = P.A + B @ F - Bk @ C2F
    return normal.controller(Controller(Ak, Bk, Ck, Dk))


# The two Riccati equations of a plant with controls without price or measurements without noise.
#
# They do not exist as they stand. A measurement without noise tells a part of the state exactly,
# and its derivative is a new measurement, of the other states and with the noise of the process.
# Repeated until all that is left is noisy, this reduces the equation to the states that stay
# uncertain, without changing the infimum; and likewise, transposed, for controls without price.
#
# What counts as no price decides which problem is solved: beside weights with poles at high
# frequencies a price of 1e-7 is all that they are. So every reduction is compared with the plant.
#
# Stoorvogel, "The singular H-infinity control problem with dynamic measurement feedback", SIAM J.
# Control and Optimization 29 (1991) 160-184.

Gains = NDArray[Any]
# Relative sizes of noise on a measurement, or of a price on a control, that count as none. Its
# inverse squared enters the equations, so the largest that keeps the plant is taken.
_NOISELESS = (1e-7, 1e-9, 1e-11)
# What was dropped may change the gain from u to z, relative to itself, by so much: ten times less
# than searches resolve.
_CHANGED = 3e-5
# Frequencies at which the gains are compared, and how far these reach beyond the slowest and the
# fastest mode.
_POINTS, _BEYOND = 12, 30.0


def reduced_riccati_pair(plant: PlantMatrices) -> RiccatiPair | None:
    """Return the equations of a plant, reduced where D12 or D21 is rank-deficient.

    Parameters
    ----------
    plant : PlantMatrices
        Scaled, continuous, without D22.

    Returns
    -------
    TwoHalves or None
        None where double precision cannot tell what has a price or noise, so that the equations
        would be those of another plant.
    """
    halves = []
    for P in (plant, plant.dual):
        A, B2, C, D12 = P.A, P.B2, P.C1, P.D12
        # Frequencies all over those of the plant, in the right half plane, away from both axes.
        rates = np.abs(np.linalg.eigvals(A))
        fastest = float(rates.max(initial=0.0)) or 1.0
        # Relative size of what a measurement without noise sees that counts as nothing.
        slowest = float(rates[rates > SAME * fastest].min(initial=fastest))
        points = np.geomspace(slowest / _BEYOND, fastest * _BEYOND, _POINTS) * (0.6 + 0.8j)
        # What the controls do to z there, each control its own. Every reduction keeps it: the new
        # controls follow from the old ones, and z from the new.
        controls = np.broadcast_to(
            np.eye(B2.shape[1], dtype=complex), (_POINTS, *[B2.shape[1]] * 2)
        )
        true = C @ _states(points, A, B2 @ controls) + D12
        size = np.linalg.norm(true, axis=1, keepdims=True)
        unit = np.where(size > 0, size, 1.0)
        inverse = np.linalg.pinv(true / unit, SAME)
        for noiseless in _NOISELESS:
            equation, gain = _reduced_by(noiseless, P, points, controls)
            change = (gain - true) / unit @ inverse
            if np.linalg.norm(change, axis=(1, 2)).max() <= _CHANGED:
                halves.append(equation)
                break
    return RiccatiPair(*halves) if len(halves) == 2 else None


def _reduced_by(
    noiseless: float, plant: PlantMatrices, points: Gains, controls: Gains
) -> tuple[RiccatiEquation, Gains]:
    """Replace controls without price by the states that they set at will, until none is left.

    Returns also what they do to z at complex frequencies, as gains of the old controls.
    """
    system = _PricedSystem(plant.A, plant.B1, plant.B2, plant.C1, plant.D12, controls)
    while True:
        system = system.scaled()
        U, s, Vt = np.linalg.svd(system.D12)
        priced = int((s > noiseless).sum())
        if priced == system.nu:
            break
        system = system.priced(priced, Vt, points)
    A, B1, B2, C, D12, controls, basis, _ = system
    nu = D12.shape[1]
    turn = np.vstack([U[:, nu:].T, U[:, :nu].T])
    price = np.vstack([np.zeros((len(D12) - nu, nu)), np.eye(nu)])
    half = RiccatiEquation(A, B1, B2 @ Vt.T / s[:nu], turn @ C, turn @ plant.D11, price, basis)
    return half, C @ _states(points, A, B2 @ controls) + D12 @ controls


class _PricedSystem(NamedTuple):
    """The states that are left and their controls, at frequencies as gains of the old controls."""

    A: Matrix
    B1: Matrix
    B2: Matrix
    C: Matrix
    D12: Matrix
    controls: Gains
    basis: Matrix | None = None
    nothing: float = 0.0

    @property
    def nu(self) -> int:
        return self.D12.shape[1]

    def scaled(self) -> _PricedSystem:
        """Scale the controls to size one, without those that do nothing."""
        size: Vector = np.linalg.norm(np.vstack([self.B2, self.D12]), axis=0)
        used = size > self.nothing
        B2, D12 = self.B2[:, used] / size[used], self.D12[:, used] / size[used]
        return self._replace(B2=B2, D12=D12, controls=self.controls[:, used] * size[used, None])

    def priced(self, priced: int, turn: Matrix, points: Gains) -> _PricedSystem:
        """Turn the controls, and keep those with a price."""
        A, _, B2, C, D12, controls, basis, _ = self
        B2, D12 = B2 @ turn.T, D12 @ turn.T
        controls = turn @ controls
        W, reach, _ = np.linalg.svd(B2[:, priced:])
        free = int((reach > SAME).sum())
        states = _states(points, A, B2 @ controls) if free else controls
        B2, D12, controls = B2[:, :priced], D12[:, :priced], controls[:, :priced]
        if not free:
            return self._replace(B2=B2, D12=D12, controls=controls)
        # The states that cost nothing become controls of the others, at the price of z.
        at_will, left = W[:, :free], W[:, free:]
        controls = np.concatenate([controls, at_will.T @ states], axis=1)
        B2 = left.T @ np.hstack([B2, A @ at_will])
        D12 = np.hstack([D12, C @ at_will])
        A, B1, C = left.T @ A @ left, left.T @ self.B1, C @ left
        basis = left if basis is None else basis @ left
        # Size of an entry beside the largest one that is nothing but rounding (ROC6 in other
        # units).
        nothing = ROUNDING * max(np.abs(A).max(initial=0), np.abs(C).max(initial=0))
        return _PricedSystem(A, B1, B2, C, D12, controls, basis, nothing)


def _states(points: Gains, A: Matrix, into: Gains) -> Gains:
    """Return (s I - A)^-1 `into` at all points s."""
    return np.linalg.solve(points[:, None, None] * np.eye(len(A)) - A, into)


# How far gamma is raised until it is feasible, and lowered while nothing is known below.
_GROWTH, _DROP = 8.0, 1e-2
# Attempts of one search; bisection from 1e12 to 1e-4 takes 50.
_MOST_STEPS = 60
# An infimum so far below the first feasible gamma counts as zero: AC1, AC12 and UWV of COMPleib
# reach 1e-14 before rounding ends the descent.
_ZERO = 1e-10
# How little a plant with zeros on the axis is regularised for an estimate: less, and rounding
# decides (the Riccati solutions hold 1 / _HARDLY^2). By how much the axis is moved for another:
# less than the poles of weights, 1e-5, and more than rounding moves double zeros, 1e-8.
_HARDLY, _BESIDE = 1e-6, 1e-6


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
    guess = estimated_lower_bound(plant, tolerance, budget)
    if plant.nx <= PROVABLE_STATES:
        proven = proven_lower_bound(plant, 1.0 if guess is None else guess.value, tolerance)
        return LowerBound(proven, PROVEN, bracket=guess and guess.bracket)
    return guess


def estimated_lower_bound(
    plant: PlantMatrices, tolerance: float, budget: Budget
) -> LowerBound | None:
    """Estimate the infimum in double precision, as :func:`lower_bound` without its proof."""

    def infimum(of: PlantMatrices, equations: Any = riccati_pair) -> GammaBracket | None:
        halves = equations(of)
        return None if halves is None else search_gamma(halves, 1.0, tolerance, budget)

    regular = has_full_rank(plant)
    found = [infimum(plant)]
    if not regular or found == [None]:
        # Zeros on the axis are the commonest reason to fail; with it moved they lie beside it.
        found.append(infimum(shifted(plant, -_BESIDE)))
    known = [bracket.lower for bracket in found if bracket is not None]
    how = "estimated by Riccati equations in double precision"
    if known:
        return LowerBound(min(known), how, False, found[0] if regular else None)
    bracket = infimum(regularise(plant, _HARDLY), reduced_riccati_pair)
    how += f" of a plant with a price and a noise of {_HARDLY:.0e}"
    return None if bracket is None else LowerBound(bracket.lower, how, False)


def riccati_pair(plant: PlantMatrices) -> RiccatiPair | None:
    """Return the two equations of a plant, reduced where D12 or D21 lacks rank."""
    return normalise(plant).halves if has_full_rank(plant) else reduced_riccati_pair(plant)


def is_out_of_reach(plant: PlantMatrices, gamma: float) -> bool:
    """Tell whether the equations of a plant have no solution in doubles for a norm."""
    halves = riccati_pair(plant)
    return halves is not None and not halves.attempt(gamma).feasible


def search_gamma(
    halves: RiccatiPair,
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
    halves : RiccatiPair
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

    def attempt(gamma: float) -> Attempt:
        budget.spend(step_cost(halves.states))
        return halves.attempt(gamma)

    def width() -> float:
        return float(np.log(upper / max(lower, upper * 1e-12)))

    if known is None:
        # Gamma is raised until both equations can be solved.
        floor = halves.floor
        lower, upper = floor, max(start, floor * (1 + 1e-6))
        for count in range(1, _MOST_STEPS):  # noqa: B007
            best = attempt(upper)
            if best.feasible:
                break
            # Above the optimum the coupling is smaller, so that it is an upper bound here.
            growth = _GROWTH if best.coupling is None else best.coupling / upper * 1.05
            lower, upper = upper, upper * min(_GROWTH, growth)
            if budget.over or not np.isfinite(upper):
                return None
        else:
            return None
        lower = max(lower, best.coupling or 0.0)
    else:
        upper, lower, best, count = known
    if shortcut and lower < upper * (1 - shortcut) and not budget.over:
        gamma = upper * (1 - shortcut)
        found = attempt(gamma)
        count += 1
        if not found.feasible:
            return GammaBracket(upper, max(lower, gamma), best, count)
        upper, best = gamma, found
        lower = max(lower, best.coupling or 0.0)
    points = [(upper, (best.coupling or 0.0) - upper)]
    zero = upper * _ZERO
    halve = True
    while upper > max(lower * (1 + tolerance), zero) and count < _MOST_STEPS and not budget.over:
        before = width()
        guess = None if halve else _secant(points, lower, upper, tolerance)
        # Halve the bracket on the logarithmic scale, or drop far if nothing is known below.
        middle = upper * max(np.sqrt(lower / upper), _DROP)
        trial = middle if guess is None else guess
        found = attempt(trial)
        count += 1
        if found.feasible:
            upper, best = trial, found
            lower = max(lower, found.coupling or 0.0)
        else:
            lower = max(lower, trial)
        if found.coupling is not None:
            points.append((trial, found.coupling - trial))
        halve = width() > 0.5 * before
    return GammaBracket(upper, lower, best, count)


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
