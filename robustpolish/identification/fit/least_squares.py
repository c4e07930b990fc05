"""Bounded Levenberg-Marquardt steps on prediction errors, and how well the numbers are known."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np
import xarray as xr

from robustpolish.arrays import Array
from robustpolish.identification.fit.parameters import FreeParameter
from robustpolish.identification.observer.run import RecordRun, Runner, Start, StartedPiece
from robustpolish.models.mechanical import MechanicalModel

_STEP = 1e-5
# Relative fall of the cost below which a fit stops.
_SETTLED = 1e-3


@dataclass(frozen=True, eq=False)
class Fit:
    """What a fit ended with.

    Attributes
    ----------
    model : MechanicalModel
    pieces : tuple of StartedPiece
        With fitted starts.
    cost : float
        Half the sum of squares, priors included; errors over `sigma`.
    errors : ndarray, shape (samples, ny)
        Prediction errors of all pieces, in the outputs' units.
    sigma : ndarray, shape (ny,)
        Weights of the outputs.
    information : ndarray, shape (p, p)
        J'J of the parameters with the starts eliminated, priors included, in scaled units.
    free : sequence of FreeParameter
    """

    model: MechanicalModel
    pieces: tuple[StartedPiece, ...]
    cost: float
    errors: Array
    sigma: Array
    information: Array = field(default_factory=lambda: np.zeros((0, 0)))
    free: Sequence[FreeParameter] = ()

    @property
    def rmse(self) -> Array:
        """Root mean square error of each output."""
        return np.sqrt(np.mean(self.errors**2, axis=0))


class Residuals:
    """Maps scaled parameters and starts to weighted prediction errors.

    Parameters
    ----------
    model : MechanicalModel
    pieces : sequence of StartedPiece
    runner : Runner
        Runs the models that are tried.
    free : sequence of FreeParameter
    start_sizes : ndarray, shape (n,), optional
        Sizes of the states, if the starts are fitted too.
    """

    def __init__(
        self,
        model: MechanicalModel,
        pieces: Sequence[StartedPiece],
        runner: Runner,
        free: Sequence[FreeParameter],
        start_sizes: Array | None = None,
    ) -> None:
        self.model, self.pieces, self.runner = model, tuple(pieces), runner
        self.free, self.start_sizes = list(free), start_sizes
        self.offsets = np.cumsum([0, *(p.record.samples for p in pieces)])
        self.scale = np.array([f.scale for f in free])
        self.lower = np.array([f.lower for f in free]) / self.scale
        self.upper = np.array([f.upper for f in free]) / self.scale
        self.prior = np.array([f.scale / f.prior for f in free])
        self.centre = np.array([f.centre / f.scale for f in free])

    def model_at(self, x: Array) -> MechanicalModel:
        """Return the model with scaled parameters x."""
        keys = (f.key for f in self.free)
        return self.model.with_parameters(dict(zip(keys, (x * self.scale).tolist(), strict=True)))

    def run_at(self, x: Array) -> RecordRun:
        """Return the model with scaled parameters x, ready to run."""
        return self.runner.run(self.model_at(x))

    def errors(self, x: Array, starts: Sequence[Start]) -> Array:
        """Return the prediction errors, in the outputs' units."""
        run = self.run_at(x)
        pieces = zip(self.pieces, starts, strict=True)
        return np.vstack([run.errors(StartedPiece(p.record, start)) for p, start in pieces])

    def column(self, x: Array, starts: Sequence[Start], errors: Array, j: int) -> Array:
        """Return the derivative of the errors to scaled parameter j."""
        h = _STEP * max(abs(x[j]), 1.0)
        if x[j] + h > self.upper[j]:
            h = -h
        moved = x.copy()
        moved[j] += h
        return (self.errors(moved, starts) - errors) / h

    def start_block(self, run: RecordRun, start: Start, errors: Array, i: int) -> Array:
        """Return the derivative of piece i's errors to its scaled start."""
        here = errors[self.offsets[i] : self.offsets[i + 1]]
        vector = start.vector
        block = np.empty((here.size, vector.size))
        for j, size in enumerate([] if self.start_sizes is None else self.start_sizes):
            moved = vector.copy()
            moved[j] += 1e-4 * size
            piece = StartedPiece(self.pieces[i].record, start.with_vector(moved))
            block[:, j] = (run.errors(piece) - here).ravel() / 1e-4
        return block


