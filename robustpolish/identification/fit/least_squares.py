"""Bounded Levenberg-Marquardt steps on prediction errors, and how well the numbers are known."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from robustpolish.arrays import Array
from robustpolish.identification.fit.parameters import FreeParameter, joint_priors
from robustpolish.identification.observer.run import RecordRun, Runner, StartedPiece
from robustpolish.long_calls import on_all_cores
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.data import share_of_couplings

# Steps of differences. Where friction with memory or a stop jumps at a sample, errors jump by a
# little, and a step that spans such jumps sees slopes several times too steep; and along what the
# data leave open, what a long step errs by looks like knowledge.
_STEP = 1e-7
_START_STEP = 1e-7
# Derivatives beyond it come from a run that diverges; squares of what is below can be added up.
_ENDLESS = 1e100
# Relative fall of the cost below which a fit stops.
SETTLED = 1e-3
# Enough to see the scatter, few enough to be long against the memory of residuals.
_BLOCKS = 20


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
    sensitivity : ndarray, shape (samples * ny, p)
        Derivatives of the weighted errors to the scaled parameters, less what starts could do.
    """

    model: MechanicalModel
    pieces: tuple[StartedPiece, ...]
    cost: float
    errors: Array
    sigma: Array
    information: Array = field(default_factory=lambda: np.zeros((0, 0)))
    free: Sequence[FreeParameter] = ()
    sensitivity: Array = field(default_factory=lambda: np.zeros((0, 0)))

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
        self.records = tuple(piece.record for piece in pieces)
        self.offsets = np.cumsum([0, *(p.record.samples for p in pieces)])
        self.scale = np.array([f.scale for f in free])
        self.lower = np.array([f.lower for f in free]) / self.scale
        self.upper = np.array([f.upper for f in free]) / self.scale
        self.prior = np.array([f.scale / f.prior for f in free])
        self.centre = np.array([f.centre / f.scale for f in free])
        self.joint = joint_priors(model, self.free) * self.scale
        self.keys = keys = [f.key for f in free]
        self._at: tuple[Array, MechanicalModel] | None = None
        self.coupled = any(key.startswith("coupled_inertia") for key in keys)
        self.above = [(j, keys.index(f.at_least)) for j, f in enumerate(free) if f.at_least in keys]

    def within(self, x: Array) -> Array:
        """Return scaled parameters moved to where they may be."""
        x = np.clip(x, self.lower, self.upper)
        for j, other in self.above:
            x[j] = max(x[j], x[other] * self.scale[other] / self.scale[j])
        return self._with_energy(x) if self.coupled else x

    def _with_energy(self, x: Array) -> Array:
        """Return the parameters with coupled inertias that leave every motion some energy."""
        values = {f.key: v for f, v in zip(self.free, (x * self.scale).tolist(), strict=True)}
        share = share_of_couplings(self.model, values)
        return np.array([
            v * share if f.key.startswith("coupled_inertia") else v
            for f, v in zip(self.free, x, strict=True)
        ])  # fmt: skip

    def model_at(self, x: Array) -> MechanicalModel:
        """Return the model with scaled parameters x; all derivatives there begin with the same."""
        known = self._at
        if known is None or not np.array_equal(known[0], x):
            values = dict(zip(self.keys, (x * self.scale).tolist(), strict=True))
            known = self._at = (x.copy(), self.model.with_parameters(values))
        return known[1]

    def run_at(self, x: Array) -> RecordRun:
        """Return the model with scaled parameters x, ready to run."""
        return self.runner.run(self.model_at(x))

    def started(self, starts: Array) -> list[StartedPiece]:
        """Return the pieces with other starts, one row of displacements and so on for each."""
        return [
            StartedPiece(piece.record, piece.start.with_vector(row))
            for piece, row in zip(self.pieces, starts, strict=True)
        ]

    def errors(self, x: Array, starts: Array) -> Array:
        """Return the prediction errors, in the outputs' units."""
        return self.run_at(x).errors_along(self.records, starts)

    def better_starts(
        self, x: Array, starts: tuple[Array, Array], after: Array, sigma: Array
    ) -> tuple[Array, Array]:
        """Return for each piece the better of two starts, and the errors of all.

        Where friction holds a body in some short piece, its start says nothing to first order, and
        a step far beyond that would spoil what the step does for all others.

        Parameters
        ----------
        x : ndarray, shape (p,)
        starts : two ndarrays, shape (pieces, n)
            As they were, and moved.
        after : ndarray, shape (samples, ny)
            Errors from the moved ones.
        sigma : ndarray, shape (ny,)
        """
        before = self.errors(x, starts[0])
        with np.errstate(over="ignore", invalid="ignore"):
            both = [np.sum((e / sigma) ** 2, axis=1) for e in (before, after)]
            stay, moved = (np.add.reduceat(square, self.offsets[:-1]) for square in both)
        move = moved <= stay  # not a number where a run diverges
        each = np.repeat(move, np.diff(self.offsets))[:, None]
        return np.where(move[:, None], starts[1], starts[0]), np.where(each, after, before)

    def columns(self, x: Array, starts: Array, errors: Array) -> list[Array]:
        """Return the derivatives of the errors to all scaled parameters, then to the own starts.

        Those to the starts are of each piece's errors to the scaled states of its own start.
        """
        p, n = len(x), 0 if self.start_sizes is None else starts.shape[1]
        run = self.run_at(x)

        def column(j: int) -> Array:
            if j < p:
                return self._column(x, starts, errors, j)
            return self._start_column(run, starts, errors, j - p)

        return on_all_cores(column, range(p + n))

    def _column(self, x: Array, starts: Array, errors: Array, j: int) -> Array:
        h = _STEP * max(abs(x[j]), 1.0)
        if x[j] + h > self.upper[j]:
            h = -h
        moved = {self.free[j].key: float((x[j] + h) * self.scale[j])}
        run = self.runner.run(self.model_at(x).with_parameters(moved))
        return (run.errors_along(self.records, starts) - errors) / h

    def _start_column(self, run: RecordRun, starts: Array, errors: Array, j: int) -> Array:
        assert self.start_sizes is not None
        moved = starts.copy()
        moved[:, j] += _START_STEP * self.start_sizes[j]
        return (run.errors_along(self.records, moved) - errors) / _START_STEP


