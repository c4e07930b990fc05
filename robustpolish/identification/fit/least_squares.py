"""Bounded Levenberg-Marquardt fits of prediction errors, with the covariance of the numbers."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from robustpolish.base.arrays import Array
from robustpolish.base.budget import parallel_map
from robustpolish.identification.fit import parameters
from robustpolish.identification.fit.prepared import PreparedRecord
from robustpolish.identification.observer.runs import (
    Chains,
    InitialState,
    Runner,
    StartedPiece,
    reproducibility,
    rest,
)
from robustpolish.machines.mechanical.data import definite_coupling_share
from robustpolish.machines.mechanical.model import MechanicalModel

# Steps of differences. Where friction with memory or a stop jumps at a sample, errors jump by a
# little, and a step that spans such jumps sees slopes several times too steep; and along what the
# data leave open, what a long step errs by looks like knowledge.
_STEP = 1e-7
# Derivatives beyond it come from a run that diverges; squares of what is below can be added up.
_ENDLESS = 1e100
# Relative fall of the cost below which a fit stops.
CONVERGED = 1e-3
# Most steps of the last stage of a fit that ends below the usual fall of the cost.
_DIRECT_STEPS = 20
# Dampings that are tried before a fit has converged, each 8 times the one before, to 1e5 times the
# curvature: friction makes the cost rough, so that a step has to be short before it falls.
_DAMPINGS = 10
# Share of its first size below which an effect has vanished in a stage of a fit.
_VANISHED = 0.01
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
    free: Sequence[parameters.FreeParameter] = ()
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
        free: Sequence[parameters.FreeParameter],
        start_sizes: Array | None = None,
    ) -> None:
        self.model, self.pieces, self.runner = model, tuple(pieces), runner
        self.free, self.start_sizes = list(free), start_sizes
        self.records = tuple(piece.record for piece in pieces)
        self.starts = np.array([piece.start.vector for piece in pieces])
        self.offsets = np.cumsum([0, *(p.record.samples for p in pieces)])
        self.scale = np.array([f.scale for f in free])
        self.lower = np.array([f.lower for f in free]) / self.scale
        self.upper = np.array([f.upper for f in free]) / self.scale
        self.prior = np.array([f.scale / f.prior for f in free])
        self.centre = np.array([f.centre / f.scale for f in free])
        self.joint = parameters.joint_priors(model, self.free) * self.scale
        self.x = np.array([f.start for f in free]) / self.scale
        self.keys = keys = [f.key for f in free]
        self.chains = Chains(model)
        self._at: tuple[Array, MechanicalModel] | None = None
        self.coupled = np.array([key.startswith("coupled_inertia") for key in keys])
        self.above = [(j, keys.index(f.at_least)) for j, f in enumerate(free) if f.at_least in keys]

    def within(self, x: Array) -> Array:
        """Return scaled parameters moved to where they may be."""
        x = np.clip(x, self.lower, self.upper)
        for j, other in self.above:
            x[j] = max(x[j], x[other] * self.scale[other] / self.scale[j])
        if self.coupled.any():  # coupled inertias have to leave every motion some energy
            x = np.where(self.coupled, x * definite_coupling_share(self.model, self.values(x)), x)
        return x

    def values(self, x: Array) -> dict[str, float]:
        """Return scaled parameters by key, in SI units."""
        return dict(zip(self.keys, (x * self.scale).tolist(), strict=True))

    def model_at(self, x: Array) -> MechanicalModel:
        """Return the model with scaled parameters x; all derivatives there begin with the same."""
        if self._at is None or not np.array_equal(self._at[0], x):
            self._at = (x.copy(), self.model.with_parameters(self.values(x)))
        return self._at[1]

    def started(self, starts: Array) -> list[StartedPiece]:
        """Return the pieces with other starts, one row of displacements and so on for each."""
        return [p.with_start(row) for p, row in zip(self.pieces, starts, strict=True)]

    def errors(self, x: Array, starts: Array) -> Array:
        """Return the prediction errors, in the outputs' units."""
        return self.runner.run(self.model_at(x)).errors_along(self.records, starts)

    def cost(self, x: Array, errors: Array, sigma: Array) -> float:
        """Return half the sum of squares, priors included; infinite where a run diverges."""
        prior = np.concatenate([(x - self.centre) * self.prior, self.joint @ x])
        with np.errstate(over="ignore", invalid="ignore"):
            total = 0.5 * float(np.sum((errors / sigma) ** 2) + prior @ prior)
        return total if np.isfinite(total) else np.inf

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
        p, model, chains = len(x), self.model_at(x), self.chains
        run, sizes = self.runner.run(model), self.start_sizes
        of = [chains.parameter(key) for key in self.keys]
        of += [] if sizes is None else chains.states
        h = _STEP * np.maximum(np.abs(x), 1.0)
        h = np.concatenate([np.where(x + h > self.upper, -h, h), np.full(len(of) - p, _STEP)])

        def change(group: Sequence[int]) -> Array:
            ahead, moved, changed = {}, starts.copy(), run
            for j in group:
                if j < p:
                    ahead[self.keys[j]] = float((x[j] + h[j]) * self.scale[j])
                elif sizes is not None:
                    moved[:, j - p] += h[j] * sizes[j - p]
            if ahead:
                changed = self.runner.run(model.with_parameters(ahead))
            return changed.errors_along(self.records, moved) - errors

        return [c / step for c, step in zip(chains.changes(of, change), h, strict=True)]


