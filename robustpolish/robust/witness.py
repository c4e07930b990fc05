"""A Delta that makes I - M Delta singular, as small as a search finds one: a lower bound.

Signals w and z = M w with w = Delta z are sought together with Delta, and with the frequency where
M depends on it. That is a smooth problem, also where all numbers are real and power iterations
fail. The scalings of the upper bound say where to begin: the nearly singular direction of their
inequality is the worst w if the bound is tight.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import control
import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import minimize

from robustpolish.base.arrays import ROUNDING, AnyArray, AnyMatrix, AnyVector, Matrix, Vector
from robustpolish.robust.loop_model import DeltaBlock, DeltaStructure
from robustpolish.robust.scalings import Inequality, ScaledBound

# All-pass interpolation: stable real systems with a given value at one frequency.


def all_pass(value: AnyMatrix, omega: float, step: float = 0.0) -> control.StateSpace:
    """Return a stable real system whose value at a frequency is a matrix of rank one.

    Its largest gain is the norm of the matrix at every frequency: every channel in and out has
    a lag of its own that turns the phase only.

    Parameters
    ----------
    value : ndarray of complex, shape (p, q)
        Of rank one.
    omega : float
        In rad/s, above 0; at 0 and infinity the value has to be real.
    step : float, optional
        Sampling time in s; 0 in continuous time.

    Returns
    -------
    control.StateSpace
    """
    left, sizes, right = np.linalg.svd(value)
    x = math.tan(omega * step / 2) if step else omega
    dt = step or 0
    after, before = (
        control.StateSpace(*_turned_phase(values, x, bool(step)), dt)
        for values in (left[:, 0], right[0])
    )
    middle = np.abs(left[:, 0])[:, None] * float(sizes[0]) @ np.abs(right[0])[None]
    joined = after * control.StateSpace([], [], [], middle, dt) * before
    return control.StateSpace(joined.A, joined.B, joined.C, joined.D, dt)


def _turned_phase(values: AnyVector, x: float, discrete: bool) -> tuple[Matrix, ...]:
    """Return A, B, C and D of a diagonal system: of each entry gain 1 and its phase at x."""
    found: list[tuple[Any, ...]] = []
    for entry in values:
        phase = math.atan2(entry.imag, entry.real)
        # A phase nearer to 0 or 180 degrees is rounding, and a lag for it would be absurdly fast or
        # slow.
        if abs(entry) == 0 or abs(math.sin(phase)) < ROUNDING or not 0 < x < math.inf:
            gain = np.eye(1) * (-1.0 if math.cos(phase) < 0 else 1.0)
            found.append((np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), gain))
            continue
        # (s - a)/(s + a) has a phase between 0 and pi; its negative covers the others.
        sign = 1.0 if phase > 0 else -1.0
        lead = phase if phase > 0 else phase + math.pi
        a = x * math.tan(lead / 2)
        pole = (1 - a) / (1 + a)
        lag = (pole, 1.0, sign * (pole**2 - 1), sign * pole)
        found.append(lag if discrete else (-a, 1.0, -2 * a * sign, sign))
    return tuple(block_diag(*parts) for parts in zip(*found, strict=True))  # pyright: ignore[reportReturnType]


# What is left of w = Delta z, relative, at which a Delta counts as one that makes it singular.
_SOLVED = 1e-10
# By how much a block of size 1 may be larger, for rounding.
_WITHIN = 1e-7
# Of the size that a search begins with, the least that a step may aim at: at 0 all slopes vanish.
_LEAST = 0.03
_NEWTON = 12
# A lower bound at a matrix that is so near the upper one, relative, ends the search.
_NEAR = 1e-4
_ROUNDS = 100

Response = Callable[[float], tuple[AnyMatrix, AnyMatrix]]
"""M and its derivative at an angle, which stands for a frequency."""


@dataclass(frozen=True, eq=False)
class Witness:
    """A Delta and where it makes the loop singular.

    Attributes
    ----------
    size : float
        Largest norm of its blocks that are not fixed.
    deltas : tuple of ndarray of complex
        One copy of each block.
    at : float
        The angle, as :class:`Response` takes it.
    """

    size: float
    deltas: tuple[AnyMatrix, ...]
    at: float

    def matrix(self, structure: DeltaStructure) -> AnyMatrix:
        """Return Delta, all copies included."""
        nz, nw = structure.shape
        whole = np.zeros((nw, nz), complex)
        places = zip(
            structure.blocks, structure.outputs, structure.inputs, self.deltas, strict=True
        )
        for block, w, z, delta in places:
            whole[w, z] = np.kron(np.eye(block.copies), delta)
        return whole


def singular_directions(
    inequality: Inequality, square: float, x: Vector, count: int
) -> list[AnyVector]:
    """Return signals w in which the inequality of a level is nearly singular."""
    matrix = np.tensordot(inequality.coefficients(square * (1 + 1e-6)), x, (1, 0))[0]
    values, vectors = np.linalg.eigh((matrix + np.conj(matrix.T)) / 2)
    floor = 1e-12 * float(np.abs(values).max()) or 1.0  # of a matrix that is zero, any weights do
    weights = 1 / np.sqrt(np.maximum(values, floor))
    random = np.random.default_rng(0)
    found = [vectors[:, 0]]
    for _ in range(count - 1):
        mix = random.standard_normal(len(values)) + 1j * random.standard_normal(len(values))
        # a function of the matrix: eigenvectors alone have any phase
        found.append(vectors @ (weights * (np.conj(vectors.T) @ mix)))
    return found


def worst_delta(inequality: Inequality, level: ScaledBound, count: int) -> Witness | None:
    """Return the smallest Delta of some searches at one matrix, from where its scalings end."""
    space, M = inequality.space, inequality.M[0]
    still, scale = np.zeros_like(M), space.units(level.x)
    best: Witness | None = None
    # Far from all poles a search may leave the range of doubles: it finds nothing then.
    with np.errstate(all="ignore"):
        for w in singular_directions(inequality, level.square, level.x, count):
            found = smallest_delta(
                space.structure, lambda _: (M, still), w, 0.0, False, scale, fixed=space.fixed
            )
            if found and found.size > 0 and (best is None or found.size < best.size):
                best = found
            if best and 1 / best.size >= level.level * (1 - _NEAR):
                break
    return best


def smallest_delta(
    structure: DeltaStructure,
    response: Response,
    w: AnyVector,
    at: float,
    moves: bool,
    scale: Vector,
    deltas: tuple[complex | None, ...] | None = None,
    fixed: tuple[bool, ...] | None = None,
) -> Witness | None:
    """Descend from a signal to a smallest Delta near it.

    Parameters
    ----------
    structure : DeltaStructure
    response : Response
    w : ndarray of complex
        Where to begin.
    at : float
        The angle to begin at.
    moves : bool
        Whether the angle may change.
    scale : ndarray
        Sizes of the signals w that make them comparable.
    deltas : tuple, optional
        Numbers of the scalar blocks to begin with; those that suit w best by default.
    fixed : tuple of bool, optional
        Blocks that may have size 1, and count for nothing; none by default.

    Returns
    -------
    Witness or None
        None if the search does not end at a Delta.
    """
    held = fixed or (False,) * len(structure.blocks)
    if not (np.isfinite(w).all() and w.any()):
        return None
    problem = _SmallestDeltaProblem(structure, response, scale, _turned(w / scale), at, moves, held)

    def constraint(kind: str, both: Callable[[Vector], tuple[Vector, Matrix]]) -> dict[str, Any]:
        return {"type": kind, "fun": lambda v: both(v)[0], "jac": lambda v: both(v)[1]}

    with suppress(np.linalg.LinAlgError):  # of a step that hits a pole
        start = problem.start(deltas)
        if start is None:
            return None
        found = minimize(
            lambda v: (v[-1], problem.unit),
            start,
            jac=True,
            method="SLSQP",
            bounds=[(None, None)] * (len(start) - 1) + [(_LEAST, None)],
            constraints=[constraint("eq", problem.equal), constraint("ineq", problem.less)],
            options={"maxiter": _ROUNDS, "ftol": 1e-11},
        )
        # where many Deltas are nearly as good, the search may end above where it began
        ends = [problem.read(v) for v in (found.x, start) if np.isfinite(v).all()]
        return min(filter(None, ends), key=lambda end: end.size, default=None)
    return None


def _turned(w: AnyVector) -> AnyVector:
    """Return signals of a phase of their own, as eigenvectors come with any; real ones stay real.

    It is taken from a sum with weights that are like no others, so that nothing cancels.
    """
    turn = 1j * np.imag(w).any()
    weights = np.exp(turn * np.arange(1, len(w) + 1) ** 2) / np.sqrt(np.arange(2, len(w) + 2))
    total = complex(weights @ w)
    return w * np.conj(total) / abs(total) if total else w


class _SmallestDeltaProblem:
    """Variables: w (real, imaginary), the free numbers of Delta, the angle, the size k."""

    def __init__(self, structure: DeltaStructure, response: Response, scale: Vector, w: AnyVector,
                 at: float, moves: bool, fixed: tuple[bool, ...]) -> None:  # fmt: skip
        # Equations and inequalities ask for the same.
        self.response = lru_cache(maxsize=1)(response)
        self.structure, self.scale = structure, scale
        self.at, self.moves, self.fixed = at, moves, fixed
        self.w = w / np.linalg.norm(w)
        self.places: list[slice] = []
        first = 2 * len(w)
        for block in structure.blocks:
            count = 1 if block.kind == "real" else 2 * block.rows * block.columns
            count = 0 if self._is_free(block) else count
            self.places.append(slice(first, first + count))
            first += count
        self.count = first + 2
        self.size = 1.0
        self.unit = np.eye(self.count)[-1]

    @staticmethod
    def _is_free(block: DeltaBlock) -> bool:
        """Say whether any w no larger than k z will do: one complex number or full block."""
        return block.kind != "real" and block.copies == 1

    def _largest(self, norms: list[float]) -> float:
        """Return the size of the blocks that are not fixed."""
        sizes = self.structure.sizes(norms)
        return max(size for size, held in zip(sizes, self.fixed, strict=True) if not held)

    def M(self, at: float) -> tuple[AnyMatrix, AnyMatrix]:
        """Return M from scaled w to z, and its derivative."""
        M, slope = self.response(at)
        return M * self.scale, slope * self.scale

    def start(self, deltas: tuple[complex | None, ...] | None) -> Vector | None:
        M, _ = self.M(self.at)
        z, v = M @ self.w, np.zeros(self.count)
        v[: 2 * len(self.w)] = np.concatenate([self.w.real, self.w.imag])
        v[-2] = self.at
        sizes = []
        w = self.w * self.scale
        for k, block in enumerate(self.structure.blocks):
            wk, zk = w[self.structure.outputs[k]], z[self.structure.inputs[k]]
            power = np.linalg.norm(zk) ** 2
            if not power > 0:
                if deltas is None:
                    return None
                power = 1.0
            if self._is_free(block):
                sizes.append(float(np.linalg.norm(wk) / np.sqrt(power)))
                continue
            W = wk.reshape(block.copies, block.rows)
            Z = zk.reshape(block.copies, block.columns)
            delta = np.linalg.lstsq(Z, W, rcond=None)[0].T
            given = None if deltas is None else deltas[k]
            if given is not None:
                delta = np.array([[given]], complex)
            delta = np.real(delta) if block.kind == "real" else delta
            parts = [delta] if block.kind == "real" else [np.real(delta), np.imag(delta)]
            v[self.places[k]] = np.concatenate([part.ravel() for part in parts])
            sizes.append(float(np.linalg.norm(delta, 2)))
        self.size = self._largest(sizes) or 1.0
        for place in self.places:
            v[place] /= self.size
        v[-1] = 1.0
        return v if np.isfinite(v).all() else None

    def parts(self, v: Vector) -> tuple[AnyVector, AnyVector, AnyVector, AnyMatrix]:
        n = len(self.w)
        w = v[:n] + 1j * v[n : 2 * n]
        M, slope = self.M(float(v[-2]) if self.moves else self.at)
        return w, M @ w, slope @ w, M

    def delta(self, v: Vector, k: int) -> AnyMatrix:
        block = self.structure.blocks[k]
        values = v[self.places[k]] * self.size
        if block.kind == "real":
            return values.reshape(1, 1).astype(complex)
        half = len(values) // 2
        return (values[:half] + 1j * values[half:]).reshape(block.rows, block.columns)

    def equal(self, v: Vector) -> tuple[Vector, Matrix]:
        """Return w - Delta z of what is not free, the norm of w and its phase; with slopes."""
        n = len(self.w)
        w, z, turn, M = self.parts(v)
        rows: list[AnyArray] = []
        slopes: list[AnyArray] = []
        for k, block in enumerate(self.structure.blocks):
            if self._is_free(block):
                continue
            out, into = self.structure.outputs[k], self.structure.inputs[k]
            delta = np.kron(np.eye(block.copies), self.delta(v, k))
            units = self.scale[out]
            rows.append((w[out] * units - delta @ z[into]) / units)
            slope = np.zeros((len(units), self.count), complex)
            by_w = np.eye(n)[out] - (delta @ M[into]) / units[:, None]
            slope[:, :n], slope[:, n : 2 * n] = by_w, 1j * by_w
            Z = z[into].reshape(block.copies, block.columns)
            by_delta = np.einsum("cb,ad->cadb", Z, np.eye(block.rows)).reshape(len(units), -1)
            by_delta = -self.size * by_delta / units[:, None]
            if block.kind == "real":
                slope[:, self.places[k]] = by_delta
            else:
                slope[:, self.places[k]] = np.hstack([by_delta, 1j * by_delta])
            if self.moves:
                slope[:, -2] = -(delta @ turn[into]) / units
            slopes.append(slope)
        values = np.concatenate([*rows, np.zeros(0)])
        jac = np.vstack([*slopes, np.zeros((0, self.count))])
        size = np.zeros((2, self.count))
        size[0, :n], size[0, n : 2 * n] = 2 * np.real(w), 2 * np.imag(w)
        size[1, :n], size[1, n : 2 * n] = -self.w.imag, self.w.real
        last = np.array([np.vdot(w, w).real - 1, np.vdot(self.w, w).imag])
        return (
            np.concatenate([np.real(values), np.imag(values), last]).astype(float),
            np.vstack([np.real(jac), np.imag(jac), size]),
        )

    def less(self, v: Vector) -> tuple[Vector, Matrix]:
        """Return what has to be at least 0 for all blocks to be no larger than k; with slopes."""
        n = len(self.w)
        w, z, turn, M = self.parts(v)
        values: list[float] = []
        slopes: list[Vector] = []
        for k, block in enumerate(self.structure.blocks):
            place = self.places[k]
            k_size, by_k = self._may_be(k, v)
            if self._is_free(block):
                out, into = self.structure.outputs[k], self.structure.inputs[k]
                wk, zk = w[out] * self.scale[out], z[into] * self.size
                unit = np.linalg.norm(self.w[out] * self.scale[out]) ** 2 or 1.0
                slope = np.zeros(self.count)
                by_z = np.conj(zk) @ M[into] * self.size * 2 * k_size**2
                by_w = np.zeros(n, complex)
                by_w[out] = 2 * np.conj(wk) * self.scale[out]
                slope[:n], slope[n : 2 * n] = (by_z - by_w).real, (-(by_z - by_w)).imag
                slope[-1] = by_k * 2 * k_size * np.vdot(zk, zk).real
                if self.moves:
                    slope[-2] = 2 * k_size**2 * np.real(np.conj(zk) @ turn[into]) * self.size
                excess = k_size**2 * np.vdot(zk, zk).real - np.vdot(wk, wk).real
                values.append(float(excess / unit))
                slopes.append(slope / unit)
            elif block.group:
                continue
            else:
                if block.kind == "real":
                    found = [(s * float(v[place][0]), np.array([s])) for s in (1.0, -1.0)]
                else:
                    own = self.delta(v, k) / self.size
                    U, sizes, V = np.linalg.svd(own)
                    gradients = [np.outer(U[:, i], V[i]).ravel() for i in range(min(own.shape))]
                    found = [(float(size), np.concatenate([np.real(g), np.imag(g)]))
                             for size, g in zip(sizes, gradients, strict=True)]  # fmt: skip
                for size, gradient in found:
                    slope = np.zeros(self.count)
                    slope[place], slope[-1] = -gradient, by_k
                    values.append(k_size - size)
                    slopes.append(slope)
        for group in self.structure.together:
            k_size, by_k = self._may_be(group[0], v)
            places, slope = [self.places[k].start for k in group], np.zeros(self.count)
            slope[places], slope[-1] = -2 * v[places], by_k * 2 * k_size
            values.append(float(k_size**2 - v[places] @ v[places]))
            slopes.append(slope)
        return np.array(values), np.array(slopes)

    def _may_be(self, k: int, v: Vector) -> tuple[float, float]:
        """Return what a block may be in units of the size that k began with, and its slope by k."""
        return (1 / self.size, 0.0) if self.fixed[k] else (float(v[-1]), 1.0)

    def read(self, v: Vector) -> Witness | None:
        """Solve the equations to the last digits, and read Delta."""
        for _ in range(_NEWTON):
            value, slope = self.equal(v)
            if not np.isfinite(slope).all():
                return None
            if np.abs(value).max() < 1e-15:
                break
            slope = slope.copy()
            slope[:, -1] = 0.0
            v = v - np.linalg.lstsq(slope, value, rcond=1e-12)[0]
        if np.abs(self.equal(v)[0]).max() > _SOLVED:
            return None
        w, z, _, _ = self.parts(v)
        w = w * self.scale
        found = []
        for k, block in enumerate(self.structure.blocks):
            if self._is_free(block):
                wk, zk = w[self.structure.outputs[k]], z[self.structure.inputs[k]]
                power = np.vdot(zk, zk).real
                if not power > 0:
                    return None
                found.append(np.outer(wk, np.conj(zk)) / power)
            else:
                found.append(self.delta(v, k))
        norms = [float(np.linalg.norm(delta, 2)) for delta in found]
        size = self._largest(norms)
        limits = zip(self.structure.sizes(norms), self.fixed, strict=True)
        if any(held and own > 1 + _WITHIN for own, held in limits):
            return None
        at = float(v[-2]) if self.moves else self.at
        return Witness(size, tuple(found), at) if size > 0 else None