def fit(
    residuals: Residuals,
    iterations: int = 8,
    progress: Callable[[], None] | None = None,
    settled: float = SETTLED,
) -> Fit:
    """Minimise the weighted prediction errors.

    Parameters
    ----------
    residuals : Residuals
    iterations : int
        Most accepted or refused steps.
    progress : callable, optional
        Called after every step.
    settled : float, optional
        Relative fall of the cost below which it stops.
    """
    free = residuals.free
    x = residuals.within(np.array([f.start / f.scale for f in free], dtype=float))
    starts = np.array([piece.start.vector for piece in residuals.pieces])
    errors = residuals.errors(x, starts)
    sigma = _weights(errors, np.ones(errors.shape[1]))
    cost = _cost(residuals, x, errors, sigma)
    damping = 1e-3
    normal: Normal | None = None
    # Where only priors speak, damped steps hardly move: a free run ends with a step undamped.
    settles = bool(free) and residuals.runner.level.free and settled <= SETTLED
    settling = False
    for number in range(iterations + settles):
        if not np.isfinite(cost):
            break
        # priors count against the noise that is left, not against the error at the start
        sigma = _weights(errors, sigma)
        cost = _cost(residuals, x, errors, sigma)
        if number == iterations or settling:
            settling, damping = True, 0.0
        normal = _normal(residuals, x, starts, errors, sigma)
        better = None
        trial, new_starts, new_errors = x, starts, errors
        for _ in range(4):
            step, moves = _step(normal, x, residuals, damping)
            trial = residuals.within(x + step)
            new_starts = starts
            if residuals.start_sizes is not None:
                new_starts = starts + moves * residuals.start_sizes
            new_errors = residuals.errors(trial, new_starts)
            new_cost = _cost(residuals, trial, new_errors, sigma)
            if not new_cost < cost and residuals.start_sizes is not None:
                new_starts, new_errors = residuals.better_starts(
                    trial, (starts, new_starts), new_errors, sigma
                )
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
        if fall < settled:
            if settling or not settles:
                break
            settling = True
    found = residuals.model_at(x), tuple(residuals.started(starts)), cost, errors, sigma
    if normal is None:
        return Fit(*found, np.zeros((len(free), len(free))), tuple(free))
    return Fit(*found, normal.information(), tuple(free), normal.seen)