def fit(
    residuals: Residuals,
    iterations: int = 8,
    progress: Callable[[], None] | None = None,
) -> Fit:
    """Minimise the weighted prediction errors.

    Parameters
    ----------
    residuals : Residuals
    iterations : int
        Most accepted or refused steps.
    progress : callable, optional
        Called after every step.
    """
    free = residuals.free
    x = np.clip([f.start / f.scale for f in free], residuals.lower, residuals.upper)
    x = np.asarray(x, dtype=float)
    starts = [piece.start for piece in residuals.pieces]
    errors = residuals.errors(x, starts)
    sigma = _weights(errors, np.ones(errors.shape[1]))
    cost = _cost(residuals, x, errors, sigma)
    damping, information = 1e-3, np.zeros((len(free), len(free)))
    # Where only priors speak, damped steps hardly move: a free run ends with a step undamped.
    settles = bool(free) and residuals.runner.level.free
    settling = False
    for number in range(iterations + settles):
        if not np.isfinite(cost):
            break
        # priors count against the noise that is left, not against the error at the start
        sigma = _weights(errors, sigma)
        cost = _cost(residuals, x, errors, sigma)
        if number == iterations or settling:
            settling, damping = True, 0.0
        H, g, information = _normal(residuals, x, starts, errors, sigma)
        better = None
        trial, new_starts, new_errors = x, starts, errors
        for _ in range(5):
            step = _step(H, g, x, residuals, damping)
            trial = np.clip(x + step[: len(free)], residuals.lower, residuals.upper)
            new_starts = _moved(residuals, starts, step[len(free) :])
            new_errors = residuals.errors(trial, new_starts)
            new_cost = _cost(residuals, trial, new_errors, sigma)
            if new_cost < cost:
                better = new_cost
                break
            damping = max(damping, 1e-4) * 8
        if progress is not None:
            progress()
        fall = 0.0
        if better is not None:
            fall = (cost - better) / cost
            x, starts, errors, cost = trial, new_starts, new_errors, better
            damping = damping / 10
        if fall < _SETTLED:
            if settling or not settles:
                break
            settling = True
    model = residuals.model_at(x)
    pieces = zip(residuals.pieces, starts, strict=True)
    started = tuple(StartedPiece(p.record, start) for p, start in pieces)
    return Fit(model, started, cost, errors, sigma, information, tuple(free))


def _weights(errors: Array, before: Array) -> Array:
    sigma = _rms(errors)
    return np.where(np.isfinite(sigma) & (sigma > 0), sigma, before)


def _rms(errors: Array) -> Array:
    """Return the root mean square of the finite errors of each output."""
    finite = np.where(np.isfinite(errors), errors, 0.0)
    with np.errstate(over="ignore"):
        return np.sqrt(np.mean(finite**2, axis=0))


def _cost(residuals: Residuals, x: Array, errors: Array, sigma: Array) -> float:
    prior = (x - residuals.centre) * residuals.prior
    with np.errstate(over="ignore", invalid="ignore"):  # a step may lead to a run that diverges
        total = 0.5 * float(np.sum((errors / sigma) ** 2) + prior @ prior)
    return total if np.isfinite(total) else np.inf


def _moved(residuals: Residuals, starts: Sequence[Start], step: Array) -> list[Start]:
    sizes = residuals.start_sizes
    if sizes is None:
        return list(starts)
    moved, at = [], 0
    for start in starts:
        vector = start.vector
        moved.append(start.with_vector(vector + sizes * step[at : at + vector.size]))
        at += vector.size
    return moved


