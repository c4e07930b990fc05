"""Parameter estimation from measured frequency responses by weighted least squares."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from scipy.optimize import brentq, least_squares

from robustpolish.base.arrays import AnyArray, Array
from robustpolish.errors import InvalidInputError
from robustpolish.identification.fit.parameters import FreeParameter, free_parameters
from robustpolish.identification.fit.result import Refit, refit_of
from robustpolish.identification.frequency.comparison import combined_error, pair_errors
from robustpolish.identification.frequency.lines import (
    ACCURACY,
    MeasuredResponse,
    measured_response,
)
from robustpolish.identification.policy import POLICY
from robustpolish.machines.mechanical.model import MechanicalModel

# Half widths, as shares of the frequency, over which measured and modelled response are averaged
# one after the other: a resonance that is 16 % off (a spring that is 30 % off) does not overlap the
# measured one without. And the frequencies about which they are, and lines that are used there:
# widths are far above the distance of lines.
_WIDTHS, _CENTRES, _MOST_LINES = (0.3, 0.1, 0.03), 200, 1500
# Relative error that a model is allowed while responses are averaged, and in the first fit to all
# lines.
_STAGE_ERROR, _FIRST_ERROR = 0.1, 0.1
# Most evaluations of one fit, and step of differences, in units of a parameter's size: above the
# rounding of effects' slopes.
_EVALUATIONS, _STEP = 40, 1e-5
_HUGE = 1e12  # what a model that cannot be built, or is infinite, costs


def refit_frequency_response(
    model: MechanicalModel, data: Any, progress: Callable[[], None] | None = None
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
    problem = _problem(model, measured)
    tell = progress or (lambda: None)
    start = np.zeros(len(problem.free))
    thin = measured.thinned(_MOST_LINES)
    led = start
    for width in _WIDTHS:
        led = problem.fit(led, _band_averages(thin, width))
        tell()
    every = _line_weights(measured, _FIRST_ERROR)
    first = min((problem.fit(x, every) for x in (led, start)), key=lambda x: problem.cost(x, every))
    tell()
    # What comparisons tell is this cost, but for what is known beforehand, and the start costs
    # nothing there: a fit that begins at the better of both cannot end above the start.
    every = _line_weights(measured, ACCURACY)
    first = min((first, start), key=lambda x: problem.cost(x, every))
    taken = best = problem.fit(first, every)
    tell()

    def error(x: Array) -> float:
        """Return the error that comparisons tell, all pairs together."""
        return combined_error(pair_errors(measured, problem.response(x, measured)))

    for _ in range(2):
        allowed = _model_error(measured, problem.response(best, measured))
        if allowed <= ACCURACY:
            break
        wider = _line_weights(measured, allowed)
        best = problem.fit(best, wider)
        if error(best) <= error(start):
            taken, every = best, wider
    tell()
    found = problem.model_at(taken)
    errors = pair_errors(measured, measured.of(found)[0])
    relative = {f"{e.output}/{e.input}": e.relative for e in errors}
    covariance = _covariance(problem, taken, every)
    fitted = refit_of(found, problem.free, covariance, relative)
    return replace(fitted, undetermined=(*fitted.undetermined, *problem.silent))


class Weighted(NamedTuple):
    """A measured response, and what makes weighted errors of another one at its lines."""

    measured: MeasuredResponse
    weigh: Callable[[AnyArray], Array]


@dataclass(frozen=True, eq=False)
class _Problem:
    """The numbers that are fitted, as exponents or shares of their start values."""

    model: MechanicalModel
    free: tuple[FreeParameter, ...]
    silent: tuple[str, ...] = ()

    @cached_property
    def start(self) -> Array:
        return np.array([f.start for f in self.free])

    @cached_property
    def scale(self) -> Array:
        return np.array([f.scale for f in self.free])

    @cached_property
    def logarithmic(self) -> AnyArray:
        """Whether a number keeps its sign: then its logarithm is fitted."""
        ends = [(f.start > 0 and f.lower >= 0) or (f.start < 0 and f.upper <= 0) for f in self.free]
        return np.array(ends, dtype=bool)

    def values(self, x: Array) -> Array:
        """Return the numbers."""
        return np.where(self.logarithmic, self.start * np.exp(x), self.start + self.scale * x)

    def bounds(self) -> tuple[Array, Array]:
        """Return the bounds of what is fitted instead of the numbers; e^12 is no limit."""
        ends = np.array([(f.lower, f.upper) for f in self.free]).T
        with np.errstate(divide="ignore", invalid="ignore"):
            factors = np.sort(np.log(np.maximum(ends / self.start, 0.0)), axis=0)
        low, high = np.where(
            self.logarithmic, np.clip(factors, -12.0, 12.0), (ends - self.start) / self.scale
        )
        return low, high

    def model_at(self, x: Array) -> MechanicalModel:
        keys = (f.key for f in self.free)
        return self.model.with_parameters(dict(zip(keys, self.values(x).tolist(), strict=True)))

    def response(self, x: Array, measured: MeasuredResponse) -> AnyArray:
        return measured.of(self.model_at(x))[0]

    def residuals(self, x: Array, to: Weighted) -> Array:
        """Return weighted errors, then what is known beforehand."""
        try:
            errors = to.weigh(self.response(x, to.measured))
        except (InvalidInputError, FloatingPointError, np.linalg.LinAlgError):
            errors = to.weigh(np.full(to.measured.values.shape, _HUGE, dtype=complex))
        known = [
            (value - f.centre) / f.prior
            for f, value in zip(self.free, self.values(x), strict=True)
            if np.isfinite(f.prior) and f.prior > 0
        ]
        errors = np.where(np.isfinite(errors), np.clip(errors, -_HUGE, _HUGE), 0.0)
        return np.concatenate([errors, known])

    def cost(self, x: Array, to: Weighted) -> float:
        return float(np.sum(self.residuals(x, to) ** 2))

    def slopes(self, x: Array, to: Weighted) -> Array:
        """Return the Jacobian of the residuals by central differences."""
        columns = []
        for step in _STEP * np.eye(x.size):
            ahead, behind = x + step, x - step
            difference = self.residuals(ahead, to) - self.residuals(behind, to)
            columns.append(difference / np.sum(ahead - behind))
        return np.column_stack(columns) if columns else np.zeros((0, 0))

    def fit(self, x: Array, to: Weighted) -> Array:
        """Return the least squares within the bounds, or `x` if there is nothing better."""
        if not x.size:
            return x
        low, high = self.bounds()
        slopes: Any = self.slopes
        found = least_squares(
            self.residuals, np.clip(x, low + 1e-9, high - 1e-9), slopes, bounds=(low, high),
            x_scale="jac", max_nfev=_EVALUATIONS, args=(to,),
        )  # fmt: skip
        return found.x if 2 * found.cost <= self.cost(x, to) else x


def _problem(model: MechanicalModel, measured: MeasuredResponse) -> _Problem:
    """Return what is fitted, numbers that the response does not depend on left out."""
    free = free_parameters(model, 2 * np.pi * float(measured.frequency[-1]), POLICY)
    thin = _line_weights(measured.thinned(_CENTRES), _FIRST_ERROR)
    slopes = _Problem(model, tuple(free)).slopes(np.zeros(len(free)), thin)
    heard = np.max(np.abs(slopes), axis=0, initial=0.0) > 1e-9
    kept = tuple(f for f, use in zip(free, heard, strict=True) if use)
    return _Problem(model, kept, tuple(f.key for f in free if f not in kept))


def _real_and_imaginary(values: AnyArray) -> Array:
    """Return real and imaginary parts, each of which has half of the variance."""
    flat = values.ravel() * np.sqrt(2)
    return np.concatenate([flat.real, flat.imag])


def _line_weights(measured: MeasuredResponse, allowed: float) -> Weighted:
    """Weigh every line by its noise and the share of its size that a model may be wrong by."""
    spread = measured.spread(allowed)
    there, values = measured.there, np.nan_to_num(measured.values)

    def weigh(modelled: AnyArray) -> Array:
        return _real_and_imaginary(np.where(there, (modelled - values) / spread, 0.0))

    return Weighted(measured, weigh)


def _band_averages(measured: MeasuredResponse, width: float) -> Weighted:
    """Weigh responses averaged over bands, relative to their mean size there.

    The averages are Lorentzian: as if damping of that half width were added to the machine.
    """
    frequency = measured.frequency
    take = np.unique(np.linspace(0, frequency.size - 1, _CENTRES).round().astype(int))
    centre = frequency[take][:, None]
    kernel = width * centre / ((frequency - centre) ** 2 + (width * centre) ** 2)
    kernel = kernel * np.gradient(frequency)
    there, values = measured.there, np.nan_to_num(measured.values)
    total = np.maximum(kernel @ there, 1e-300)
    level = kernel @ (np.abs(values) * there) / total
    scale = 1 / np.maximum(level, 1e-300) / _STAGE_ERROR

    def weigh(modelled: AnyArray) -> Array:
        error = np.where(there, np.nan_to_num(modelled) - values, 0.0)
        return _real_and_imaginary(kernel @ error / total * scale)

    return Weighted(measured, weigh)


def _model_error(measured: MeasuredResponse, modelled: AnyArray) -> float:
    """Return the share of a line's size by which the model errs beyond the noise."""
    use = measured.there & np.isfinite(modelled)
    error = np.abs(measured.values - modelled)[use] ** 2
    size, variance = np.abs(measured.values[use]) ** 2, measured.variance[use]

    def excess(share: float) -> float:
        return float(np.mean(error / (variance + share**2 * size))) - 1

    low, high = ACCURACY, 1.0
    if excess(low) <= 0:
        return low
    if excess(high) >= 0:
        return high
    share: Any = brentq(excess, low, high)
    return float(share)


