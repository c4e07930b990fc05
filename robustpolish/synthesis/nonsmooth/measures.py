"""Functions of the closed-loop poles, with gradients over K, and the worst of several functions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_continuous_lyapunov, solve_discrete_lyapunov

from robustpolish.base.arrays import SAME, Vector
from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.budget import step_cost
from robustpolish.linear.norms.hinf import cayley
from robustpolish.linear.systems import Realisation, hamiltonian, resolvent_response
from robustpolish.synthesis.nonsmooth.descent import ActivePiece, Measure
from robustpolish.synthesis.problem.matrices import PlantMatrices, StaticLoop, close_static_loop

# Functions of the gain K itself, with gradients over K.


@dataclass(frozen=True, eq=False)
class GainMeasure:
    """Largest singular value of left K right: the gain in the plant's own units.

    Attributes
    ----------
    left, right : ndarray
        Undo the scaling of u and y; zero rows leave parts of K out.
    """

    left: Matrix
    right: Matrix
    # An evaluation takes next to nothing.
    work: float = 0.1

    def pieces(self, K: Matrix, width: float, frequencies: Sequence[float]) -> list[ActivePiece]:
        """Return one piece for each singular value near the largest."""
        factors = np.linalg.svd(self.left @ K @ self.right, full_matrices=False)
        U, sigma, Vh = (np.asarray(M, float) for M in factors)
        found = []
        for i in range(len(sigma)):
            if i > 0 and (width == 0 or sigma[i] < sigma[0] * (1 - width)):
                break
            slope = np.outer(self.left.T @ U[:, i], Vh[i] @ self.right.T)
            found.append(ActivePiece(float(sigma[i]), slope))
        return found


@dataclass(frozen=True, eq=False)
class FrobeniusMeasure:
    """Root of the sum of squares of K."""

    work: float = 0.1

    def pieces(self, K: Matrix, width: float, frequencies: Sequence[float]) -> list[ActivePiece]:
        """Return the one piece."""
        size = float(np.linalg.norm(K))
        return [ActivePiece(size, K / size if size > 0 else np.zeros_like(K))]


# The H2 norm of a loop and its gradient over K.


@dataclass(frozen=True, eq=False)
class H2Measure:
    """H2 norm of the channel w to z; infinite with a feedthrough in continuous time.

    The gradient is that of Rautert and Sachs (1997): with P and Q the Gramians of the loop,
    the derivative of trace(C P C') over K is 2 ((B2' Q A + D12' C) P C2' + (B2' Q B + D12' D) D21')
    with A left out in continuous time.
    """

    loop: PlantMatrices

    @property
    def work(self) -> float:
        """Work of one evaluation: two Lyapunov equations, quicker than level sets."""
        return 0.5 * step_cost(self.loop.nx)

    def pieces(self, K: Matrix, width: float, frequencies: Sequence[float]) -> list[ActivePiece]:
        """Return the one piece; nothing if the loop is not stable or the norm infinite."""
        closed = close_static_loop(self.loop, K)
        if closed is None or not closed.stable:
            return []
        loop, discrete = self.loop, self.loop.discrete
        A, B, C, D = closed.A, closed.B, closed.C, closed.D
        # D counts as far as it is more than what rounding leaves of its terms.
        terms = np.abs(loop.D11) + np.abs(loop.D12) @ np.abs(K) @ np.abs(loop.D21)
        if not discrete and (np.abs(D) > 1e-12 * terms).any():
            return []
        solve = solve_discrete_lyapunov if discrete else solve_continuous_lyapunov
        sign = 1.0 if discrete else -1.0
        try:
            P = np.asarray(solve(A, sign * B @ B.T))
            Q = np.asarray(solve(A.T, sign * C.T @ C))
        except np.linalg.LinAlgError:
            return []
        square = float(np.trace(C @ P @ C.T)) + (float(np.sum(D**2)) if discrete else 0.0)
        if not np.isfinite(square) or square < 0:
            return []
        norm = np.sqrt(square)
        forward, direct = (A, loop.D12.T @ D) if discrete else (np.eye(len(A)), 0.0)
        on_state = (loop.B2.T @ Q @ forward + loop.D12.T @ C) @ P @ loop.C2.T
        on_noise = (loop.B2.T @ Q @ B + direct) @ loop.D21.T
        slope = (on_state + on_noise) / norm if norm > 0 else np.zeros_like(K)
        return [ActivePiece(norm, closed.back(slope))]


# Singular values of one closed loop over frequency, quickly, and where they cross a level.

Complex = NDArray[Any]

# Eigenvectors pay from so many states on: a frequency then takes n instead of n^3 operations. On
# fewer states everything is overhead.
_MODAL_STATES = 12


class LoopResponse:
    """Singular values of one closed loop over frequency, with its level sets.

    Parameters
    ----------
    closed : StaticLoop
        Stable.
    """

    def __init__(self, closed: StaticLoop) -> None:
        self.closed = closed
        self.discrete = closed.plant.discrete
        # Of a discrete loop a continuous one with the same norm.
        self.model = cayley(Realisation(closed.A, closed.B, closed.C, closed.D, self.discrete))
        D = self.model.D
        self.feedthrough = float(np.linalg.norm(D, 2)) if D.any() else 0.0
        self._modal_use: bool | None = None if len(closed.A) >= _MODAL_STATES else False

    def point(self, frequency: float | Vector) -> Any:
        """Return the point of the s plane (or z plane) at a frequency."""
        return np.exp(1j * frequency) if self.discrete else 1j * frequency

    def sigma(self, frequencies: Vector) -> Vector:
        """Largest singular value at each finite frequency; an upper bound far below the largest."""
        if len(frequencies) == 0:
            return np.zeros(0)
        points = np.atleast_1d(self.point(frequencies))
        if self._modal_use is None:
            self._modal_use = self._modal is not None and self._agrees(points)
        return _largest(self._summed(points) if self._modal_use else self._solved(points))

    @cached_property
    def _modal(self) -> tuple[Complex, Complex] | None:
        vectors = self.closed.modes[1]
        try:
            return self.closed.C @ vectors, np.linalg.solve(vectors, self.closed.B + 0j)
        except np.linalg.LinAlgError:
            return None

    def _summed(self, points: Complex) -> Complex:
        """Responses at some points as a sum over modes."""
        assert self._modal is not None
        outputs, inputs = self._modal
        shares = 1.0 / (points[:, None] - self.closed.poles)
        return (outputs * shares[:, None, :]) @ inputs + self.closed.D

    def _solved(self, points: Complex) -> Complex:
        """Responses at some points by linear solves; infinite where one has no solution."""
        loop = self.closed
        return resolvent_response(loop.A, loop.B, loop.C, loop.D, points)

    def _agrees(self, points: Complex) -> bool:
        """Whether modes tell the largest of some responses as a linear solve does."""
        # Eigenvectors that are nearly parallel have inverses that overflow.
        with np.errstate(over="ignore", invalid="ignore"):
            top = points[[int(np.argmax(_largest(self._summed(points))))]]
            summed, solved = self._summed(top), self._solved(top)
            # So far a response from eigenvectors may be from that of a linear solve. Loops with
            # eigenvectors that are nearly parallel are worse, and take linear solves.
            return bool(np.linalg.norm(summed - solved) <= SAME * np.linalg.norm(solved))

    def crossings(self, level: float) -> Vector:
        """Frequencies at which a singular value equals `level`, increasing."""
        H = hamiltonian(self.model, level) if np.isfinite(level * level) else None
        if H is None or not np.isfinite(H).all():
            return np.zeros(0)  # beyond doubles nobody can tell
        values = np.linalg.eigvals(H)
        # A crossing that rounding moved off the axis costs nothing but a look too many.
        near = np.abs(values.real) <= 1e-6 * np.abs(values) + 1e-13 * np.abs(values).max()
        omega = np.unique(np.abs(values[near].imag))
        return 2 * np.arctan(omega) if self.discrete else omega

    def start(self) -> Vector:
        """Frequencies near which peaks are likely."""
        poles = self.closed.poles
        if self.discrete:
            guesses = np.concatenate([np.abs(np.angle(poles)), [0.0, np.pi / 2, np.pi]])
        else:
            guesses = np.concatenate([np.abs(poles), np.abs(poles.imag), [0.0]])
        guesses = np.unique(guesses)
        between = np.sqrt(guesses[1:] * guesses[:-1])
        return np.concatenate([guesses, between, [2 * guesses[-1]]])


def _largest(values: Complex) -> Vector:
    """Return the largest singular value of each of some matrices.

    Of those that are surely far below the largest of all an upper bound will do.
    """
    if not np.isfinite(values).all():
        return np.full(len(values), np.inf)
    unit = float(np.abs(values).max(initial=0.0)) or 1.0  # squares may leave doubles
    found = np.linalg.norm(values / unit, axis=(1, 2))
    if min(values.shape[1:]) > 1:
        top = np.linalg.norm(values[int(np.argmax(found))] / unit, 2)
        near = found >= _FAR * top
        found[near] = np.linalg.svd(values[near] / unit, compute_uv=False)[:, 0]
    return unit * found


# Peaks are asked for within a twentieth of the highest; this leaves room.
_FAR = 0.9


# The highest peak of a loop's singular values over frequency, and all others near it.

# The level-set search stops when no frequency exceeds the norm by more than this share; the
# design is certified afresh afterwards, so it need not be sharper than the line search.
_RELATIVE_STEP = 1e-8


def highest_peak(response: LoopResponse, guesses: Sequence[float]) -> tuple[float, float]:
    """Return the norm and its frequency: level sets of Bruinsma and Steinbuch (1990)."""
    frequencies = np.unique(np.concatenate([response.start(), np.asarray(guesses, float)]))
    values = response.sigma(frequencies)
    best = int(np.argmax(values))
    norm, peak = float(values[best]), float(frequencies[best])
    if response.feedthrough > norm:
        norm, peak = response.feedthrough, (np.pi if response.discrete else np.inf)
    if norm == 0:
        return norm, peak
    hills = frequencies[_local_maxima(values)]
    for _ in range(40):
        better = _exceeding(response, norm)
        if better is None:
            near = [peak, *hills] if np.isfinite(peak) else list(hills)
            better = _near_poles(response, norm, np.array(near))
        if better is None:
            break
        norm, peak = better
    return norm, peak


def local_peaks(response: LoopResponse, level: float) -> list[float]:
    """Return a frequency of a local maximum in each interval above `level`."""
    edges = response.crossings(level)
    if len(edges) == 0:
        return []
    last = np.pi if response.discrete else edges[-1]
    edges = np.unique(np.concatenate([[0.0], edges, [last]]))
    low, high = edges[:-1], edges[1:]
    above = response.sigma(0.5 * (low + high)) > level
    low, high = low[above], high[above]
    for _ in range(6):
        if len(low) == 0:
            break
        low, high = _narrowed(response, low, high)
    return [float(w) for w in 0.5 * (low + high)]


def _narrowed(response: LoopResponse, low: Vector, high: Vector) -> tuple[Vector, Vector]:
    """Return a quarter of each interval around the largest value on a grid of nine points."""
    grid = low[:, None] + (high - low)[:, None] * np.linspace(0, 1, 9)
    values = response.sigma(grid.ravel()).reshape(grid.shape)
    best, rows = np.argmax(values, axis=1), np.arange(len(low))
    return grid[rows, np.maximum(best - 1, 0)], grid[rows, np.minimum(best + 1, 8)]


def _local_maxima(values: Vector) -> NDArray[np.intp]:
    """Return the local maxima within a twentieth of the largest value, three at most."""
    padded = np.concatenate([[-np.inf], values, [-np.inf]])
    local = (values >= padded[:-2]) & (values >= padded[2:])
    near = np.flatnonzero(local & (values >= 0.95 * values.max(initial=0.0)))
    return near[np.argsort(-values[near])][:3]


def _exceeding(response: LoopResponse, norm: float) -> tuple[float, float] | None:
    """Find a frequency above `norm` among the level sets a little above it.

    Near the feedthrough the Hamiltonian is close to singular and hides crossings, so
    that a higher level is asked as well.
    """
    close = norm < 1.01 * response.feedthrough
    for step in (_RELATIVE_STEP, 1e-6, 1e-4) if close else (_RELATIVE_STEP,):
        edges = response.crossings(norm * (1 + step))
        if len(edges) == 0:
            continue
        found = _highest(response, norm, np.concatenate([0.5 * (edges[1:] + edges[:-1]), edges]))
        if found is not None:
            return found
    return None


def _near_poles(response: LoopResponse, norm: float, places: Vector) -> tuple[float, float] | None:
    """Look around some frequencies, on the scale of the nearest pole.

    Rounding in the Hamiltonian of a loop with large gains can hide a peak that ties.
    """
    poles = response.closed.poles
    if len(poles) == 0 or len(places) == 0:
        return None
    points = np.atleast_1d(response.point(places))
    scale = np.abs(points[:, None] - poles).min(axis=1)
    offsets = (scale[:, None] * _OFFSETS).ravel()
    return _highest(response, norm, np.abs(np.repeat(places, len(_OFFSETS)) + offsets))


_OFFSETS = np.outer([-1, 1], [1e-4, 1e-3, 1e-2, 0.1, 0.5]).ravel()


def _highest(response: LoopResponse, norm: float, places: Vector) -> tuple[float, float] | None:
    """Return the best of some frequencies if it exceeds `norm` noticeably."""
    values = response.sigma(places)
    best = int(np.argmax(values))
    if not values[best] > norm * (1 + _RELATIVE_STEP):
        return None
    return float(values[best]), float(places[best])


# The H-infinity norm of a loop, all its peaks, and their gradients over K.


@dataclass(frozen=True, eq=False)
class HinfMeasure:
    """Largest singular value over frequency of the channel w to z of a loop.

    Frequencies are those of the loop: rad/s, or rad per sample in discrete time; infinity
    stands for the feedthrough in continuous time.
    """

    loop: PlantMatrices
    # The last peaks are good guesses for the next.
    _recent: list[float] = field(default_factory=list, init=False, repr=False)

    @property
    def work(self) -> float:
        """Work of one evaluation, as measured: states make modes and level sets, signals values."""
        signals = min(self.loop.nw, self.loop.nz)
        return step_cost(round(1.2 * self.loop.nx)) * (1 + signals / 20)

    def pieces(self, K: Matrix, width: float, frequencies: Sequence[float]) -> list[ActivePiece]:
        """Return the active peaks; nothing if the loop is not stable."""
        closed = close_static_loop(self.loop, K)
        if closed is None or not closed.stable:
            return []
        response = LoopResponse(closed)
        known = [w for w in (*frequencies, *self._recent) if np.isfinite(w)]
        norm, peak = highest_peak(response, known)
        self._recent[:] = [peak, *self._recent[:2]]
        if norm == 0:
            return [ActivePiece(0.0, np.zeros_like(K), peak)]
        peaks = [peak]
        if width > 0:
            peaks = _distinct([peak, *local_peaks(response, norm * (1 - width)), *frequencies])
        pieces = [p for w in peaks for p in self._at(response, w, norm * (1 - width))]
        return sorted(pieces, key=lambda piece: -piece.value)

    def _at(self, response: LoopResponse, frequency: float, level: float) -> list[ActivePiece]:
        """Return one piece for each singular value above `level` at one frequency."""
        closed, loop = response.closed, self.loop
        if np.isinf(frequency):
            left, right, value = loop.D12, loop.D21, closed.D
        else:
            pencil = response.point(frequency) * np.eye(len(closed.A)) - closed.A
            into = np.linalg.solve(pencil, closed.B)
            outof = np.linalg.solve(pencil.T, closed.C.T).T
            value = closed.C @ into + closed.D
            left = outof @ loop.B2 + loop.D12
            right = loop.C2 @ into + loop.D21
        if not np.isfinite(value).all():  # beyond doubles there are no directions
            return []
        U, sigma, Vh = np.linalg.svd(value, full_matrices=False)
        count = max(1, int(np.sum(sigma >= level)))
        found = []
        for i in range(count):
            slope = np.real(np.outer(U[:, i].conj() @ left, right @ Vh[i].conj()))
            found.append(ActivePiece(float(sigma[i]), closed.back(slope), frequency))
        return found


def _distinct(frequencies: Sequence[float]) -> list[float]:
    """Drop frequencies that repeat an earlier one within a millionth."""
    kept: list[float] = []
    for w in frequencies:
        if not any(w == k or abs(w - k) <= 1e-6 * abs(k) for k in kept):
            kept.append(w)
    return kept


def norm_measure(loop: PlantMatrices, norm: str) -> Measure:
    """Return the norm of a loop; of its states where no disturbance reaches any output."""
    if not (loop.nw and loop.nz):
        one, D12, D21 = np.eye(loop.nx), np.zeros((loop.nx, loop.nu)), np.zeros((loop.ny, loop.nx))
        loop = loop.replace(B1=one, C1=one, D11=0 * one, D12=D12, D21=D21)
    return HinfMeasure(loop) if norm == "hinf" else H2Measure(loop)


# Distance of one pole from its region (negative inside), and the derivative of the
# distance over the pole's real and imaginary part, packed as a complex number.
Distance = Callable[[complex], tuple[float, complex]]


@dataclass(frozen=True, eq=False)
class RegionMeasure:
    """Largest distance of the closed-loop poles from a region; negative inside.

    Attributes
    ----------
    loop : PlantMatrices
    distance : callable
        pole -> (distance, derivative over real part + 1j times that over imaginary part).
    scale : float
        What distances are divided by, to be without a unit.
    """

    loop: PlantMatrices
    distance: Distance
    scale: float = 1.0

    @property
    def work(self) -> float:
        """Work of one evaluation: eigenvalues are a small part of that of a norm."""
        return 0.1 * step_cost(self.loop.nx)

    def pieces(self, K: Matrix, width: float, frequencies: Sequence[float]) -> list[ActivePiece]:
        """Return one piece for each pole (pair) near the worst."""
        closed = close_static_loop(self.loop, K)
        if closed is None or not np.isfinite(closed.A).all():
            return []
        found = np.linalg.eig(closed.A)
        values, right = np.asarray(found[0], complex), np.asarray(found[1], complex)
        try:
            left = np.linalg.inv(right)
        except np.linalg.LinAlgError:
            left = np.linalg.pinv(right)
        marks = [self.distance(complex(v)) for v in values]
        sizes = np.array([mark[0] for mark in marks]) / self.scale
        worst = sizes.max()
        pieces = []
        for i in np.argsort(-sizes):
            if np.imag(values[i]) < 0 or sizes[i] < worst - width:
                continue
            into, outof = left[i] @ self.loop.B2, self.loop.C2 @ right[:, i]
            slope = (np.conj(marks[i][1]) * np.outer(into, outof)).real / self.scale
            pieces.append(ActivePiece(float(sizes[i]), closed.back(slope)))
            if width == 0:
                break
        return pieces


@dataclass(frozen=True, eq=False)
class StabilityMeasure(RegionMeasure):
    """Spectral abscissa, or in discrete time the spectral radius less one."""

    @classmethod
    def of(cls, loop: PlantMatrices, scale: float = 1.0) -> StabilityMeasure:
        """Measure how far the poles are inside the stable region."""

        def abscissa(pole: complex) -> tuple[float, complex]:
            return pole.real, 1.0 + 0j

        def radius(pole: complex) -> tuple[float, complex]:
            size = abs(pole)
            return size - 1, pole / size if size > 0 else 1.0 + 0j

        return cls(loop, radius if loop.discrete else abscissa, scale)


@dataclass(frozen=True, eq=False)
class MaxMeasure:
    """The largest of several measures; infinite where one of them is."""

    measures: tuple[Measure, ...]

    @property
    def work(self) -> float:
        """Work of one evaluation: of all of them."""
        return sum(measure.work for measure in self.measures)

    def pieces(self, K: Matrix, width: float, frequencies: Sequence[float]) -> list[ActivePiece]:
        """Return the pieces of all measures, the largest first."""
        found = [measure.pieces(K, width, frequencies) for measure in self.measures]
        if not all(found):
            return []
        return sorted((p for pieces in found for p in pieces), key=lambda piece: -piece.value)
