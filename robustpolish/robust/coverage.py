"""An upper bound of the structured singular value that holds between all frequencies."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import flint
import numpy as np

from robustpolish.base.arrays import AnyMatrix, Matrix, Vector
from robustpolish.base.budget import check_deadline
from robustpolish.linear.arithmetic.balls import (
    ball,
    block,
    is_positive_definite,
    joined_rows,
    midpoint,
    precision,
    symmetric,
)
from robustpolish.linear.arithmetic.realisation import Realisation
from robustpolish.robust.loop_model import LoopModel
from robustpolish.robust.scalings import (
    Inequality,
    ScaledBound,
    Space,
    at,
    initial_scalings,
    reduce_level,
)

# What constant scalings prove, in ball arithmetic: at a matrix, and over a range of frequencies.
#
# With constant D and G the inequality holds at one frequency and fails nowhere around it before it
# gets singular, and it is singular at a frequency just if the Hamiltonian matrix has an eigenvalue
# there on the imaginary axis [1]_. Discs that hold all eigenvalues tell how far that is.
#
# References
# ----------
# .. [1] G. Ferreres, J.-F. Magni, J.-M. Biannic, "Robustness analysis of flexible structures:
#    practical algorithms", International Journal of Robust and Nonlinear Control 13 (2003) 715-733.

Ball = Any  # flint.acb_mat; python-flint ships no stubs for it

_BITS = 160
# What the ends of discs are moved outwards, relative, for their rounding to doubles.
_ROUNDING = 1e-14
# Relative length of an interval that is worth eigenvectors of more digits.
_SHORT = 0.1


def complex_ball(matrix: AnyMatrix) -> Ball:
    """Enclose a complex matrix of doubles, exactly."""
    array = np.asarray(matrix, dtype=complex)
    return flint.acb_mat(array.shape[0], array.shape[1], array.ravel().tolist())


def is_definite(matrix: Ball) -> bool:
    """Prove that every Hermitian matrix that a complex ball holds is positive definite."""
    real = flint.arb_mat([[entry.real for entry in row] for row in matrix.tolist()])
    imag = flint.arb_mat([[entry.imag for entry in row] for row in matrix.tolist()])
    return is_positive_definite(symmetric(block([[real, -imag], [imag, real]])))


@dataclass(frozen=True, eq=False)
class BallScalings:
    """Scalings as balls: Dz, G, and beta^2 Dw with the blocks of fixed size as they are."""

    Dz: Ball
    G: Ball
    E: Ball

    @classmethod
    def of(cls, space: Space, x: Vector, level: float) -> BallScalings | None:
        """Return the scalings at a level beta, None if a D is not proven to be positive."""
        Dz, still, scaled, G = space.matrices(x)
        Dz, still, scaled, G = _commuting(space, (Dz, still, scaled, G))
        with precision(_BITS):
            square = flint.acb(flint.arb(level) ** 2)
            E = complex_ball(still) + complex_ball(scaled) * square
            if not (is_definite(complex_ball(Dz)) and is_definite(complex_ball(still + scaled))):
                return None
        return cls(complex_ball(Dz), complex_ball(G), E)


def _commuting(space: Space, matrices: tuple[AnyMatrix, ...]) -> tuple[AnyMatrix, ...]:
    """Make the scalings exactly Hermitian, so that they commute with Delta without rounding."""
    Dz, still, scaled, G = matrices
    wide = G.shape[0] != G.shape[1]
    G = G if wide else (G + np.conj(G.T)) / 2
    return (*((D + np.conj(D.T)) / 2 for D in (Dz, still, scaled)), G)


def proves_inequality(M: Ball, weights: BallScalings) -> bool:
    """Prove the inequality at a matrix."""
    star = M.conjugate().transpose()
    turned = weights.G * M * flint.acb(0, 1)
    return is_definite(weights.E - star * weights.Dz * M - turned - turned.conjugate().transpose())


@dataclass(frozen=True, eq=False)
class ProvenModel:
    """A stable continuous system as balls, for intervals of frequency.

    Attributes
    ----------
    real : tuple of arb_mat
        A, B, C and D: what is proven holds for all that they enclose.
    """

    real: tuple[Ball, Ball, Ball, Ball]

    @classmethod
    def of(cls, model: Realisation) -> ProvenModel:
        """Return a system whose matrices are taken as exact."""
        return cls((ball(model.A), ball(model.B), ball(model.C), ball(model.D)))

    @cached_property
    def _balls(self) -> tuple[Ball, Ball, Ball, Ball]:
        return tuple(flint.acb_mat(M) for M in self.real)  # type: ignore

    def response(self, omega: float) -> Ball:
        """Return M at a frequency, infinity included."""
        A, B, C, D = self._balls
        n = A.nrows()
        if not n or not math.isfinite(omega):
            return D
        shifted = complex_ball(1j * omega * np.eye(n))
        return D + C * (shifted - A).solve(B)

    def interval(self, weights: BallScalings, omega: float) -> tuple[float, float] | None:
        """Prove the inequality around a frequency, as far as it holds.

        Parameters
        ----------
        weights : BallScalings
        omega : float
            In rad/s; infinity is allowed.

        Returns
        -------
        low, high : float
            It holds between, both included; None if it is not proven at `omega`.
        """
        with precision(_BITS):
            try:
                if not proves_inequality(self.response(omega), weights):
                    return None
                if not self.real[0].nrows():
                    return 0.0, math.inf
                H = self._hamiltonian(weights)
                found = _clear(*gershgorin_discs(H, _double_basis(H)), omega)
                if found is None or found[1] - found[0] < _SHORT * found[0]:
                    found = _clear(
                        *gershgorin_discs(H, H.eig(right=True, algorithm="approx")[1]), omega
                    )
                return found
            except (ZeroDivisionError, ValueError, np.linalg.LinAlgError):
                return None

    def _hamiltonian(self, weights: BallScalings) -> Ball:
        A, B, C, D = self._balls
        Dz, G, E = weights.Dz, weights.G, weights.E
        star = [M.conjugate().transpose() for M in (A, B, C, D)]
        turned = G * D * flint.acb(0, 1)
        R = star[3] * Dz * D + turned + turned.conjugate().transpose() - E
        Q = star[2] * Dz * C
        S = star[2] * (Dz * D - G.conjugate().transpose() * flint.acb(0, 1))
        RS, RB = R.solve(S.conjugate().transpose()), R.solve(star[1])
        closed = A - B * RS
        top = (closed, -(B * RB))
        bottom = (-(Q - S * RS), -(closed.conjugate().transpose()))
        return flint.acb_mat(joined_rows([top, bottom]))


def _clear(centres: AnyMatrix, radii: Vector, omega: float) -> tuple[float, float] | None:
    """Return the frequencies around one that no disc touches."""
    near = np.abs(np.real(centres)) <= radii
    reach = radii[near] + _ROUNDING * np.abs(centres[near])
    heights = np.imag(centres)[near]
    low, high = heights - reach, heights + reach
    if not np.isfinite(low).all() or ((low <= omega) & (omega <= high)).any():
        return None
    below, above = high[high < omega], low[low > omega]
    return (
        max(0.0, math.nextafter(float(below.max(initial=-1.0)), math.inf)),
        math.nextafter(float(above.min()), 0.0) if above.size else math.inf,
    )


def gershgorin_discs(H: Ball, basis: Ball) -> tuple[AnyMatrix, Vector]:
    """Return discs that hold all eigenvalues of a matrix, by Gershgorin in a basis."""
    turned = basis.solve(H * basis)
    n = turned.nrows()
    centres = np.diagonal(midpoint(turned)).copy()
    radii = np.zeros(n)
    for i in range(n):
        rest = sum((abs(turned[i, j]) for j in range(n) if j != i), flint.arb(0))
        rest += abs(turned[i, i] - turned[i, i].mid())
        radii[i] = float(rest.abs_upper()) * (1 + _ROUNDING)
    return centres, radii + _ROUNDING * np.abs(centres)


def _double_basis(H: Ball) -> Ball:
    """Return the eigenvectors in double precision: quick, and good enough for most."""
    balanced, units = _balanced(midpoint(H))
    vectors = np.linalg.eig(balanced)[1] * units[:, None]
    return complex_ball(vectors / np.linalg.norm(vectors, axis=0))


def _balanced(H: AnyMatrix) -> tuple[AnyMatrix, Matrix]:
    """Return H in units of its states and co-states that make its halves alike, and the units."""
    n = len(H) // 2
    up, down = np.linalg.norm(H[:n, n:]), np.linalg.norm(H[n:, :n])
    ratio = math.sqrt(up / down) if up > 0 and down > 0 else 1.0
    units = np.concatenate([np.full(n, 1.0), np.full(n, 1 / ratio)])
    return H * units / units[:, None], units


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
    peaks: tuple[tuple[float, float, ScaledBound], ...]


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


class _CoverageState:
    """The state of one coverage: the level so far, and what it was needed for."""

    def __init__(self, loop: LoopModel, space: Space, level: float, slack: float):
        self.model, self.space, self.slack = loop.model, space, slack
        self.level = level * (1 + slack)
        self.proven = ProvenModel(loop.balls)
        self.peaks: list[tuple[float, float, ScaledBound]] = []
        self.last: list[Vector] = []

    def scalings(self, omega: float) -> ScaledBound | None:
        """Return scalings that prove the level at a frequency, or raise the level.

        None where there are none, or where rounding sees a pole at the frequency.
        """
        try:
            gain = response(self.model, omega)
        except np.linalg.LinAlgError:
            return None
        inequality = Inequality(self.space, gain[None])
        starts = [
            initial_scalings(inequality),
            *(at(inequality, ScaledBound(0.0, x)) for x in self.last),
        ]
        start = min(starts, key=lambda level: level.square)
        if not math.isfinite(start.square):
            return None
        found = reduce_level(inequality, start, self.level**2)
        needed = math.sqrt(max(found.square, 0.0))
        if not needed < self.level:
            self.peaks.append((omega, needed, found))
            self.level = needed * (1 + self.slack)
            found = reduce_level(inequality, found, self.level**2)
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
    state = _CoverageState(loop, space, level, slack)
    for omega in dict.fromkeys([0.0, math.inf, *seeds]):
        if state.scalings(omega) is None:
            return Coverage(math.inf, (), False, tuple(state.peaks))
    gaps, intervals, complete = [(0.0, math.inf)], [], True
    rate = loop.rate
    for _ in range(most):
        if not gaps:
            break
        check_deadline()
        low, high = gaps.pop()
        omega = _inside(low, high, rate)
        found = state.scalings(omega)
        interval = None
        if found is not None:
            weights = BallScalings.of(space, found.x, state.level)
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
