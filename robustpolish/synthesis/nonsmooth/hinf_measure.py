"""The H-infinity norm of a loop, all its peaks, and their gradients over K."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.arrays import Vector
from robustpolish.long_calls import step_cost
from robustpolish.synthesis.nonsmooth.problem import ActivePiece
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.static_loop import StaticLoop, close_static

# The level-set search stops when no frequency exceeds the norm by more than this share; the
# design is certified afresh afterwards, so it need not be sharper than the line search.
_RELATIVE_STEP = 1e-8


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
        """Work of one evaluation: its Hamiltonians have twice the loop's states."""
        return step_cost(2 * self.loop.nx)

    def pieces(self, K: Matrix, width: float, frequencies: Sequence[float]) -> list[ActivePiece]:
        """Return the active peaks; nothing if the loop is not stable."""
        closed = close_static(self.loop, K)
        if closed is None or not closed.stable:
            return []
        response = _Response(closed)
        known = [w for w in (*frequencies, *self._recent) if np.isfinite(w)]
        norm, peak = _norm(response, known)
        self._recent[:] = [peak, *self._recent[:2]]
        if norm == 0:
            return [ActivePiece(0.0, np.zeros_like(K), peak)]
        peaks = [peak]
        if width > 0:
            peaks = _distinct([peak, *_local_peaks(response, norm * (1 - width)), *frequencies])
        pieces = [p for w in peaks for p in self._at(response, w, norm * (1 - width))]
        return sorted(pieces, key=lambda piece: -piece.value)

    def _at(self, response: _Response, frequency: float, level: float) -> list[ActivePiece]:
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
        U, sigma, Vh = np.linalg.svd(value, full_matrices=False)
        count = max(1, int(np.sum(sigma >= level)))
        found = []
        for i in range(count):
            slope = np.real(np.outer(U[:, i].conj() @ left, right @ Vh[i].conj()))
            found.append(ActivePiece(float(sigma[i]), closed.back(slope), frequency))
        return found


class _Response:
    """Singular values of one closed loop over frequency, with its level sets."""

    def __init__(self, closed: StaticLoop) -> None:
        self.closed = closed
        self.discrete = closed.plant.discrete
        self.A, self.B, self.C, self.D = _continuous(closed)
        self.feedthrough = float(np.linalg.norm(self.D, 2)) if self.D.any() else 0.0

    def point(self, frequency: float | Vector) -> Any:
        """Return the point of the s plane (or z plane) at a frequency."""
        return np.exp(1j * frequency) if self.discrete else 1j * frequency

    def sigma(self, frequencies: Vector) -> Vector:
        """Largest singular value at each finite frequency."""
        if len(frequencies) == 0:
            return np.zeros(0)
        A, B, C, D = self.closed.A, self.closed.B, self.closed.C, self.closed.D
        points = np.atleast_1d(self.point(frequencies))
        pencils = points[:, None, None] * np.eye(len(A)) - A
        try:
            states = np.linalg.solve(pencils, np.broadcast_to(B, (len(points), *B.shape)))
        except np.linalg.LinAlgError:
            return np.full(len(points), np.inf)
        values = C @ states + D
        adjoint = values.conj().swapaxes(1, 2)
        gram = values @ adjoint if values.shape[1] <= values.shape[2] else adjoint @ values
        if gram.shape[1] == 1:
            return np.sqrt(gram[:, 0, 0].real)
        return np.sqrt(np.maximum(np.linalg.eigvalsh(gram)[:, -1], 0.0))

    def crossings(self, level: float) -> Vector:
        """Frequencies at which a singular value equals `level`, increasing."""
        A, B, C, D = self.A, self.B, self.C, self.D
        R = level**2 * np.eye(D.shape[1]) - D.T @ D
        S = level**2 * np.eye(D.shape[0]) - D @ D.T
        try:
            RB = np.linalg.solve(R, np.hstack([D.T @ C, B.T]))
            SC = np.linalg.solve(S, C)
        except np.linalg.LinAlgError:
            return np.zeros(0)
        n = len(A)
        F = A + B @ RB[:, :n]
        hamiltonian = np.block(
            [[F, level * (B @ RB[:, n:])], [-level * (C.T @ SC), -F.T]],
        )
        if not np.isfinite(hamiltonian).all():
            return np.zeros(0)
        values = np.linalg.eigvals(hamiltonian)
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


def _continuous(closed: StaticLoop) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    """Map a discrete loop to a continuous one with the same norm (z = (1 + s)/(1 - s))."""
    A, B, C, D = closed.A, closed.B, closed.C, closed.D
    if not closed.plant.discrete:
        return A, B, C, D
    shifted = A + np.eye(len(A))
    X = np.linalg.solve(shifted, np.hstack([A - np.eye(len(A)), B]))
    n = len(A)
    Y = np.linalg.solve(shifted.T, C.T).T
    return X[:, :n], np.sqrt(2) * X[:, n:], np.sqrt(2) * Y, D - C @ X[:, n:]


def _norm(response: _Response, guesses: Sequence[float]) -> tuple[float, float]:
    """Return the norm and its frequency: level sets of Bruinsma and Steinbuch (1990)."""
    frequencies = np.unique(np.concatenate([response.start(), np.asarray(guesses, float)]))
    values = response.sigma(frequencies)
    best = int(np.argmax(values))
    norm, peak = float(values[best]), float(frequencies[best])
    if response.feedthrough > norm:
        norm, peak = response.feedthrough, (np.pi if response.discrete else np.inf)
    if norm == 0:
        return norm, peak
    hills = frequencies[_hills(values)]
    for _ in range(40):
        better = _exceeding(response, norm)
        if better is None:
            near = [peak, *hills] if np.isfinite(peak) else list(hills)
            better = _around(response, norm, np.array(near))
        if better is None:
            break
        norm, peak = better
    return norm, peak


def _hills(values: Vector) -> NDArray[np.intp]:
    """Return the local maxima within a twentieth of the largest value, three at most."""
    padded = np.concatenate([[-np.inf], values, [-np.inf]])
    local = (values >= padded[:-2]) & (values >= padded[2:])
    near = np.flatnonzero(local & (values >= 0.95 * values.max(initial=0.0)))
    return near[np.argsort(-values[near])][:3]


def _exceeding(response: _Response, norm: float) -> tuple[float, float] | None:
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


def _around(response: _Response, norm: float, places: Vector) -> tuple[float, float] | None:
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


def _highest(response: _Response, norm: float, places: Vector) -> tuple[float, float] | None:
    """Return the best of some frequencies if it exceeds `norm` noticeably."""
    values = response.sigma(places)
    best = int(np.argmax(values))
    if not values[best] > norm * (1 + _RELATIVE_STEP):
        return None
    return float(values[best]), float(places[best])


def _local_peaks(response: _Response, level: float) -> list[float]:
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
        grid = low[:, None] + (high - low)[:, None] * np.linspace(0, 1, 9)
        values = response.sigma(grid.ravel()).reshape(grid.shape)
        best = np.argmax(values, axis=1)
        rows = np.arange(len(low))
        low, high = grid[rows, np.maximum(best - 1, 0)], grid[rows, np.minimum(best + 1, 8)]
    return [float(w) for w in 0.5 * (low + high)]


def _distinct(frequencies: Sequence[float]) -> list[float]:
    """Drop frequencies that repeat an earlier one within a millionth."""
    kept: list[float] = []
    for w in frequencies:
        if not any(w == k or abs(w - k) <= 1e-6 * abs(k) for k in kept):
            kept.append(w)
    return kept
