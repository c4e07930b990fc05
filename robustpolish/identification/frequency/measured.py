"""Measured frequency responses that suit a model, with what is known of their noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from scipy.ndimage import median_filter

from robustpolish.arrays import AnyArray, Array
from robustpolish.measurements import ratio_unit, read_frequency_response, same_kind
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.frequency_response import response_values
from robustpolish.validation import described, invalid


@dataclass(frozen=True)
class FrequencyPolicy:
    """The numbers that steer fits and judgements of frequency responses.

    Attributes
    ----------
    widths : tuple of float
        Half widths, as shares of the frequency, over which measured and modelled response are
        averaged one after the other: a resonance that is 16 % off (a spring that is 30 % off)
        does not overlap the measured one without.
    accuracy : float
        Share of its size that a measured line is hardly better known than, whatever its noise:
        calibration and leakage. Above the noise all lines count alike, antiresonances too.
    stage_error, first_error : float
        Relative error that a model is allowed while responses are averaged, and in the first fit
        to all lines.
    least_noise : float
        Noise over a line's size that is taken at least, so that there is always one.
    most_lines : int
        Lines used while responses are averaged: widths are far above the distance of lines.
    centres : int
        Frequencies about which responses are averaged.
    steps : int
        Most evaluations of one fit.
    step : float
        Of differences, in units of a parameter's size: above the rounding of effects' slopes.
    scatter : int
        Lines over which the noise is taken as alike, where only the scatter shows it.
    peak : float
        Prominence in dB above which a maximum may be a resonance: half power.
    noisy : float
        Times the noise that a resonance has to stand above its surroundings.
    evident : float
        Times the mean square of what is left by which a pole has to lower the sum of squares:
        the highest of some hundred maxima of noise reaches a third of it.
    changed : float
        Standard errors beyond which a mode's frequency or damping depends on the amplitude.
    same_frequency, same_damping : float
        Relative errors that the fit of a single pole makes anyway: its neighbours, leakage.
    most_damping : float
        Damping ratio above which a resonance has no peak worth the name.
    alike : float
        Largest distance of modes that are held against each other: the logarithm of the ratio of
        their frequencies, and what their shapes lack in likeness.
    undetermined : float
        Standard error over the value from which a number is called undetermined, as in a refit to
        records.
    """

    widths: tuple[float, ...] = (0.3, 0.1, 0.03)
    accuracy: float = 0.01
    stage_error: float = 0.1
    first_error: float = 0.1
    least_noise: float = 1e-6
    most_lines: int = 1500
    centres: int = 200
    steps: int = 40
    step: float = 1e-5
    scatter: int = 31
    peak: float = 3.0
    noisy: float = 3.0
    evident: float = 80.0
    changed: float = 4.0
    same_frequency: float = 1e-4
    same_damping: float = 0.03
    most_damping: float = 0.5
    alike: float = 0.7
    undetermined: float = 1 / 3


FREQUENCY_POLICY = FrequencyPolicy()
"""What comparisons with and fits to frequency responses go by."""


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

    def of(self, model: MechanicalModel) -> AnyArray:
        """Return the response of a model at these lines and pairs.

        Parameters
        ----------
        model : MechanicalModel

        Returns
        -------
        ndarray, shape (lines, pairs)
        """
        dt = self.data.attrs.get("sampling_time")
        return self.chosen(model, response_values(model, self.frequency, None, dt)[0])

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
        take = slice(None, None, every)
        return MeasuredResponse(
            self.data[take], self.frequency[take], self.pairs, self.units, self.values[take],
            self.variance[take], self.known,
        )  # fmt: skip


def measured_response(
    model: MechanicalModel | None, data: Any, policy: FrequencyPolicy = FREQUENCY_POLICY
) -> MeasuredResponse:
    """Check that a measured response and a model belong together, and return its arrays.

    Without a model all pairs are taken as they are.

    Raises
    ------
    InvalidInputError
        If no pair is the model's, or a unit is of another kind than the model says.
    """
    if model is not None and not isinstance(model, MechanicalModel):
        shown = described(type(model).__name__)
        raise invalid("model", shown, "a MechanicalModel", "Read it with from_toml.")
    array = read_frequency_response(data)
    array = array.isel(frequency=array["frequency"].values > 0)
    pairs, units = [], []
    for output in (str(name) for name in array["output"].values):
        for source in (str(name) for name in array["input"].values):
            curve = array.sel(output=output, input=source)
            if not np.isfinite(curve.values).any():
                continue
            if model is None:
                units.append(str(curve["units"].item()))
                pairs.append((output, source))
            elif output in model.output_names and source in model.input_names:
                units.append(_unit(model, output, source, str(curve["units"].item())))
                pairs.append((output, source))
    if not pairs and model is not None:
        shown = [f"{o}/{i}" for o in array["output"].values for i in array["input"].values]
        wanted = [f"{o}/{i}" for o in model.output_names for i in model.input_names]
        raise invalid(
            "data",
            described(", ".join(shown)),
            f"pairs of the model: {', '.join(wanted) or 'none'}",
            "Pass outputs= and inputs= to read_frequency_response.",
        )
    names = [list(array[dimension].values) for dimension in ("output", "input")]
    rows, columns = ([known.index(pair[k]) for pair in pairs] for k, known in enumerate(names))
    values = np.asarray(array.values)[:, rows, columns]
    beside = {
        name: np.asarray(array[name].values)[:, rows, columns]
        for name in ("variance", "coherence")
        if name in array.coords
    }
    variance, known = _variance(values, beside, array.attrs.get("averages"), policy)
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
        raise invalid(
            f"{output}/{source}",
            described(f"a response in {unit}"),
            f"{wanted}, as the model says",
            "Correct the unit, or the quantity of the model's output (displacement, velocity, "
            "acceleration).",
        )
    return wanted


def _variance(
    values: AnyArray, beside: dict[str, Array], averages: float | None, policy: FrequencyPolicy
) -> tuple[Array, bool]:
    """Return the variance of the noise, and whether the data say it themselves."""
    size = np.nan_to_num(np.abs(values) ** 2)
    least = policy.least_noise**2 * np.maximum(size, 1e-12 * np.max(size, axis=0))
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
    return np.maximum(_scatter(values, policy.scatter), least), False


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
