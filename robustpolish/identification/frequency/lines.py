"""Resonances in measured responses, with their uncertainty, and the model's modes beside them."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from scipy.ndimage import median_filter
from scipy.optimize import linear_sum_assignment
from scipy.signal import find_peaks, peak_prominences

from robustpolish.base.arrays import AnyArray, Array
from robustpolish.base.checks import described, invalid, misfit
from robustpolish.machines.mechanical import linear
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.signals.frequency_response import ratio_unit, read_frequency_response
from robustpolish.signals.raw import same_kind

# Measured frequency responses that suit a model, with what is known of their noise.


# Share of its size that a measured line is hardly better known than, whatever its noise:
# calibration and leakage. Above the noise all lines count alike, antiresonances too.
ACCURACY = 0.01
# Noise over a line's size that is taken at least, so that there is always one.
_LEAST_NOISE = 1e-6
# Lines over which the noise is taken as alike, where only the scatter shows it.
_SCATTER_LINES = 31
# Prominence in dB above which a maximum may be a resonance, half power; and times the noise that it
# has to stand above its surroundings.
_PEAK, _NOISY = 3.0, 3.0
# Times the mean square of what is left by which a pole has to lower the sum of squares: the highest
# of some hundred maxima of noise reaches a third of it.
_EVIDENT = 80.0
# Damping ratio above which a resonance has no peak worth the name.
_MOST_DAMPING = 0.5
# Largest distance of modes that are held against each other: the logarithm of the ratio of their
# frequencies, and what their shapes lack in likeness.
_ALIKE = 0.7


@dataclass(frozen=True, eq=False)
class MeasuredResponse:
    """Measured pairs of a model's outputs and inputs, as arrays over lines and pairs.

    Attributes
    ----------
    data : xarray.DataArray
        As it was given, without lines at 0 Hz.
    frequency : ndarray, shape (lines,)
        In Hz.
    pairs : tuple of (str, str)
        Output and input.
    units : tuple of str
        Of each pair, as the model says.
    values : ndarray, shape (lines, pairs)
        NaN where nothing was measured.
    variance : ndarray, shape (lines, pairs)
        Of the noise, E abs(H - E H)^2.
    known : bool
        Whether the variance was given, and not taken from the scatter of neighbouring lines.
    """

    data: xr.DataArray
    frequency: Array
    pairs: tuple[tuple[str, str], ...]
    units: tuple[str, ...]
    values: AnyArray
    variance: Array
    known: bool

    @property
    def names(self) -> tuple[str, ...]:
        """Pairs as ``output/input``."""
        return tuple(f"{output}/{source}" for output, source in self.pairs)

    @property
    def there(self) -> AnyArray:
        """Whether a line of a pair was measured, shape (lines, pairs)."""
        return np.isfinite(self.values)

    def of(self, model: MechanicalModel) -> tuple[AnyArray, list[str]]:
        """Return the response of a model at these lines and pairs, and what has to be known of it.

        Parameters
        ----------
        model : MechanicalModel

        Returns
        -------
        values : ndarray, shape (lines, pairs)
        notes : list of str
        """
        dt = self.data.attrs.get("sampling_time")
        values, notes = linear.response_values(model, self.frequency, None, dt)
        return self.chosen(model, values), notes

    def chosen(self, model: MechanicalModel, values: AnyArray) -> AnyArray:
        """Return the measured pairs of values over (lines, outputs, inputs) of a model."""
        rows = [model.output_names.index(output) for output, _ in self.pairs]
        columns = [model.input_names.index(source) for _, source in self.pairs]
        return values[:, rows, columns]

    def spread(self, share: float) -> Array:
        """Return what is not known of each line: its noise, and a share of its size.

        Parameters
        ----------
        share : float

        Returns
        -------
        ndarray, shape (lines, pairs)
            Standard deviation; 1 where nothing was measured.
        """
        size = share * np.abs(np.nan_to_num(self.values))
        return np.where(self.there, np.sqrt(self.variance + size**2), 1.0)

    def thinned(self, most: int) -> MeasuredResponse:
        """Return every so many lines, so that there are at most so many."""
        every = -(-self.frequency.size // most)
        if every == 1:
            return self
        kept = {n: getattr(self, n)[::every] for n in ("data", "frequency", "values", "variance")}
        return replace(self, **kept)


def measured_response(model: MechanicalModel | None, data: Any) -> MeasuredResponse:
    """Check that a measured response and a model belong together, and return its arrays.

    Without a model all pairs are taken as they are.

    Raises
    ------
    InvalidInputError
        If no pair is the model's, or a unit is of another kind than the model says.
    """
    if model is not None and not isinstance(model, MechanicalModel):
        raise misfit("model", type(model).__name__, "a MechanicalModel", "Read it with from_toml.")
    array = read_frequency_response(data)
    array = array.isel(frequency=array["frequency"].values > 0)
    names = [[str(name) for name in array[side].values] for side in ("output", "input")]
    pairs, units = [], []
    for output, source in itertools.product(*names):
        known = model is None or (output in model.output_names and source in model.input_names)
        curve = array.sel(output=output, input=source)
        if known and np.isfinite(curve.values).any():
            unit = str(curve["units"].item())
            units.append(unit if model is None else _unit(model, output, source, unit))
            pairs.append((output, source))
    if not pairs and model is not None:
        shown = ", ".join(map("/".join, itertools.product(*names)))
        wanted = ", ".join(f"{o}/{i}" for o in model.output_names for i in model.input_names)
        remedy = "Pass outputs= and inputs= to read_frequency_response."
        raise invalid("data", described(shown), f"pairs of the model: {wanted or 'none'}", remedy)
    rows, columns = ([known.index(pair[k]) for pair in pairs] for k, known in enumerate(names))
    values = np.asarray(array.values)[:, rows, columns]
    beside = {
        name: np.asarray(array[name].values)[:, rows, columns]
        for name in ("variance", "coherence")
        if name in array.coords
    }
    variance, known = _variance(values, beside, array.attrs.get("averages"))
    return MeasuredResponse(
        array, array["frequency"].values, tuple(pairs), tuple(units), values, variance, known
    )


def _unit(model: MechanicalModel, output: str, source: str, unit: str) -> str:
    """Return the unit that the model gives a pair, if the measured one is of its kind."""
    above = model.outputs[model.output_names.index(output)]
    below = model.inputs[model.input_names.index(source)]
    wanted = ratio_unit(model.unit_of(above), model.unit_of(below))
    converts = abs(below.gain) != 1 and below.unit is None
    if not converts and wanted and not same_kind(unit, wanted):
        remedy = "Correct the unit, or the quantity of the model's output (displacement, velocity, "
        remedy += "acceleration)."
        shown = described(f"a response in {unit}")
        raise invalid(f"{output}/{source}", shown, f"{wanted}, as the model says", remedy)
    return wanted


def _variance(
    values: AnyArray, beside: dict[str, Array], averages: float | None
) -> tuple[Array, bool]:
    """Return the variance of the noise, and whether the data say it themselves."""
    size = np.nan_to_num(np.abs(values) ** 2)
    least = _LEAST_NOISE**2 * np.maximum(size, 1e-12 * np.max(size, axis=0))
    if "variance" in beside:
        return np.maximum(np.nan_to_num(beside["variance"]), least), True
    if "coherence" in beside:
        coherence = np.clip(beside["coherence"], 1e-6, 1.0)
        shape = size * (1 - coherence) / coherence
        if averages:
            return np.maximum(np.nan_to_num(shape / averages), least), True
        # Of how many averages is not known: as large as neighbouring lines scatter.
        seen = _scatter(values, len(values))
        typical = np.nanmedian(np.where(shape > 0, shape, np.nan), axis=0)
        ratio = np.where(typical > 0, seen[0] / np.where(typical > 0, typical, 1.0), 0.0)
        return np.maximum(np.nan_to_num(shape * ratio), least), False
    return np.maximum(_scatter(values, _SCATTER_LINES), least), False


def _scatter(values: AnyArray, width: int) -> Array:
    """Return the noise that third differences over neighbouring lines show.

    They are blind to what is smooth, and their median to resonances of few lines. The factors are
    the noise gain of the difference, and median over mean of an exponential distribution.
    """
    lines = len(values)
    if lines < 8:
        return np.zeros(values.shape)
    rough = np.abs(np.diff(values, 3, axis=0)) ** 2 / (20 * np.log(2))
    rough = np.concatenate([rough[:1], rough, rough[-1:], rough[-1:]])
    rough = np.where(np.isfinite(rough), rough, np.nanmedian(rough, axis=0))
    return median_filter(rough, (min(width, lines) | 1, 1), mode="nearest")


class Resonance(NamedTuple):
    """A pole that shows in a response.

    Attributes
    ----------
    frequency, frequency_error : float
        Undamped natural frequency in Hz, with its standard error; 0 for a model's own.
    damping, damping_error : float
        Damping ratio, likewise.
    shape : ndarray, shape (pairs,)
        Complex residues: how strongly each pair shows it.
    """

    frequency: float
    frequency_error: float
    damping: float
    damping_error: float
    shape: AnyArray


def likeness(first: AnyArray, second: AnyArray) -> float:
    """Return the modal assurance criterion of two shapes, from 0 to 1."""
    size = float(np.linalg.norm(first) * np.linalg.norm(second))
    return float(abs(np.vdot(first, second)) / size) ** 2 if size > 0 else 0.0


def model_resonances(model: MechanicalModel, measured: MeasuredResponse) -> tuple[Resonance, ...]:
    """Return the modes of a model, effects linearised, as the measured pairs show them.

    Parameters
    ----------
    model : MechanicalModel
    measured : MeasuredResponse

    Returns
    -------
    tuple of Resonance
        From low to high frequency.
    """
    (A, B, C, _), _ = linear.linear_system(model)
    poles, right = np.linalg.eig(A)
    left = np.linalg.pinv(right)
    residues = np.einsum("ok,ki->koi", C @ right, left @ B)
    residues = residues * linear.sensor_gains(model)[:, None] * linear.signal_gains(model)
    signals = model.matrices.sources
    columns = [signals.index(name) for name in model.input_names]
    shapes = measured.chosen(model, residues[:, :, columns])
    found = [
        Resonance(float(abs(pole)) / (2 * np.pi), 0.0, float(-pole.real / abs(pole)), 0.0, shape)
        for pole, shape in zip(poles, shapes, strict=True)
        if pole.imag > 1e-9 * abs(pole)
    ]
    return tuple(sorted(found, key=lambda mode: mode.frequency))


def measured_resonances(measured: MeasuredResponse) -> tuple[Resonance, ...]:
    """Find the resonances that stand out of measured responses.

    About each maximum of the pairs together one pole is fitted to all pairs, with a straight line
    for what other modes add there.

    Parameters
    ----------
    measured : MeasuredResponse

    Returns
    -------
    tuple of Resonance
        From low to high frequency.
    """
    values = np.where(measured.there, measured.values, 0.0)
    size = np.abs(values) ** 2
    typical = np.array([np.median(column[column > 0]) for column in size.T])
    sum_ = np.sum(size / typical, axis=1)
    noise = np.sqrt(np.sum((measured.variance / typical) * size / typical, axis=1))
    decibels = 10 * np.log10(np.maximum(sum_, 1e-300))
    scatter = 20 / np.log(10) * np.minimum(noise / np.maximum(sum_, 1e-300), 1.0)
    tops, _ = find_peaks(decibels)
    prominence = peak_prominences(decibels, tops)[0]
    tops = tops[prominence > _PEAK + _NOISY * scatter[tops]]
    found: list[Resonance] = []
    for i, top in enumerate(tops):
        lowest = tops[i - 1] + int(np.argmin(sum_[tops[i - 1] : top])) if i else 0
        last = i + 1 < len(tops)
        highest = top + int(np.argmin(sum_[top : tops[i + 1]])) if last else len(sum_) - 1
        mode = _fit_pole(measured, values, sum_, top, (lowest, highest))
        if mode is not None:
            found.append(mode)
    return tuple(found)


def match_modes(
    modelled: tuple[Resonance, ...], measured: tuple[Resonance, ...]
) -> list[tuple[int, int]]:
    """Return which mode of a model belongs to which measured one, by frequency and shape.

    Parameters
    ----------
    modelled, measured : tuple of Resonance

    Returns
    -------
    list of (int, int)
        Positions; modes without a partner are left out.
    """
    if not modelled or not measured:
        return []

    def apart(ours: Resonance, theirs: Resonance) -> float:
        alike = likeness(ours.shape, theirs.shape)
        return abs(np.log(ours.frequency / theirs.frequency)) + 0.5 * (1 - alike)

    cost = np.array([[apart(ours, theirs) for theirs in measured] for ours in modelled])
    # Beyond the limit all are equally bad, so that one stray peak moves no other.
    rows, columns = linear_sum_assignment(np.minimum(cost, _ALIKE))
    pairs = zip(rows.tolist(), columns.tolist(), strict=True)
    return [(i, j) for i, j in pairs if cost[i, j] < _ALIKE]


def _fit_pole(
    measured: MeasuredResponse, values: AnyArray, sum_: Array, top: int, valley: tuple[int, int]
) -> Resonance | None:
    """Fit a pole to the lines about a maximum; None if there is none."""
    omega = 2 * np.pi * measured.frequency
    half = [_half_power(sum_, top, valley, side) for side in (-1, 1)]
    reach = 2 * max(half) + 2
    first, last = max(top - reach, valley[0]), min(top + reach, valley[1])
    lines = slice(first, last + 1)
    count = last + 1 - first
    if count < 5:
        return None
    w, H = omega[lines], values[lines]
    there = measured.there[lines]
    level = np.sqrt(np.mean(np.abs(H) ** 2, axis=0))
    weight = there / np.sqrt(measured.variance[lines] + (0.01 * level) ** 2 + 1e-300)
    x = (w - omega[top]) / max(w[-1] - w[0], 1e-300)
    background = np.column_stack([np.ones(count), x] if count > 6 else [np.ones(count)])
    width = max((omega[min(top + half[1], len(omega) - 1)] - omega[max(top - half[0], 0)]) / 2,
                float(np.min(np.diff(w))) / 2)  # fmt: skip
    pole = complex(-width, omega[top])
    for _ in range(30):
        residual, slopes, _ = _projected(pole, w, H, weight, background)
        step, *_ = np.linalg.lstsq(_parts(slopes), -_parts(residual), rcond=1e-12)
        change = complex(*step)
        limit = abs(pole.real) + float(np.min(np.diff(w)))
        if abs(change) > limit:
            change *= limit / abs(change)
        pole += change
        if pole.real >= 0:  # a response that stable machines show has its poles on the left
            pole = complex(-0.5 * abs(pole.real - change.real), pole.imag)
        if abs(change) < 1e-10 * abs(pole):
            break
    residual, slopes, shape = _projected(pole, w, H, weight, background)
    damping = -pole.real / abs(pole)
    inside = w[0] <= pole.imag <= w[-1]
    if not inside or not 0 < damping < _MOST_DAMPING:
        return None
    # What the pole explains has to stand above what is left.
    free = 2 * (np.count_nonzero(weight) - H.shape[1] * (1 + background.shape[1])) - 2
    if free < 1:
        return None
    left = float(np.sum(np.abs(residual) ** 2)) / free
    J = _parts(slopes)
    covariance = np.linalg.pinv(J.T @ J) * left
    without = _background_only(H, weight, background)
    if without - np.sum(np.abs(residual) ** 2) < _EVIDENT * left:
        return None
    height = np.abs(shape) / -pole.real / np.max(np.abs(H), axis=0)
    spread = float(np.sqrt(covariance[0, 0]))
    if np.max(height) < 0.3 or spread > -pole.real:
        return None
    by_frequency = np.array([pole.real, pole.imag]) / abs(pole)
    by_damping = np.array([-1.0, 0.0]) / abs(pole) - damping * by_frequency / abs(pole)
    errors = [float(np.sqrt(max(g @ covariance @ g, 0.0))) for g in (by_frequency, by_damping)]
    scale = 2 * np.pi
    return Resonance(abs(pole) / scale, errors[0] / scale, float(damping), errors[1], shape)


def _background_only(H: AnyArray, weight: Array, background: Array) -> float:
    """Return the weighted sum of squares that the background leaves."""
    total = 0.0
    for j in range(H.shape[1]):
        Q, _ = np.linalg.qr(background * weight[:, [j]])
        target = H[:, j] * weight[:, j]
        total += float(np.sum(np.abs(target - Q @ (Q.T @ target)) ** 2))
    return total


def _parts(values: AnyArray) -> Array:
    """Return real parts above imaginary ones."""
    return np.concatenate([np.real(values), np.imag(values)])


def _projected(
    pole: complex, w: Array, H: AnyArray, weight: Array, background: Array
) -> tuple[AnyArray, AnyArray, AnyArray]:
    """Return weighted residuals, their slopes over the pole's parts, and the residues.

    Residues and background follow by linear least squares for each pole (variable projection,
    with Kaufman's slopes).
    """
    by_pole = 1 / (1j * w - pole)
    residuals, slopes, shape = [], [], []
    for j in range(H.shape[1]):
        scale = weight[:, j]
        basis = np.column_stack([by_pole, background]) * scale[:, None]
        Q, R = np.linalg.qr(basis)
        target = H[:, j] * scale
        parts = Q.conj().T @ target
        coefficients = np.linalg.lstsq(R, parts, rcond=1e-14)[0]
        residuals.append(Q @ parts - target)
        moved = coefficients[0] * by_pole**2 * scale
        moved = moved - Q @ (Q.conj().T @ moved)
        slopes.append(np.column_stack([moved, 1j * moved]))
        shape.append(coefficients[0])
    return np.concatenate(residuals), np.concatenate(slopes), np.array(shape)


def _half_power(sum_: Array, top: int, valley: tuple[int, int], side: int) -> int:
    """Return how many lines aside of a maximum the power has halved."""
    end = valley[0] if side < 0 else valley[1]
    i = top
    while i != end and sum_[i] > sum_[top] / 2:
        i += side
    return abs(i - top)
