"""Descent on the true norms of a loop with a structured controller.

Everything here works on plain matrices: a :class:`PlantMatrices` closes a plant with a
constant matrix K, the measures (norms, spectral abscissa, gain, regions) return values
with gradients over K, a parametrisation maps free numbers to K, and two descents use
them: BFGS for functions that are smooth almost everywhere, and a bundle method that
sees all active peaks at once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.arrays import AnyVector, Array, Vector
from robustpolish.base.budget import Budget, step_cost

# Maps from free numbers to the constant matrix K of a loop, with their adjoints.


class Parametrisation(Protocol):
    """K as a function of a vector theta."""

    @property
    def size(self) -> int:
        """Number of free numbers."""
        ...

    def gain(self, theta: Vector) -> Matrix:
        """Return K(theta)."""
        ...

    def back(self, theta: Vector, gradient: Matrix) -> Vector:
        """Turn a gradient over K into one over theta."""
        ...


@dataclass(frozen=True, eq=False)
class MaskedGain:
    """K with free entries where the mask is true and zeros elsewhere.

    Attributes
    ----------
    mask : ndarray of bool, shape (rows, columns)
    """

    mask: NDArray[np.bool_]

    @property
    def size(self) -> int:
        """Number of free numbers."""
        return int(self.mask.sum())

    def gain(self, theta: Vector) -> Matrix:
        """Return K(theta)."""
        K = np.zeros(self.mask.shape)
        K[self.mask] = theta
        return K

    def back(self, theta: Vector, gradient: Matrix) -> Vector:
        """Turn a gradient over K into one over theta."""
        return gradient[self.mask]

    def coordinates(self, K: Matrix) -> Vector:
        """Return the theta whose gain is nearest to K."""
        return K[self.mask]

    def restricted(self, left: Matrix, right: Matrix, target: Matrix) -> AffineGain | None:
        """Keep only gains with left K right = target; None if there is none."""
        rows = np.array([np.outer(left[:, i], right[j]).ravel() for i, j in np.argwhere(self.mask)])
        rows = rows.reshape(self.size, target.size).T
        missing = target.ravel()
        theta = np.linalg.lstsq(rows, missing, rcond=None)[0]
        scale = np.linalg.norm(rows) * np.linalg.norm(theta) + np.linalg.norm(target)
        if np.linalg.norm(rows @ theta - missing) > 1e-9 * scale:
            return None
        _, values, vt = np.linalg.svd(rows)
        rank = int(np.sum(values > 1e-12 * values.max(initial=0.0)))
        return AffineGain(self, theta, vt[rank:])


@dataclass(frozen=True, eq=False)
class AffineGain:
    """The free entries of a masked gain on an affine subspace.

    Attributes
    ----------
    inner : MaskedGain
    origin : ndarray, shape (m,)
        One point of the subspace.
    basis : ndarray, shape (n, m)
        Orthonormal rows that span it.
    """

    inner: MaskedGain
    origin: Vector
    basis: Matrix

    @property
    def size(self) -> int:
        """Number of free numbers."""
        return len(self.basis)

    def gain(self, theta: Vector) -> Matrix:
        """Return K(theta)."""
        return self.inner.gain(self.origin + theta @ self.basis)

    def back(self, theta: Vector, gradient: Matrix) -> Vector:
        """Turn a gradient over K into one over theta."""
        return self.basis @ self.inner.back(theta, gradient)

    def coordinates(self, K: Matrix) -> Vector:
        """Return the theta whose gain is nearest to K."""
        return self.basis @ (self.inner.coordinates(K) - self.origin)


@dataclass(frozen=True, eq=False)
class PositiveElements:
    """K = offset + sum of exp(theta_i) times element_i: coefficients that stay positive.

    Attributes
    ----------
    elements : ndarray, shape (n, rows, columns)
    """

    elements: Array

    @property
    def size(self) -> int:
        """Number of free numbers."""
        return len(self.elements)

    def gain(self, theta: Vector) -> Matrix:
        """Return K(theta)."""
        return np.tensordot(np.exp(theta), self.elements, axes=1)

    def back(self, theta: Vector, gradient: Matrix) -> Vector:
        """Turn a gradient over K into one over theta."""
        return np.exp(theta) * np.tensordot(self.elements, gradient, axes=2)


@dataclass(frozen=True, eq=False)
class ObserverGain:
    """K = [[A + B F - L C - L D F, L], [F, 0]], the Luenberger form of (10.63).

    theta holds F, shape (nu, nx), then L, shape (nx, ny), row by row.

    Attributes
    ----------
    A, B, C, D : ndarray
        The plant from u to y.
    """

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix

    @property
    def size(self) -> int:
        """Number of free numbers."""
        return self.B.size + self.C.size

    def split(self, theta: Vector) -> tuple[Matrix, Matrix]:
        """Return F and L."""
        F, L = np.split(theta, [self.B.size])
        return F.reshape(self.B.T.shape), L.reshape(self.C.T.shape)

    def join(self, F: Matrix, L: Matrix) -> Vector:
        """Return theta."""
        return np.concatenate([F.ravel(), L.ravel()])

    def coordinates(self, K: Matrix) -> Vector:
        """Return the theta of a K of this form."""
        nx = len(self.A)
        return self.join(K[nx:, :nx], K[:nx, nx:])

    def gain(self, theta: Vector) -> Matrix:
        """Return K(theta)."""
        F, L = self.split(theta)
        Ak = self.A + self.B @ F - L @ (self.C + self.D @ F)
        return np.block([[Ak, L], [F, np.zeros((len(F), L.shape[1]))]])

    def back(self, theta: Vector, gradient: Matrix) -> Vector:
        """Turn a gradient over K into one over theta."""
        F, L = self.split(theta)
        nx = len(self.A)
        on_a, on_l, on_f = gradient[:nx, :nx], gradient[:nx, nx:], gradient[nx:, :nx]
        back_f = on_f + (self.B - L @ self.D).T @ on_a
        back_l = on_l - on_a @ (self.C + self.D @ F).T
        return self.join(back_f, back_l)


# BFGS with a weak Wolfe line search for functions with kinks (Lewis and Overton, 2013).

Function = Callable[[AnyVector], tuple[float, AnyVector]]


@dataclass(frozen=True, eq=False)
class BfgsResult:
    """Where a descent ended.

    Attributes
    ----------
    point, value : ndarray, float
    reason : str
        "stationary", "stalled", "target", "iterations", "work" or "time".
    """

    point: AnyVector
    value: float
    reason: str


def bfgs(
    function: Function,
    start: AnyVector,
    budget: Budget,
    work: float = 1.0,
    iterations: int = 300,
    target: float = -np.inf,
    tolerance: float = 1e-7,
) -> BfgsResult:
    """Minimise a function that is smooth almost everywhere.

    Parameters
    ----------
    function : callable
        theta -> (value, gradient); the value may be infinite.
    start : ndarray
        A point with a finite value.
    budget : Budget
    work : float
        What one evaluation of the function takes of it.
    iterations : int
        Largest number of steps.
    target : float
        Stop as soon as the value is below it.
    tolerance : float
        Stop when twenty steps together gain less than this.

    Returns
    -------
    BfgsResult
    """

    def counted(point: AnyVector) -> tuple[float, AnyVector]:
        budget.spend(work)
        return function(point)

    def line_search(
        direction: AnyVector, slope: float
    ) -> tuple[AnyVector, float, AnyVector] | None:
        """Bisect for a step that descends and lets the slope rise; the best descent if none."""
        low, high, t = 0.0, np.inf, 1.0
        best: tuple[AnyVector, float, AnyVector] | None = None
        for _ in range(40):
            x_new = x + t * direction
            f_new, g_new = counted(x_new)
            if not f_new <= f + 1e-4 * t * slope:
                high = t
            else:
                best = (x_new, f_new, g_new)
                if g_new @ direction >= 0.5 * slope:
                    return best
                low = t
            t = 0.5 * (low + high) if np.isfinite(high) else 2 * low
            if budget.over:
                break
        return best if best is not None and best[1] < f else None

    x = np.array(start, dtype=float)
    f, g = counted(x)
    H = np.eye(len(x)) / max(1.0, float(np.linalg.norm(g)))
    past, fresh, reason = [f], True, "iterations"
    for _ in range(iterations):
        if f < target:
            reason = "target"
            break
        if budget.over:
            reason = stop_reason(budget)
            break
        direction = -H @ g
        slope = float(g @ direction)
        downhill = np.isfinite(slope) and slope < 0
        step = line_search(direction, slope) if downhill else None
        if step is None:
            if fresh:
                reason = "stalled" if downhill else "stationary"
                break
            H, fresh = np.eye(len(x)) / max(1.0, float(np.linalg.norm(g))), True
            continue
        H = _update(H, step[0] - x, step[2] - g, fresh)
        (x, f, g), fresh = step, False
        past.append(f)
        if len(past) > 20 and past[-21] - f < tolerance:
            reason = "stalled"
            break
    return BfgsResult(x, f, reason)


def stop_reason(budget: Budget) -> str:
    """Return what ended a search whose budget is over: "work" or "time"."""
    return "work" if budget.exhausted else "time"


def _update(H: Array, s: AnyVector, y: AnyVector, first: bool) -> Array:
    """Return the BFGS update of the inverse Hessian, unchanged where curvature is lost."""
    curvature = float(s @ y)
    if not np.isfinite(curvature) or curvature <= 1e-14 * np.linalg.norm(s) * np.linalg.norm(y):
        return H
    if first:
        H = np.eye(len(s)) * curvature / float(y @ y)
    rho = 1 / curvature
    Hy = H @ y
    mixed = np.outer(s, Hy)
    return H - rho * (mixed + mixed.T) + rho * (1 + rho * float(y @ Hy)) * np.outer(s, s)


# Free numbers within bounds for descents that know of none: the line of numbers is folded.

Bounds = tuple[AnyVector, AnyVector]


@dataclass(frozen=True, eq=False)
class ReflectedParametrisation:
    """A parametrisation whose free numbers turn back at their bounds.

    A minimum at a bound becomes one at a kink, which BFGS with a weak Wolfe search finds; a smooth
    change of variables would make every bound stationary instead.

    Attributes
    ----------
    inner : Parametrisation
    bounds : pair of ndarray
        Infinite for none; the lower below the upper.
    """

    inner: Parametrisation
    bounds: Bounds

    @property
    def size(self) -> int:
        """Number of free numbers."""
        return self.inner.size

    def point(self, theta: AnyVector) -> AnyVector:
        """Return where `theta` is folded to."""
        return self._reflected(theta)[0]

    def gain(self, theta: AnyVector) -> Matrix:
        """Return K(theta)."""
        return self.inner.gain(self._reflected(theta)[0])

    def back(self, theta: AnyVector, gradient: Matrix) -> AnyVector:
        """Turn a gradient over K into one over theta."""
        point, slope = self._reflected(theta)
        return slope * self.inner.back(point, gradient)

    def _reflected(self, theta: AnyVector) -> tuple[AnyVector, AnyVector]:
        low, high = self.bounds
        point, slope = np.array(theta, dtype=float), np.ones(len(theta))
        both = np.isfinite(low) & np.isfinite(high)
        if both.any():
            width = (high - low)[both]
            along = np.mod(point[both] - low[both], 2 * width)
            slope[both] = np.where(along <= width, 1.0, -1.0)
            point[both] = low[both] + np.minimum(along, 2 * width - along)
        for bound, sign in ((low, 1.0), (high, -1.0)):
            # Below a lower bound, or above an upper one, where it is the only one.
            out = ~both & np.isfinite(bound) & (sign * (point - bound) < 0)
            point[out], slope[out] = 2 * bound[out] - point[out], -1.0
        return np.clip(point, low, high), slope


# What is minimised, under which requirements, over which free numbers.


@dataclass(frozen=True, eq=False)
class ActivePiece:
    """One smooth piece of a measure: its value and its gradient over K.

    Attributes
    ----------
    value : float
    gradient : ndarray, shape of K
    frequency : float or None
        Where the piece is active, for a norm: rad/s, or rad per sample.
    """

    value: float
    gradient: Matrix
    frequency: float | None = None


class Measure(Protocol):
    """A function of K as the maximum of smooth pieces; no pieces means infinite."""

    @property
    def work(self) -> float:
        """Work of one evaluation: 1 for the H-infinity norm of a small loop."""
        ...

    def pieces(self, K: Matrix, width: float, frequencies: Sequence[float]) -> list[ActivePiece]:
        """Return the pieces within `width` (relative) of the largest, the largest first."""
        ...


@dataclass(frozen=True, eq=False)
class Requirement:
    """measure(K) <= bound as a function that has to be at most 0.

    With r = measure / bound that function is r - 1 up to the bound and log(r) beyond, which is
    smooth, finite at 0 and grows slowly where a start is far off.

    Attributes
    ----------
    measure : Measure
    bound : float or None
        Positive bound of a positive measure; None for a measure that has to be negative.
    """

    measure: Measure
    bound: float | None

    def pieces(self, K: Matrix, width: float, frequencies: Sequence[float]) -> list[ActivePiece]:
        """Return the pieces of the scaled function, which has to be at most 0."""
        found = self.measure.pieces(K, width, frequencies)
        if self.bound is None:
            return found
        scaled = []
        for piece in found:
            ratio = piece.value / self.bound
            value, slope = (ratio - 1, 1.0) if ratio <= 1 else (float(np.log(ratio)), 1 / ratio)
            gradient = piece.gradient * (slope / self.bound)
            scaled.append(ActivePiece(value, gradient, piece.frequency))
        return scaled


def _logarithm(piece: ActivePiece) -> ActivePiece:
    if piece.value <= np.finfo(float).tiny * max(1.0, np.abs(piece.gradient).max(initial=0.0)):
        return ActivePiece(float(np.log(np.finfo(float).tiny)), 0 * piece.gradient, piece.frequency)
    return ActivePiece(float(np.log(piece.value)), piece.gradient / piece.value, piece.frequency)


@dataclass(frozen=True, eq=False)
class Model:
    """Values and gradients over the free numbers at one point.

    Attributes
    ----------
    values, slopes : ndarray, shapes (m,), (m, n)
        Pieces of the objective's logarithm; the largest is the objective.
    frequencies : tuple of float or None
    excess, excess_slopes : ndarray, shapes (p,), (p, n)
        Pieces of the requirements; all have to be at most 0.
    """

    values: Vector
    slopes: Matrix
    frequencies: tuple[float | None, ...]
    excess: Vector
    excess_slopes: Matrix

    @property
    def objective(self) -> float:
        """Logarithm of the objective."""
        return float(self.values.max())

    @property
    def violation(self) -> float:
        """How far the worst requirement is missed; 0 if none is."""
        return float(max(0.0, self.excess.max(initial=0.0)))

    def merit(self, weight: float) -> float:
        """Return the objective with a price on the violation."""
        return self.objective + weight * self.violation


@dataclass(frozen=True, eq=False)
class Problem:
    """Minimise the logarithm of a measure of K(theta) under requirements.

    The logarithm makes every tolerance relative and leaves the minimiser where it is.

    Attributes
    ----------
    parametrisation : Parametrisation
    objective : Measure
    requirements : tuple of Requirement
    ceiling : float
        Gains with a larger entry count as infinitely bad: what they would promise
        could not be verified in double precision.
    """

    parametrisation: Parametrisation
    objective: Measure
    requirements: tuple[Requirement, ...] = ()
    ceiling: float = np.inf

    @cached_property
    def work(self) -> float:
        """Work of one evaluation."""
        return self.objective.work + sum(r.measure.work for r in self.requirements)

    def model(
        self, theta: Vector, width: float = 0.0, frequencies: Sequence[float] = ()
    ) -> Model | None:
        """Evaluate all pieces at `theta`; None where the objective is infinite."""
        K = self.parametrisation.gain(theta)
        if not np.abs(K).max(initial=0.0) <= self.ceiling:
            return None
        found = [_logarithm(p) for p in self.objective.pieces(K, width, frequencies)]
        if not found:
            return None
        excess: list[ActivePiece] = []
        for requirement in self.requirements:
            pieces = requirement.pieces(K, width, frequencies)
            if not pieces:
                return None
            excess.extend(pieces)
        back = self.parametrisation.back
        n = len(theta)
        return Model(
            np.array([p.value for p in found]),
            np.array([back(theta, p.gradient) for p in found]).reshape(len(found), n),
            tuple(p.frequency for p in found),
            np.array([p.value for p in excess]),
            np.array([back(theta, p.gradient) for p in excess]).reshape(len(excess), n),
        )

    def penalised(self, theta: Vector, weight: float) -> tuple[float, Vector]:
        """Objective plus `weight` times the worst violation, with one subgradient."""
        model = self.model(theta)
        if model is None:
            return np.inf, np.zeros_like(theta)
        best = int(np.argmax(model.values))
        value, slope = float(model.values[best]), model.slopes[best]
        if model.violation > 0:
            worst = int(np.argmax(model.excess))
            value += weight * model.violation
            slope = slope + weight * model.excess_slopes[worst]
        return value, slope


# A bundle method that sees all active peaks at once.
#
# Each step solves a quadratic programme over all pieces near the maximum, after Apkarian and
# Noll, "Nonsmooth H-infinity synthesis" (2006): the model is max_i (f_i + g_i d) + d'Hd/2 with
# H a quasi-Newton matrix of the Lagrangian, in a trust region. A rejected step leaves the
# frequency that spoiled it in the model.

# Its type stubs know nothing of what it exports.
clarabel: Any = import_module("clarabel")


def minimax(
    problem: Problem,
    start: AnyVector,
    budget: Budget,
    iterations: int = 200,
    target: float = -np.inf,
    bounds: Bounds | None = None,
    weight: float = 10.0,
) -> BfgsResult:
    """Minimise the largest piece of a problem under its requirements.

    Parameters
    ----------
    problem : Problem
    start : ndarray
        A point with a finite objective; it may violate requirements.
    budget : Budget
        Of evaluations and quadratic programmes.
    iterations : int
        Largest number of quadratic programmes.
    target : float
        Stop when the objective (a logarithm) is below it and nothing is violated.
    bounds : pair of ndarray, optional
        Lower and upper bounds of theta.
    weight : float
        First price of a violated requirement.

    Returns
    -------
    BfgsResult
        Its value is the logarithm of the objective; infinite if a requirement is violated.
    """

    def evaluated(point: AnyVector, known: Sequence[float] = ()) -> Model | None:
        # Looking for all peaks takes twice as long as for the highest. Pieces within a twentieth of
        # the largest enter the model.
        budget.spend(2 * problem.work)
        return problem.model(point, 0.05, known)

    x = np.array(start, dtype=float)
    model = evaluated(x)
    if model is None:
        return BfgsResult(x, np.inf, "stalled")
    if len(x) > _MOST_NUMBERS:
        iterations = 0
    H = np.eye(len(x)) * 1e-3 * max(1e-6, float(np.abs(model.slopes).max()))
    radius = 0.3 * max(1.0, float(np.abs(x).max(initial=0.0)))
    extra: list[float] = []
    kept = (x, model.objective if model.violation == 0 else np.inf)
    reason = "iterations"
    for _ in range(iterations):
        if budget.over:
            reason = stop_reason(budget)
            break
        if model.objective < target and model.violation == 0:
            reason = "target"
            break
        # An interior-point method factorises matrices of this size some ten times.
        budget.spend(step_cost(len(x) // 2))
        step = _quadratic_step(model, x, H, radius, weight, bounds, budget.seconds_left)
        if step is None or step.promise < 1e-8:  # the model promises nothing more
            if model.violation > 1e-6 and weight < 1e6 and step is not None:
                weight *= 10
                continue
            if step is not None and step.inside:
                reason = "stationary"
                break
            radius *= 0.1 if step is None else 3.0
            if not 1e-12 < radius < 1e12:
                reason = "stalled"
                break
            continue
        trial_point = x + step.d
        marked = [w for w in model.frequencies if w is not None]
        trial = evaluated(trial_point, marked[:10])
        if trial is None:
            radius = 0.25 * float(np.abs(step.d).max())
        else:
            y = _lagrangian_change(model, trial, step)
            gain = model.merit(weight) - trial.merit(weight)
            H = _damped(H, step.d, y)
            size = float(np.abs(step.d).max())
            if gain < 0.25 * step.promise:
                radius = 0.3 * size
            elif gain > 0.6 * step.promise and size > 0.9 * radius:
                radius *= 2.5
            if gain > 0.05 * step.promise:
                x, extra = trial_point, []
                model = evaluated(x) or trial
                if model.violation == 0 and model.objective < kept[1]:
                    kept = (x, model.objective)
                continue
            extra = [*extra, *[w for w in trial.frequencies if w is not None][:3]][-12:]
            model = evaluated(x, extra) or model
        if radius < 1e-10 * max(1.0, float(np.abs(x).max())):
            reason = "stalled"
            break
    value = model.objective if model.violation <= 1e-9 else np.inf
    if kept[1] <= value:
        x, value = kept
    return BfgsResult(x, value, reason)


# Beyond this many free numbers one quadratic programme takes longer than many steps of BFGS.
_MOST_NUMBERS = 800


class _Step(NamedTuple):
    d: AnyVector
    promise: float
    weights: AnyVector
    excess_weights: AnyVector
    inside: bool


def _quadratic_step(
    model: Model,
    x: AnyVector,
    H: Matrix,
    radius: float,
    weight: float,
    bounds: Bounds | None,
    seconds: float,
) -> _Step | None:
    """Solve min t + weight s + d'Hd/2 over the linearised pieces in the trust region."""
    n, m, p = len(x), len(model.values), len(model.excess)
    low, high = np.full(n, -radius), np.full(n, radius)
    if bounds is not None:
        low, high = np.maximum(low, bounds[0] - x), np.minimum(high, bounds[1] - x)
    rows = np.zeros((m + p + 1 + 2 * n, n + 2))
    rows[:m, :n], rows[:m, n] = model.slopes, -1
    rows[m : m + p, :n], rows[m : m + p + 1, n + 1] = model.excess_slopes, -1
    rows[m + p + 1 :, :n] = np.vstack([np.eye(n), -np.eye(n)])
    right = np.concatenate([model.objective - model.values, -model.excess, [0.0], high, -low])
    P = np.zeros((n + 2, n + 2))
    P[:n, :n] = np.triu(H)
    q = np.concatenate([np.zeros(n), [1.0, weight]])
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_iter = 60
    settings.time_limit = max(seconds, 1e-3)
    cones = [clarabel.NonnegativeConeT(len(right))]
    matrices = sparse.csc_matrix(P), sparse.csc_matrix(rows)
    solution = clarabel.DefaultSolver(matrices[0], q, matrices[1], right, cones, settings).solve()
    found, duals = np.array(solution.x), np.array(solution.z)
    if not (np.isfinite(found).all() and np.isfinite(duals).all()):
        return None
    d, duals = np.clip(found[:n], low, high), np.maximum(duals, 0.0)
    predicted = float((model.values + model.slopes @ d).max())
    missed = float(max(0.0, (model.excess + model.excess_slopes @ d).max(initial=0.0)))
    promise = model.merit(weight) - (predicted + weight * missed + 0.5 * float(d @ H @ d))
    # Bounds of theta may stay active at a minimum; only the trust region may not.
    inside = bool(np.abs(d).max(initial=0.0) < 0.99 * radius)
    return _Step(d, promise, duals[:m], duals[m : m + p], inside)