def unfitted(residuals: Residuals) -> Fit:
    """Return what a fit would say of a model as it is: its errors and how well they tell it."""
    free, starts = residuals.free, np.array([piece.start.vector for piece in residuals.pieces])
    x = np.array([f.start / f.scale for f in free], dtype=float)
    errors = residuals.errors(x, starts)
    sigma = _weights(errors, np.ones(errors.shape[1]))
    normal = normal_of(residuals, errors, sigma)
    cost = _cost(residuals, x, errors, sigma)
    found = residuals.model, residuals.pieces, cost, errors, sigma
    return Fit(*found, normal.information(), tuple(free), normal.seen)


def _weights(errors: Array, before: Array) -> Array:
    sigma = _rms(errors)
    return np.where(np.isfinite(sigma) & (sigma > 0), sigma, before)


def _rms(errors: Array) -> Array:
    """Return the root mean square of the finite errors of each output."""
    finite = np.where(np.isfinite(errors), errors, 0.0)
    with np.errstate(over="ignore"):
        return np.sqrt(np.mean(finite**2, axis=0))


def _cost(residuals: Residuals, x: Array, errors: Array, sigma: Array) -> float:
    prior = np.concatenate([(x - residuals.centre) * residuals.prior, residuals.joint @ x])
    with np.errstate(over="ignore", invalid="ignore"):  # a step may lead to a run that diverges
        total = 0.5 * float(np.sum((errors / sigma) ** 2) + prior @ prior)
    return total if np.isfinite(total) else np.inf


