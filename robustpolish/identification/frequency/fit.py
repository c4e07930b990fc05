"""Parameter estimation from measured frequency responses by weighted least squares."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr
from scipy.optimize import brentq, least_squares

from robustpolish.base.arrays import AnyArray, Array
from robustpolish.errors import InvalidInputError
from robustpolish.identification.fit.parameters import FreeParameter, free_parameters
from robustpolish.identification.fit.result import Refit, refit_of
from robustpolish.identification.frequency.comparison import combined_error, pair_errors
from robustpolish.identification.frequency.lines import (
    SETTINGS,
    MeasuredResponse,
    measured_response,
)
from robustpolish.identification.policy import POLICY
from robustpolish.machines.mechanical.model import MechanicalModel

_HUGE = 1e12  # what a model that cannot be built, or is infinite, costs


def refit_frequency_response(
    model: MechanicalModel,
    data: Any,
    progress: Callable[[], None] | None = None,
) -> Refit:
    """Fit the masses, springs, dampers, gains and effects of a model to its response.

    Measured and modelled response are first averaged over wide bands, so that resonances which
    do not overlap yet find each other; the bands narrow, and the last fits see every line. There
    an error counts relative to the size of its line and the noise together: antiresonances count
    like resonances as far as they stand above the noise. What of the error is no noise widens
    the share of its size that every line may be wrong by, and the standard errors. No fit ends
    above its start, by the error that :func:`robustpolish.compare` tells.

    Parameters
    ----------
    model : MechanicalModel
        Start values.
    data : xarray.DataArray, control.FrequencyResponseData or path
        See :func:`robustpolish.read_frequency_response`.
    progress : callable, optional
        Called after every stage.

    Returns
    -------
    Refit
        Its errors are those of the pairs, see
        :class:`robustpolish.identification.frequency.comparison.PairError`.

    Raises
    ------
    InvalidInputError
        If no pair is the model's, or a unit is of another kind than the model says.
    """
    measured = measured_response(model, data)
    problem = _Problem.of(model, measured)
    tell = progress or (lambda: None)
    start = np.zeros(len(problem.free))
    thin = measured.thinned(SETTINGS.most_lines)
    led = start
    for width in SETTINGS.widths:
        led = problem.fit(led, _band_averages(thin, width), thin)
        tell()
    allowed = SETTINGS.first_error
    weigh = _line_weights(measured, allowed)
    fits = [problem.fit(each, weigh, measured) for each in (led, start)]
    first = min(fits, key=lambda x: problem.cost(x, weigh, measured))
    tell()
    # What comparisons tell is this cost, but for what is known beforehand, and the start costs
    # nothing there: a fit that begins at the better of both cannot end above the start.
    weigh = _line_weights(measured, SETTINGS.accuracy)
    first = min((first, start), key=lambda x: problem.cost(x, weigh, measured))
    taken = best = problem.fit(first, weigh, measured)
    tell()
    limit = problem.error(start, measured)
    for _ in range(2):
        allowed = _model_error(measured, problem.response(best, measured))
        if allowed <= SETTINGS.accuracy:
            break
        wider = _line_weights(measured, allowed)
        best = problem.fit(best, wider, measured)
        if problem.error(best, measured) <= limit:
            taken, weigh = best, wider
    tell()
    return _summarised(problem, taken, weigh, measured)


Weighing = Callable[[AnyArray], Array]
"""From a response to its weighted errors, real and imaginary parts apart."""


@dataclass(frozen=True, eq=False)
class _Problem:
    """The numbers that are fitted, as exponents or shares of their start values."""

    model: MechanicalModel
    free: tuple[FreeParameter, ...]
    silent: tuple[str, ...]

    @classmethod
    def of(cls, model: MechanicalModel, measured: MeasuredResponse) -> _Problem:
        """Return the problem, numbers that the response does not depend on left out."""
        bandwidth = 2 * np.pi * float(measured.frequency[-1])
        free = tuple(free_parameters(model, bandwidth, POLICY))
        whole = cls(model, free, ())
        thin = measured.thinned(SETTINGS.centres)
        slopes = whole.slopes(np.zeros(len(free)), _line_weights(thin, SETTINGS.first_error), thin)
        heard = np.max(np.abs(slopes), axis=0, initial=0.0) > 1e-9
        kept = tuple(f for f, use in zip(free, heard, strict=True) if use)
        silent = tuple(f.key for f, use in zip(free, heard, strict=True) if not use)
        return cls(model, kept, silent)

    def values(self, x: Array) -> dict[str, float]:
        """Return the numbers by key."""
        return {f.key: _value(f, at) for f, at in zip(self.free, x, strict=True)}

    def model_at(self, x: Array) -> MechanicalModel:
        return self.model.with_parameters(self.values(x))

    def response(self, x: Array, measured: MeasuredResponse) -> AnyArray:
        return measured.of(self.model_at(x))

    def error(self, x: Array, measured: MeasuredResponse) -> float:
        """Return the error that comparisons tell, all pairs together."""
        return combined_error(pair_errors(measured, self.response(x, measured)))

    def residuals(self, x: Array, weigh: Weighing, measured: MeasuredResponse) -> Array:
        """Return weighted errors, then what is known beforehand."""
        try:
            errors = weigh(self.response(x, measured))
        except (InvalidInputError, FloatingPointError, np.linalg.LinAlgError):
            errors = weigh(np.full(measured.values.shape, _HUGE, dtype=complex))
        known = [
            (_value(f, at) - f.centre) / f.prior
            for f, at in zip(self.free, x, strict=True)
            if np.isfinite(f.prior) and f.prior > 0
        ]
        errors = np.where(np.isfinite(errors), np.clip(errors, -_HUGE, _HUGE), 0.0)
        return np.concatenate([errors, known])

    def cost(self, x: Array, weigh: Weighing, measured: MeasuredResponse) -> float:
        return float(np.sum(self.residuals(x, weigh, measured) ** 2))

    def slopes(self, x: Array, weigh: Weighing, measured: MeasuredResponse) -> Array:
        """Return the Jacobian of the residuals by central differences."""
        columns = []
        for j in range(x.size):
            ahead, behind = x.copy(), x.copy()
            ahead[j] += SETTINGS.step
            behind[j] -= SETTINGS.step
            difference = self.residuals(ahead, weigh, measured)
            difference = difference - self.residuals(behind, weigh, measured)
            columns.append(difference / (ahead[j] - behind[j]))
        return np.column_stack(columns) if columns else np.zeros((0, 0))

    def fit(self, x: Array, weigh: Weighing, measured: MeasuredResponse) -> Array:
        """Return the least squares within the bounds, or `x` if there is nothing better."""
        if not x.size:
            return x
        low, high = np.array([_bounds(f) for f in self.free]).T
        inside = np.clip(x, low + 1e-9, high - 1e-9)
        slopes: Any = lambda at: self.slopes(at, weigh, measured)  # noqa: E731
        found = least_squares(
            lambda at: self.residuals(at, weigh, measured),
            inside,
            slopes,
            bounds=(low, high),
            x_scale="jac",
            max_nfev=SETTINGS.steps,
        )
        before = self.cost(x, weigh, measured)
        return found.x if 2 * found.cost <= before else x


def _fitted_as_logarithm(f: FreeParameter) -> bool:
    """Return whether a number keeps its sign: then its logarithm is fitted."""
    return (f.start > 0 and f.lower >= 0) or (f.start < 0 and f.upper <= 0)


def _value(f: FreeParameter, x: float) -> float:
    return float(f.start * np.exp(x)) if _fitted_as_logarithm(f) else float(f.start + f.scale * x)


def _bounds(f: FreeParameter) -> tuple[float, float]:
    """Return the bounds of what is fitted instead of a number; a factor of e^12 is no limit."""
    if not _fitted_as_logarithm(f):
        return (f.lower - f.start) / f.scale, (f.upper - f.start) / f.scale
    with np.errstate(divide="ignore"):
        ends = sorted(np.log(np.maximum(np.array([f.lower, f.upper]) / f.start, 0.0)))
    return max(ends[0], -12.0), min(ends[1], 12.0)


def _real_and_imaginary(values: AnyArray) -> Array:
    """Return real and imaginary parts, each of which has half of the variance."""
    flat = values.ravel() * np.sqrt(2)
    return np.concatenate([flat.real, flat.imag])


def _line_weights(measured: MeasuredResponse, allowed: float) -> Weighing:
    """Weigh every line by its noise and the share of its size that a model may be wrong by."""
    spread = measured.spread(allowed)
    there, values = measured.there, np.nan_to_num(measured.values)
    return lambda modelled: _real_and_imaginary(np.where(there, (modelled - values) / spread, 0.0))


def _band_averages(measured: MeasuredResponse, width: float) -> Weighing:
    """Weigh responses averaged over bands, relative to their mean size there.

    The averages are Lorentzian: as if damping of that half width were added to the machine.
    """
    frequency = measured.frequency
    take = np.unique(np.linspace(0, frequency.size - 1, SETTINGS.centres).round().astype(int))
    centre = frequency[take][:, None]
    kernel = width * centre / ((frequency - centre) ** 2 + (width * centre) ** 2)
    kernel = kernel * np.gradient(frequency)
    there, values = measured.there, np.nan_to_num(measured.values)
    total = np.maximum(kernel @ there, 1e-300)
    level = kernel @ (np.abs(values) * there) / total
    scale = 1 / np.maximum(level, 1e-300) / SETTINGS.stage_error

    def weigh(modelled: AnyArray) -> Array:
        error = np.where(there, np.nan_to_num(modelled) - values, 0.0)
        return _real_and_imaginary(kernel @ error / total * scale)

    return weigh


def _model_error(measured: MeasuredResponse, modelled: AnyArray) -> float:
    """Return the share of a line's size by which the model errs beyond the noise."""
    use = measured.there & np.isfinite(modelled)
    error = np.abs(measured.values - modelled)[use] ** 2
    size, variance = np.abs(measured.values[use]) ** 2, measured.variance[use]

    def excess(share: float) -> float:
        return float(np.mean(error / (variance + share**2 * size))) - 1

    low, high = SETTINGS.accuracy, 1.0
    if excess(low) <= 0:
        return low
    if excess(high) >= 0:
        return high
    share: Any = brentq(excess, low, high)
    return float(share)