def _lagrangian_change(old: Model, new: Model, step: _Step) -> AnyVector:
    """Return the change of the weighted gradient, each peak followed as it moves."""
    change = np.zeros_like(step.d)
    for i in np.flatnonzero(step.weights > 1e-6):
        j = _matching_piece(old, new, int(i))
        change += step.weights[i] * (new.slopes[j] - old.slopes[i])
    for i in np.flatnonzero(step.excess_weights > 1e-6) if len(new.excess) else ():
        apart = np.linalg.norm(new.excess_slopes - old.excess_slopes[i], axis=1)
        j = int(np.argmin(apart))
        change += step.excess_weights[i] * (new.excess_slopes[j] - old.excess_slopes[i])
    return change


def _matching_piece(old: Model, new: Model, i: int) -> int:
    """Find the new piece that continues an old one: near in frequency, then in gradient."""
    place = old.frequencies[i]
    candidates = np.arange(len(new.values))
    if place is not None:
        spots = np.array([np.nan if w is None else w for w in new.frequencies])
        same = np.isinf(spots) if np.isinf(place) else np.abs(spots - place) <= 0.1 * abs(place)
        moved = same & (spots != place)
        pick = moved if moved.any() else same
        if pick.any():
            candidates = candidates[pick]
    apart = np.linalg.norm(new.slopes[candidates] - old.slopes[i], axis=1)
    return int(candidates[np.argmin(apart)])


def _damped(H: Matrix, s: AnyVector, y: AnyVector) -> Matrix:
    """Return Powell's damped BFGS update of the Hessian, which stays positive definite."""
    Hs = H @ s
    sHs = float(s @ Hs)
    if sHs <= 0 or not np.isfinite(y).all():
        return H
    sy = float(s @ y)
    if sy < 0.1 * sHs:
        share = 0.9 * sHs / (sHs - sy)
        y = share * y + (1 - share) * Hs
        sy = float(s @ y)
    updated = H - np.outer(Hs, Hs) / sHs + np.outer(y, y) / sy
    return 0.5 * (updated + updated.T)