def _covariance(problem: _Problem, x: Array, to: Weighted) -> xr.DataArray:
    """Return the covariance of the numbers; neighbouring lines that err alike count as fewer."""
    keys = [f.key for f in problem.free]
    labels = {"parameter": keys, "other": keys}
    if not keys:
        return xr.DataArray(np.zeros((0, 0)), labels, ("parameter", "other"))
    J, errors = problem.slopes(x, to), to.weigh(problem.response(x, to.measured))
    real, imaginary = errors.reshape(2, *to.measured.values.shape)
    lines = errors.size
    # The errors themselves say how large they are (White's estimate), and how much neighbours err
    # alike; the weights need not be right for that.
    many = 2 * np.count_nonzero(to.measured.there)
    scale = _error_correlation(real + 1j * imaginary) * many / max(many - len(keys), 1)
    known = J[lines:].T @ J[lines:]
    meat = scale * (J[:lines].T * errors**2) @ J[:lines] + known
    information = J[:lines].T @ J[:lines] + known
    size = np.sqrt(np.maximum(np.diag(information), 1e-300))
    inverse = np.linalg.pinv(information / np.outer(size, size), rcond=1e-12)
    inverse = inverse @ (meat / np.outer(size, size)) @ inverse
    # the slopes of the numbers over what is fitted instead
    factor = np.where(problem.logarithmic, problem.values(x), problem.scale) / size
    return xr.DataArray(inverse * np.outer(factor, factor), labels, ("parameter", "other"))


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