def _summarised(problem: _Problem, x: Array, weigh: Weighing, measured: MeasuredResponse) -> Refit:
    """Return values, bounds and standard errors of a fit."""
    model = problem.model_at(x)
    relative = {
        f"{error.output}/{error.input}": error.relative
        for error in pair_errors(measured, measured.of(model))
    }
    covariance = _covariance(problem, x, weigh, measured)
    found = refit_of(model, problem.free, covariance, relative, POLICY.undetermined)
    return replace(found, undetermined=(*found.undetermined, *problem.silent))


def _covariance(
    problem: _Problem, x: Array, weigh: Weighing, measured: MeasuredResponse
) -> xr.DataArray:
    """Return the covariance of the numbers; neighbouring lines that err alike count as fewer."""
    keys = [f.key for f in problem.free]
    labels = {"parameter": keys, "other": keys}
    if not keys:
        return xr.DataArray(np.zeros((0, 0)), labels, ("parameter", "other"))
    J = problem.slopes(x, weigh, measured)
    errors = weigh(problem.response(x, measured))
    shape = measured.values.shape
    both = errors.reshape(2, *shape)
    lines = errors.size
    # The errors themselves say how large they are (White's estimate), and how much neighbours err
    # alike; the weights need not be right for that.
    many = 2 * np.count_nonzero(measured.there)
    scale = _error_correlation(both[0] + 1j * both[1]) * many / max(many - len(keys), 1)
    known = J[lines:].T @ J[lines:]
    meat = scale * (J[:lines].T * errors**2) @ J[:lines] + known
    information = J[:lines].T @ J[:lines] + known
    size = np.sqrt(np.maximum(np.diag(information), 1e-300))
    inverse = np.linalg.pinv(information / np.outer(size, size), rcond=1e-12)
    inverse = inverse @ (meat / np.outer(size, size)) @ inverse
    factor = np.array([_factor(f, at) for f, at in zip(problem.free, x, strict=True)]) / size
    return xr.DataArray(inverse * np.outer(factor, factor), labels, ("parameter", "other"))


def _factor(f: FreeParameter, x: float) -> float:
    """Return the slope of a number over what is fitted instead."""
    return _value(f, x) if _fitted_as_logarithm(f) else f.scale


def _error_correlation(errors: AnyArray) -> float:
    """Return how many neighbouring lines count as one: one plus twice their correlations."""
    power = float(np.sum(np.abs(errors) ** 2))
    if power == 0:
        return 1.0
    total = 1.0
    for lag in range(1, max(len(errors) // 10, 2)):
        alike = float(np.real(np.vdot(errors[:-lag], errors[lag:]))) / power
        if alike < 0.05:
            break
        total += 2 * alike
    return total