def fit(
    residuals: Residuals,
    iterations: int = 8,
    progress: Callable[[], None] | None = None,
    settled: float = CONVERGED,
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
    free, sizes = residuals.free, residuals.start_sizes
    x, starts = residuals.within(residuals.x), residuals.starts
    errors = residuals.errors(x, starts)
    sigma = _weights(errors)
    cost = residuals.cost(x, errors, sigma)
    damping = 1e-3
    normal: Normal | None = None
    # Where only priors speak, damped steps hardly move: a free run ends with a step undamped.
    settles = bool(free) and residuals.runner.level.free and settled <= CONVERGED
    settling = False
    for number in range(iterations + settles):
        if not np.isfinite(cost):
            break
        # priors count against the noise that is left, not against the error at the start
        sigma = _weights(errors, sigma)
        cost = residuals.cost(x, errors, sigma)
        if number == iterations or settling:
            settling, damping = True, 0.0
        normal = Normal.at(residuals, x, starts, errors, sigma)
        # parameters that rest at a bound stay
        held = ((x <= residuals.lower) & (normal.g > 0)) | ((x >= residuals.upper) & (normal.g < 0))
        fall = 0.0
        for _ in range(_DAMPINGS):
            step, moves = normal.step(~held, damping)
            trial = residuals.within(x + step)
            new_starts = starts if sizes is None else starts + moves * sizes
            new_errors = residuals.errors(trial, new_starts)
            new_cost = residuals.cost(trial, new_errors, sigma)
            if not new_cost < cost and sizes is not None:
                both = (starts, new_starts)
                new_starts, new_errors = residuals.better_starts(trial, both, new_errors, sigma)
                new_cost = residuals.cost(trial, new_errors, sigma)
            if new_cost < cost:
                fall = (cost - new_cost) / cost
                x, starts, errors, cost = trial, new_starts, new_errors, new_cost
                damping = damping / 10
                break
            damping = max(damping, 1e-4) * 8
        if progress is not None:
            progress()
        if fall < settled:
            if settling or not settles:
                break
            settling = True
    found = residuals.model_at(x), tuple(residuals.started(starts)), cost, errors, sigma
    if normal is None:
        return Fit(*found, np.zeros((len(free), len(free))), tuple(free))
    return Fit(*found, normal.information(), tuple(free), normal.seen)


def evaluate_unfitted(residuals: Residuals) -> Fit:
    """Return what a fit would say of a model as it is: its errors and how well they tell it."""
    errors = residuals.errors(residuals.x, residuals.starts)
    sigma = _weights(errors)
    normal = normal_of(residuals, errors, sigma)
    cost = residuals.cost(residuals.x, errors, sigma)
    found = residuals.model, residuals.pieces, cost, errors, sigma
    return Fit(*found, normal.information(), tuple(residuals.free), normal.seen)


def _weights(errors: Array, before: Array | float = 1.0) -> Array:
    """Return the root mean square of the finite errors of each output, as before if it is none."""
    finite = np.where(np.isfinite(errors), errors, 0.0)
    with np.errstate(over="ignore"):
        sigma = np.sqrt(np.mean(finite**2, axis=0))
    return np.where(np.isfinite(sigma) & (sigma > 0), sigma, before)


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
        own, joint = residuals.prior**2, residuals.joint.T @ residuals.joint
        self.prior = np.diag(own) + joint
        self.H = J.T @ J + self.prior
        self.g = J.T @ error + own * (x - residuals.centre) + joint @ x
        each, m = list(zip(blocks, self.rows, strict=True)), len(blocks)
        mixed = [J[rows].T @ block for block, rows in each]
        self.mixed = np.array(mixed).reshape(m, p, n)
        self.own = np.array([block.T @ block for block in blocks]).reshape(m, n, n)
        self.own_g = np.array([block.T @ error[rows] for block, rows in each]).reshape(m, n)

    @classmethod
    def at(
        cls, residuals: Residuals, x: Array, starts: Array, errors: Array, sigma: Array
    ) -> Normal:
        """Return the normal equations at parameters and starts, with the errors there."""
        p, ny = len(x), errors.shape[1]
        found = residuals.columns(x, starts, errors)
        columns = np.array([(each / sigma).ravel() for each in found]).reshape(len(found), -1).T
        # 0 where it is not a number, too
        columns = np.where(np.abs(columns) < _ENDLESS, columns, 0.0)
        ends = itertools.pairwise(residuals.offsets) if len(found) > p else ()
        blocks = [columns[a * ny : b * ny, p:] for a, b in ends]
        error = (errors / sigma).ravel()
        return cls(np.ascontiguousarray(columns[:, :p]), blocks, error, residuals, x)

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
    return Normal.at(residuals, residuals.x, residuals.starts, errors, sigma)


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
    wide = max((bartlett_factor(e) for e in errors.T), default=1.0)
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
            meat = _block_score_covariance(fitted.sensitivity[:, seen] / size, errors)
            ratio = np.diag(relative @ meat @ relative) / np.maximum(np.diag(white), 1e-300)
        wider = np.sqrt(np.maximum(ratio, 1.0)) * np.ones(len(seen))
        unit = wider * np.array([fitted.free[j].scale for j in seen]) / size
        matrix[np.ix_(seen, seen)] = white * np.outer(unit, unit)
    return xr.DataArray(matrix, {"parameter": keys, "other": keys}, ("parameter", "other"))


def _block_score_covariance(sensitivity: Array, errors: Array) -> Array:
    """Return the covariance of the sum of the scores, from their sums over blocks."""
    samples, ny = errors.shape
    scores = np.einsum("tip,ti->tp", sensitivity.reshape(samples, ny, -1), errors)
    marks = np.linspace(0, samples, _BLOCKS + 1).astype(int)
    sums = np.add.reduceat(scores, marks[:-1], axis=0)
    sums = sums - sums.mean(axis=0)  # priors pull against the rest
    return sums.T @ sums * _BLOCKS / (_BLOCKS - 1)


def log_odds(one: Fit, other: Fit) -> float:
    """Return the log odds by which a record prefers one fit to another fit to the same pieces.

    Their errors alone are compared, numbers cost nothing. Coloured errors tell less: as many are
    counted as are independent in the other fit.
    """
    return float(np.sum(effective_samples(other.errors) * np.log(other.rmse / one.rmse)))


def effective_samples(errors: Array) -> Array:
    """Return how many errors of each output, shape (samples, ny), are as good as independent."""
    return np.array([len(error) / bartlett_factor(error) for error in errors.T])


MOST_SAMPLES = 40.0
"""Independent errors of a model that one output has at most: a fall by a fifth is worth 9 nats."""


def most_counted(power: Array, noise: Array) -> Array:
    """Return how many independent errors of each output count at most, shape (ny,).

    Of an error's variance the noise that the record shows without any model is independent from
    sample to sample; the rest is an error of the model, of which `MOST_SAMPLES` count.
    """
    own = np.clip(1 - noise**2 / np.maximum(power, 1e-300), 0.0, 1.0)
    return MOST_SAMPLES / np.maximum(own, 1e-12)


def independent_errors(errors: Array, noise: Array) -> float:
    """Return how many errors are independent, of each output no more than count."""
    most = most_counted(np.mean(errors**2, axis=0), noise)
    return float(np.sum(np.minimum(effective_samples(errors), most)))


def bartlett_factor(e: Array) -> float:
    """Return one plus twice the sum of squared autocorrelations, Bartlett's factor."""
    e = np.nan_to_num(e - np.mean(e))
    power = float(e @ e)
    if power == 0:
        return 1.0
    lags = min(200, len(e) // 10)
    rho = np.array([e[k:] @ e[:-k] for k in range(1, lags)]) / power
    return float(1 + 2 * np.sum(rho**2))


# Multiple shooting: fits over windows that grow longer.
#
# A record is cut into windows from which the model runs freely, each from a start of its own; the
# windows grow from a few swings to whole pieces (multiple shooting: Bock 1983; Ljung, System
# Identification, section 7.2). Errors over a short window depend smoothly on every number. Over
# long runs those of lightly damped systems have many minima, and a distant start ends in a wrong
# one.


def homotopy(
    model: MechanicalModel,
    prepared: PreparedRecord,
    pieces: Sequence[StartedPiece],
    reference: MechanicalModel,
    spans: Sequence[int],
    iterations: int = 8,
    progress: Callable[[], None] | None = None,
    settled: float = CONVERGED,
    last: float = CONVERGED,
    known: bool = False,
) -> list[Fit]:
    """Fit over windows that grow; return the fit of every stage.

    A stage whose errors jump is no start for the next: the last one that followed the data is,
    and that is among the last two that are returned. An effect that vanished in a stage begins the
    next one as it began the first: over short windows the starts may do its work, and where it is
    nothing none of its other numbers makes a difference, and no longer window would bring it back.

    Parameters
    ----------
    model : MechanicalModel
    prepared : PreparedRecord
    pieces : sequence of StartedPiece
        What to fit to.
    reference : MechanicalModel
        About which the priors are centred.
    spans : sequence of int
        Most samples of the windows, rising; see :meth:`PreparedRecord.spans`.
    iterations : int
        Most steps per stage.
    progress : callable, optional
        Called after every step.
    settled : float, optional
        Relative fall of the cost below which a stage stops that only the next one begins with.
    last : float, optional
        The same of the last stage; below the usual one, it has as many steps as a direct fit.
    known : bool, optional
        Whether the model's numbers are near the true ones, as after another fit. The first windows
        then begin where such a model comes closest to them: a friction with memory, whose state no
        motion shows, would be led astray from its true numbers by starts that do not suit it.
    """
    stages: list[Fit] = []
    kept: Fit | None = None
    first = parameters.with_fixed_force_scale(model, reference)
    model = first
    for span in spans if model.free else spans[-1:]:  # what is imposed cannot go astray
        windows = windows_from_stage(model, prepared, pieces, span, kept, known)
        enough = last if span == spans[-1] else settled
        steps = max(iterations, _DIRECT_STEPS) if enough < CONVERGED else iterations
        # an offset that is not known yet makes the smoothed motion so fast that laws diverge
        still = [StartedPiece(window.record, rest(model)) for window in windows]
        tried = (residuals_of(model, begun, prepared, reference) for begun in (windows, still))
        fits = (fit(residuals, steps, progress, enough) for residuals in tried)
        result = next((found for found in fits if np.isfinite(found.cost)), None)
        if result is None:
            continue
        stages.append(result)
        if kept is not None and np.max(result.rmse / kept.rmse) > prepared.policy.lost:
            continue  # the next stage starts where this one did
        kept, model = result, _restore_vanished(result.model, first)
    if kept is not None and all(kept is not stage for stage in stages[-2:]):
        stages.insert(len(stages) - 1, kept)
    return stages


def residuals_of(
    model: MechanicalModel,
    pieces: Sequence[StartedPiece],
    prepared: PreparedRecord,
    reference: MechanicalModel,
) -> Residuals:
    """Return the residuals of a model's runs over pieces, those numbers free that are not held."""
    free = parameters.free_parameters(model, prepared.scales.bandwidth, prepared.policy, reference)
    free = [number for number in free if number.key not in prepared.held]
    sizes = prepared.sizes(model) if pieces[0].start.vector.size else None
    return Residuals(model, pieces, prepared.runner(model), free, sizes)


def _restore_vanished(model: MechanicalModel, first: MechanicalModel) -> MechanicalModel:
    """Return a model with the first values of those effects that have vanished since.

    One that has a single number needs no help: its size alone brings it back.
    """
    effects = list(model.effects)
    for i, (effect, began) in enumerate(zip(effects, first.effects, strict=True)):
        fitted = [p for p in effect.definition.parameters if p.fitted]
        sizes = [p.name for p in fitted if p.counts_force] if len(fitted) > 1 else []
        if any(abs(effect.values[n]) < _VANISHED * abs(began.values[n]) for n in sizes):
            effects[i] = began
    return replace(model, effects=tuple(effects))


def windows_from_stage(
    model: MechanicalModel,
    prepared: PreparedRecord,
    pieces: Sequence[StartedPiece],
    span: int,
    before: Fit | None,
    known: bool = False,
) -> list[StartedPiece]:
    """Cut pieces into windows that start where the stage before was, or the smoothed motion.

    With `known` numbers, where the model comes closest to the windows.
    """
    windows = prepared.cut_windows(model, pieces, span)
    if before is None:
        return _with_refitted_starts(model, prepared, windows, known)
    run = prepared.runner(before.model).run(before.model)
    seen = run.over_all(before.pieces, keep=True)
    n = windows[0].start.state.size
    samples = [p.record.first + np.arange(p.record.samples) for p in before.pieces]
    rows = np.searchsorted(np.concatenate(samples), [w.record.first for w in windows])
    found = []
    for window, row in zip(windows, rows, strict=True):
        start = InitialState(seen.states[row, :n], seen.internal[row])
        finite = np.isfinite(start.vector).all()
        found.append(StartedPiece(window.record, start) if finite else window)
    return found


def _with_refitted_starts(
    model: MechanicalModel, prepared: PreparedRecord, windows: list[StartedPiece], known: bool
) -> list[StartedPiece]:
    """Return the windows, with starts of their own where those of the smoothed motion are far off.

    Where a mass has no displacement sensor its place is a matter of the model that smoothed the
    motion, and a law that grows fast makes of a wrong place a force beyond all bounds: a fit would
    then bend the law to the starts, even away from the true one.
    """
    run = prepared.runner(model).run(model)
    if run.linear or not windows[0].start.vector.size:
        return windows
    if known:
        return prepared.with_fitted_starts(run, windows)
    with np.errstate(over="ignore", invalid="ignore"):
        left = np.mean(run.all_errors(windows) ** 2, axis=0)
    seen = np.var(np.concatenate([window.record.Y for window in windows]), axis=0)
    return windows if np.all(left < seen) else prepared.with_fitted_starts(run, windows)


@dataclass(frozen=True, eq=False)
class EvaluatedFit:
    """A fitted model and what it does on data that it was not fitted to.

    Attributes
    ----------
    fit : Fit
    prepared : PreparedRecord
    free : ndarray, shape (ny,)
        Held-out root mean square error of free runs over whole pieces.
    reproducible : bool
        Whether free runs over whole pieces judge anything.
    """

    fit: Fit
    prepared: PreparedRecord
    free: Array
    reproducible: bool

    @cached_property
    def short(self) -> Array:
        """Held-out error over short windows; measured only where free runs judge nothing."""
        return short_window_rms(self.model, self.prepared, self.prepared.held_out)

    @cached_property
    def over_all(self) -> Array:
        """Error of free runs by which fits are ranked: held out and fitted, as the score counts."""
        return np.sqrt(self.free * free_run_rms(self.model, self.prepared, self.prepared.trial))

    @property
    def model(self) -> MechanicalModel:
        """The fitted model."""
        return self.fit.model

    @property
    def error(self) -> Array:
        """Held-out error that judges: over whole pieces if reproducible, else over windows."""
        return self.free if self.reproducible else self.short


def ranking_log_error(fitted: EvaluatedFit, among: Sequence[EvaluatedFit]) -> float:
    """Return the mean log of the errors that rank; of short windows unless all run reproducibly."""
    predictable = fitted.reproducible and all(other.reproducible for other in among)
    errors = fitted.over_all if predictable else fitted.short
    return float(np.mean(np.log(np.maximum(errors, 1e-300))))


def evaluate_fit(fitted: Fit, prepared: PreparedRecord) -> EvaluatedFit:
    """Measure a fitted model on the held-out pieces."""
    found = free_run_rms_checked(fitted.model, prepared, prepared.held_out)
    return EvaluatedFit(fitted, prepared, *found)


def free_run_rms_checked(
    model: MechanicalModel, prepared: PreparedRecord, pieces: Sequence[StartedPiece]
) -> tuple[Array, bool]:
    """Return the errors of free runs, infinite where they diverge, and whether they judge anything.

    Returns
    -------
    rms : ndarray, shape (ny,)
    reproducible : bool
        Whether the first piece can be run again and again.
    """
    run, started = prepared.run_with_fitted_starts(model, pieces)
    errors, first = run.all_errors(started), started[0]
    found = reproducibility(run, first, first.record.Y - errors[: first.record.samples])
    return _rms(errors), found.reproducible


def short_window_rms(
    model: MechanicalModel, prepared: PreparedRecord, pieces: Sequence[StartedPiece]
) -> Array:
    """Return the errors of free runs over short windows, shape (ny,)."""
    return free_run_rms(model, prepared, prepared.cut_windows(model, pieces, prepared.short))


def short_window_log_error(model: MechanicalModel, prepared: PreparedRecord) -> float:
    """Return the mean log of the errors over short windows of what is fitted to."""
    return float(np.mean(np.log(short_window_rms(model, prepared, prepared.trial))))


def windows_log_error(model: MechanicalModel, prepared: PreparedRecord) -> float:
    """Return the mean log of the errors over the windows of the whole record."""
    return float(np.mean(np.log(free_run_rms(model, prepared, prepared.windows))))


def free_run_rms(
    model: MechanicalModel, prepared: PreparedRecord, pieces: Sequence[StartedPiece]
) -> Array:
    """Return the errors of free runs, infinite where they diverge, shape (ny,)."""
    run, started = prepared.run_with_fitted_starts(model, pieces)
    return _rms(run.all_errors(started))


def _rms(errors: Array) -> Array:
    with np.errstate(over="ignore", invalid="ignore"):
        found = np.sqrt(np.mean(errors**2, axis=0))
    return np.where(np.isfinite(found), found, np.inf)


def best_stage(stages: Sequence[Fit], prepared: PreparedRecord) -> EvaluatedFit:
    """Return the one of the last two stages that runs best over fitted and held-out pieces."""
    found = parallel_map(lambda stage: evaluate_fit(stage, prepared), stages[-2:])
    return min(found, key=lambda stage: ranking_log_error(stage, found))