def _normal(
    residuals: Residuals, x: Array, starts: Sequence[Start], errors: Array, sigma: Array
) -> tuple[Array, Array, Array]:
    """Return the Gauss-Newton matrix, the gradient, and the reduced information."""
    p, r = len(x), (errors / sigma).ravel()
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        columns = list(pool.map(lambda j: residuals.column(x, starts, errors, j), range(p)))
        blocks: list[Array] = []
        if residuals.start_sizes is not None:
            run = residuals.run_at(x)
            each = enumerate(starts)
            blocks = list(pool.map(lambda e: residuals.start_block(run, e[1], errors, e[0]), each))
    J = np.empty((r.size, p))
    for j, column in enumerate(columns):
        J[:, j] = (column / sigma).ravel()
    J = np.nan_to_num(J, nan=0.0, posinf=0.0, neginf=0.0)
    sizes = [s.vector.size for s in starts] if blocks else []
    n = p + sum(sizes)
    H, g = np.zeros((n, n)), np.zeros(n)
    H[:p, :p] = J.T @ J + np.diag(residuals.prior**2)
    g[:p] = J.T @ r + residuals.prior**2 * (x - residuals.centre)
    reduced, at, ny = H[:p, :p].copy(), p, errors.shape[1]
    for i, block in enumerate(blocks):
        rows = slice(residuals.offsets[i] * ny, residuals.offsets[i + 1] * ny)
        weighted = np.nan_to_num(block / np.tile(sigma, len(block) // ny)[:, None])
        here = slice(at, at + sizes[i])
        H[here, here] = weighted.T @ weighted
        H[:p, here] = J[rows].T @ weighted
        H[here, :p] = H[:p, here].T
        g[here] = weighted.T @ r[rows]
        reduced -= H[:p, here] @ np.linalg.pinv(H[here, here], hermitian=True) @ H[here, :p]
        at += sizes[i]
    return H, g, reduced


def _step(H: Array, g: Array, x: Array, residuals: Residuals, damping: float) -> Array:
    """Solve the damped step, leaving out parameters that rest at a bound."""
    p = len(x)
    held = np.zeros(len(g), dtype=bool)
    held[:p] = ((x <= residuals.lower) & (g[:p] > 0)) | ((x >= residuals.upper) & (g[:p] < 0))
    use = np.flatnonzero(~held & (np.diag(H) > 0))
    step = np.zeros(len(g))
    if use.size:
        size = np.sqrt(np.diag(H)[use])
        scaled = H[use][:, use] / np.outer(size, size) + damping * np.eye(use.size)
        step[use] = -np.linalg.lstsq(scaled, g[use] / size, rcond=1e-14)[0] / size
    return step


def covariance_of(fitted: Fit) -> xr.DataArray:
    """Return the covariance of the fitted numbers, residuals taken as coloured as they are.

    The information is divided by the variance inflation of autocorrelated residuals.

    Parameters
    ----------
    fitted : Fit

    Returns
    -------
    xarray.DataArray
        Over ``parameter`` and ``other``, the keys of the fitted numbers, in products of their SI
        units. Numbers that the data does not see have an infinite variance.
    """
    inflation = max(_inflation(e) for e in (fitted.errors / fitted.sigma).T)
    information = fitted.information
    keys = [f.key for f in fitted.free]
    seen = np.flatnonzero(np.diag(information) > 0).tolist()
    matrix = np.diag(np.full(len(keys), np.inf))
    if seen:
        block = information[np.ix_(seen, seen)]
        size = np.sqrt(np.diag(block))
        relative = np.linalg.pinv(block / np.outer(size, size), rcond=1e-12, hermitian=True)
        share = float(np.mean((fitted.errors / fitted.sigma) ** 2))
        unit = np.array([fitted.free[j].scale for j in seen]) / size
        matrix[np.ix_(seen, seen)] = relative * np.outer(unit, unit) * inflation * share
    return xr.DataArray(matrix, {"parameter": keys, "other": keys}, ("parameter", "other"))


def standard_errors(fitted: Fit) -> dict[str, float]:
    """Return the standard errors of the fitted numbers by their keys, in SI units."""
    return errors_from(covariance_of(fitted))


def errors_from(covariance: xr.DataArray) -> dict[str, float]:
    """Return the standard errors that belong to a covariance."""
    errors = np.sqrt(np.maximum(np.diag(covariance.values), 0.0))
    return dict(zip(covariance["parameter"].values.tolist(), errors.tolist(), strict=True))


def _inflation(e: Array) -> float:
    """Return one plus twice the sum of squared autocorrelations, Bartlett's factor."""
    e = np.nan_to_num(e - np.mean(e))
    power = float(e @ e)
    if power == 0:
        return 1.0
    lags = min(200, len(e) // 10)
    rho = np.array([e[k:] @ e[:-k] for k in range(1, lags)]) / power
    return float(1 + 2 * np.sum(rho**2))