class Normal:
    """Normal equations whose unknowns are the parameters, and the starts of every piece.

    The starts of one piece do not touch the errors of another, so that they are eliminated piece
    by piece.

    Parameters
    ----------
    J : ndarray, shape (errors, p)
        Derivatives of the weighted errors to the scaled parameters.
    blocks : sequence of ndarray, shape (errors of the piece, n)
        The same to the scaled start of each piece.
    error : ndarray, shape (errors,)
    residuals : Residuals
    x : ndarray, shape (p,)
    """

    def __init__(
        self, J: Array, blocks: Sequence[Array], error: Array, residuals: Residuals, x: Array
    ) -> None:
        self.J, self.blocks = J, blocks
        marks = np.cumsum([0, *(len(block) for block in blocks)])
        self.rows = [slice(a, b) for a, b in itertools.pairwise(marks)]
        p, n = J.shape[1], blocks[0].shape[1] if blocks else 0
        shape = (len(blocks), n)
        own, joint = residuals.prior**2, residuals.joint.T @ residuals.joint
        self.prior = np.diag(own) + joint
        self.H = J.T @ J + self.prior
        self.g = J.T @ error + own * (x - residuals.centre) + joint @ x
        self.mixed = np.zeros((len(blocks), p, n))
        self.own = np.zeros((*shape, n))
        self.own_g = np.zeros(shape)
        for i, (block, rows) in enumerate(zip(blocks, self.rows, strict=True)):
            self.mixed[i], self.own[i] = J[rows].T @ block, block.T @ block
            self.own_g[i] = block.T @ error[rows]

    def step(self, free: NDArray[np.bool_], damping: float) -> tuple[Array, Array]:
        """Return the damped step of the free parameters, and of all starts, (pieces, n)."""
        size = np.sqrt(np.diag(self.H))
        use = np.flatnonzero(free & (size > 0))
        scale = size[use]
        H = self.H[use][:, use] / np.outer(scale, scale) + damping * np.eye(use.size)
        g = self.g[use] / scale
        own = np.sqrt(np.einsum("kii->ki", self.own))
        own[own == 0] = 1.0
        inverse = np.linalg.pinv(
            self.own / (own[:, :, None] * own[:, None, :]) + damping * np.eye(own.shape[1]),
            rcond=1e-12, hermitian=True,
        )  # fmt: skip
        mixed = self.mixed[:, use] / (scale[:, None] * own[:, None, :])
        through = mixed @ inverse
        own_g = self.own_g / own
        H = H - np.einsum("kin,kjn->ij", through, mixed)
        g = g - np.einsum("kin,kn->i", through, own_g)
        step = np.zeros(len(size))
        if use.size:
            step[use] = -np.linalg.lstsq(H, g, rcond=1e-14)[0]
        moves = -np.einsum("knm,km->kn", inverse, own_g + np.einsum("kin,i->kn", mixed, step[use]))
        step[use] = step[use] / scale
        return step, moves / own

    @cached_property
    def seen(self) -> Array:
        """What the errors tell of the parameters that no start could, like `J`."""
        return self._without_starts(self.J)

    def _without_starts(self, columns: Array) -> Array:
        rest = columns.copy()
        for block, rows in zip(self.blocks, self.rows, strict=True):
            size = np.sqrt(np.sum(block**2, axis=0))
            scaled = block / np.where(size > 0, size, 1.0)
            rest[rows] -= scaled @ np.linalg.lstsq(scaled, columns[rows], rcond=1e-10)[0]
        return rest

    def without_nuisance(self, columns: Array) -> Array:
        """Return columns less what starts and parameters can do, priors aside."""
        rest, J = self._without_starts(columns), self.seen
        size = np.sqrt(np.sum(J**2, axis=0))
        J = J[:, size > 0] / size[size > 0]
        if J.shape[1]:
            rest -= J @ np.linalg.lstsq(J, rest, rcond=1e-10)[0]
        return rest

    def information(self) -> Array:
        """Return J'J of the parameters, starts eliminated, priors included."""
        J = self.seen
        return J.T @ J + self.prior


def normal_of(residuals: Residuals, errors: Array, sigma: Array) -> Normal:
    """Return the normal equations where the residuals stand, with the errors there."""
    x = np.array([f.start / f.scale for f in residuals.free])
    starts = np.array([piece.start.vector for piece in residuals.pieces])
    return _normal(residuals, x, starts, errors, sigma)


def _normal(residuals: Residuals, x: Array, starts: Array, errors: Array, sigma: Array) -> Normal:
    p, n = len(x), 0 if residuals.start_sizes is None else starts.shape[1]
    found = residuals.columns(x, starts, errors)
    columns = np.array([(column / sigma).ravel() for column in found]).reshape(p + n, -1).T
    # 0 where it is not a number, too
    columns = np.where(np.abs(columns) < _ENDLESS, columns, 0.0)
    ny = errors.shape[1]
    blocks = [
        columns[a * ny : b * ny, p:] for a, b in itertools.pairwise(residuals.offsets)
    ] if n else []  # fmt: skip
    error = (errors / sigma).ravel()
    return Normal(np.ascontiguousarray(columns[:, :p]), blocks, error, residuals, x)


def _step(normal: Normal, x: Array, residuals: Residuals, damping: float) -> tuple[Array, Array]:
    """Solve the damped step, leaving out parameters that rest at a bound."""
    g = normal.g
    held = ((x <= residuals.lower) & (g > 0)) | ((x >= residuals.upper) & (g < 0))
    return normal.step(~held, damping)


def covariance_of(fitted: Fit) -> xr.DataArray:
    """Return the covariance of the fitted numbers, residuals taken as coloured as they are.

    Each variance is the larger one of two: that of white residuals, inflated by their
    autocorrelation, and that which the scores of long blocks show (White's sandwich with blocks,
    Kuensch 1989, Annals of Statistics 17, 1217-1241), which also sees what a wrong model does.

    Parameters
    ----------
    fitted : Fit

    Returns
    -------
    xarray.DataArray
        Over ``parameter`` and ``other``, the keys of the fitted numbers, in products of their SI
        units. Numbers that the data does not see have an infinite variance.
    """
    errors = fitted.errors / fitted.sigma
    wide = max((inflation(e) for e in errors.T), default=1.0)
    information = fitted.information
    keys = [f.key for f in fitted.free]
    seen = np.flatnonzero(np.diag(information) > 0).tolist()
    matrix = np.diag(np.full(len(keys), np.inf))
    if seen:
        block = information[np.ix_(seen, seen)]
        size = np.sqrt(np.diag(block))
        relative = np.linalg.pinv(block / np.outer(size, size), rcond=1e-12, hermitian=True)
        white = relative * wide * float(np.mean(errors**2))
        ratio = 1.0
        if fitted.sensitivity.size:
            meat = _of_blocks(fitted.sensitivity[:, seen] / size, errors)
            ratio = np.diag(relative @ meat @ relative) / np.maximum(np.diag(white), 1e-300)
        wider = np.sqrt(np.maximum(ratio, 1.0)) * np.ones(len(seen))
        unit = wider * np.array([fitted.free[j].scale for j in seen]) / size
        matrix[np.ix_(seen, seen)] = white * np.outer(unit, unit)
    return xr.DataArray(matrix, {"parameter": keys, "other": keys}, ("parameter", "other"))


def _of_blocks(sensitivity: Array, errors: Array) -> Array:
    """Return the covariance of the sum of the scores, from their sums over blocks."""
    samples, ny = errors.shape
    scores = np.einsum("tip,ti->tp", sensitivity.reshape(samples, ny, -1), errors)
    marks = np.linspace(0, samples, _BLOCKS + 1).astype(int)
    sums = np.add.reduceat(scores, marks[:-1], axis=0)
    sums = sums - sums.mean(axis=0)  # priors pull against the rest
    return sums.T @ sums * _BLOCKS / (_BLOCKS - 1)


def standard_errors(fitted: Fit) -> dict[str, float]:
    """Return the standard errors of the fitted numbers by their keys, in SI units."""
    return errors_from(covariance_of(fitted))


def errors_from(covariance: xr.DataArray) -> dict[str, float]:
    """Return the standard errors that belong to a covariance."""
    errors = np.sqrt(np.maximum(np.diag(covariance.values), 0.0))
    return dict(zip(covariance["parameter"].values.tolist(), errors.tolist(), strict=True))


def log_odds(one: Fit, other: Fit) -> float:
    """Return the log odds by which a record prefers one fit to another fit to the same pieces.

    Their errors alone are compared, numbers cost nothing. Coloured errors tell less: as many are
    counted as are independent in the other fit.
    """
    return float(np.sum(independent(other) * np.log(other.rmse / one.rmse)))


def independent(fitted: Fit) -> Array:
    """Return how many errors of each output of a fit are as good as independent."""
    return np.array([len(error) / inflation(error) for error in fitted.errors.T])


def inflation(e: Array) -> float:
    """Return one plus twice the sum of squared autocorrelations, Bartlett's factor."""
    e = np.nan_to_num(e - np.mean(e))
    power = float(e @ e)
    if power == 0:
        return 1.0
    lags = min(200, len(e) // 10)
    rho = np.array([e[k:] @ e[:-k] for k in range(1, lags)]) / power
    return float(1 + 2 * np.sum(rho**2))
