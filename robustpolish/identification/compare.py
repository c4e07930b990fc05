"""Comparison of models with measured data by simulation: free runs, windows, predictions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, overload

import control
import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.signal import periodogram

from robustpolish.base.arrays import Array
from robustpolish.base.budget import single_threaded_blas
from robustpolish.base.checks import described, invalid, one_of, positive
from robustpolish.base.results import Card, Displayed, Table
from robustpolish.errors import RobustPolishError
from robustpolish.identification import free_runs
from robustpolish.identification.diagnosis import Diagnosis
from robustpolish.identification.fit.prepared import has_integrator, window_samples
from robustpolish.identification.frequency.comparison import (
    FrequencyComparison,
    compare_frequency_response,
)
from robustpolish.identification.observer.runs import Reproducibility, free_run
from robustpolish.identification.record import Record, measured, repeats
from robustpolish.identification.sanity import sanity_warnings
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.plots.time import plot_before_and_after, plot_overlay, plot_response
from robustpolish.signals.frequency_response import holds_frequency_response
from robustpolish.signals.raw import sampling_time

# Result of a comparison.


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(free_runs.ErrorsByOutput, Displayed):
    """Comparison of a model with data.

    Attributes
    ----------
    model : MechanicalModel
    data : xarray.Dataset
        Inputs and measured outputs over ``time``. Several records stand one behind the other, over
        a time that runs on; their coordinates ``record`` and ``own_time`` say which and when.
    simulated : xarray.Dataset
        The model's outputs; NaN where there is no prediction yet.
    outputs : dict of str to OutputError
        Errors by output, over all records.
    method : str
        ``"free run"``, ``"windows"`` or ``"prediction"``.
    span : float or None
        Length of the windows, or the prediction horizon, in s.
    starts : ndarray, shape (runs, n)
        Estimated starts: free displacements, velocities, internal states of effects.
    reproducibility : Reproducibility
        Of several records that of the first whose run is not reproducible, if there is one.
    band : xarray.Dataset or None
        Half width of the 95 % band of the simulated outputs that the parameters' standard errors
        cause, if these were given.
    notes : tuple of str
        What has to be known to judge the figures.
    records : dict of str to RecordError
        The errors of each record by its name, ``"record 1"`` if it has none.

    Examples
    --------
    >>> import robustpolish as rp
    >>> model, data = rp.datasets.sticky_slide()
    >>> comparison = rp.compare(model, data)
    >>> comparison.reproducible, comparison.outputs["x"].unit
    (True, 'm')
    >>> sorted(comparison.to_dict()["outputs"]["x"])
    ['fit_percent', 'nrmse', 'rmse', 'rmse_band', 'unit']
    >>> comparison.plot().get_ylabel()
    'x [mm]'
    >>> len(comparison.plot_panels().axes)  # overlay, residual and spectra
    3
    """

    model: MechanicalModel
    data: xr.Dataset
    simulated: xr.Dataset
    outputs: Mapping[str, free_runs.OutputError]
    method: str
    span: float | None
    starts: np.ndarray
    reproducibility: Reproducibility
    band: xr.Dataset | None = None
    notes: tuple[str, ...] = field(default_factory=tuple)
    records: Mapping[str, free_runs.RecordError] = field(default_factory=dict)

    @property
    def reproducible(self) -> bool:
        """Whether the runs can be repeated; if not, their error judges nothing."""
        return self.reproducibility.reproducible

    @property
    def measured(self) -> xr.Dataset:
        """The measured outputs."""
        return self.data[list(self.outputs)]

    @property
    def residual(self) -> xr.Dataset:
        """Measured minus simulated outputs."""
        result = self.measured - self.simulated
        for name, error in self.outputs.items():
            result[name].attrs["units"] = error.unit
        result["time"].attrs.update(self.data["time"].attrs)
        return result

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as in the JSON of ``robustpolish compare``.

        Returns
        -------
        dict
        """
        figures = ("nrmse", "fit_percent", "rmse", "unit")
        return {
            "outputs": {
                name: {key: getattr(error, key) for key in figures} | {"rmse_band": [*error.band]}
                for name, error in self.outputs.items()
            },
            "overall": {"nrmse": self.nrmse, "fit_percent": self.fit_percent},
            "method": self.method,
            "span": self.span,
            "reproducible": self.reproducible,
            "records": free_runs.records_content(self.records),
            "notes": list(self.notes),
        }

    def plot(self, ax: Axes | None = None, *, output: str | None = None) -> Axes:
        """Draw one output as measured and as simulated.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.
        output : str, optional
            The one with the largest error by default.

        Returns
        -------
        matplotlib.axes.Axes
            With the band that uncertain parameters cause, if their standard errors were given.
        """
        worst = max(self.outputs, key=lambda name: self.outputs[name].nrmse)
        name = worst if output is None else one_of("output", output, tuple(self.outputs))
        band = None if self.band is None else self.band[name]
        return plot_response(self.measured[name], self.simulated[name], band, ax)

    def plot_panels(self) -> Figure:
        """Draw all outputs: measured and simulated, residuals, and the spectra of both.

        Returns
        -------
        matplotlib.figure.Figure
        """
        return plot_overlay(self.measured, self.simulated, self.band)

    def _card(self) -> Card:
        how = self.method if self.span is None else f"{self.method} of {self.span:.6g} s"
        rows = tuple(
            (e.name, float(f"{e.fit_percent:.2f}"), e.nrmse, e.rmse, *e.band, e.unit)
            for e in self.outputs.values()
        )
        columns = ("output", "fit [%]", "NRMSE", "RMS error", "95 % from", "to", "unit")
        title = f"Comparison ({how}), fit {self.fit_percent:.2f} %"
        return Card(
            title, (Table("", columns, rows), *free_runs.records_table(self.records)), self.notes
        )


@overload
def compare(
    model: MechanicalModel, data: xr.DataArray | control.FrequencyResponseData
) -> FrequencyComparison: ...


@overload
def compare(
    model: MechanicalModel,
    data: str | Path,
    *,
    window: float | None = ...,
    horizon: float | None = ...,
    standard_errors: Mapping[str, float] | None = ...,
    outputs: Sequence[str] | None = ...,
) -> Comparison | FrequencyComparison: ...


@overload
def compare(
    model: MechanicalModel,
    data: xr.Dataset | pd.DataFrame | Sequence[Any] | Mapping[str, Any],
    *,
    window: float | None = ...,
    horizon: float | None = ...,
    standard_errors: Mapping[str, float] | None = ...,
    outputs: Sequence[str] | None = ...,
) -> Comparison: ...


@single_threaded_blas
def compare(
    model: MechanicalModel,
    data: Any,
    *,
    window: float | None = None,
    horizon: float | None = None,
    standard_errors: Mapping[str, float] | None = None,
    outputs: Sequence[str] | None = None,
) -> Comparison | FrequencyComparison:
    """Simulate a model on measured inputs and compare its outputs with the measured ones.

    By default in one free run from an estimated start: the model sees the inputs, never the
    outputs (but for the few numbers of the start). Measured frequency responses are compared
    with those of the model, effects linearised.

    Parameters
    ----------
    model : MechanicalModel
    data : xarray.Dataset, path or pandas.DataFrame, or a sequence or mapping of them
        Inputs and outputs by the names in the model, in SI units. Several records are run one by
        one, each from a start of its own and on its own clock; they may differ in length, and in
        sampling rate by whole factors. Or frequency responses, as
        :func:`robustpolish.read_frequency_response` reads and returns them.
    window : float, optional
        Length in s of free runs that start anew, for plants that drift or are chaotic.
    horizon : float, optional
        Predict this far ahead, in s, from a state that an observer estimates from the outputs up
        to then; 0 is one sample ahead. Excludes `window`.
    standard_errors : mapping of str to float, optional
        Standard errors of parameters by their keys in ``model.parameters``; they give the band of
        the simulated outputs, the parameters being taken as independent.
    outputs : sequence of str, optional
        Outputs that are used and that the data must hold. By default those that the data hold, and
        ``notes`` names the others.

    Returns
    -------
    Comparison
        With the errors over all records together, and of each in ``records``. A
        FrequencyComparison for frequency responses.

    Raises
    ------
    InvalidInputError
        If a column is missing, in another unit or not finite, time is not uniform, the sampling
        rate is too low for the model's modes, or `window` or `horizon` do not fit the record; if
        there is no record, or several that differ in their channels.

    Notes
    -----
    The fit is 100 (1 - ||y - yhat|| / ||y - mean(y)||), as in MATLAB's ``compare`` (L. Ljung,
    System Identification Toolbox). The band of the RMS error comes from the variance of the mean
    square over blocks, long against the memory of the error.

    Examples
    --------
    >>> import numpy as np
    >>> import xarray as xr
    >>> import robustpolish as rp
    >>> model = rp.MechanicalModel(
    ...     [rp.Dof("x", 1.0)],
    ...     [rp.Spring(("x", "ground"), 4.0)],
    ...     outputs=[rp.Output("x", ("x", "ground"))],
    ... )
    >>> time = np.arange(1000) * 0.01
    >>> decay = np.cos(2 * time)  # a free decay of just this oscillator
    >>> data = xr.Dataset({"x": ("time", decay, {"units": "m"})}, {"time": time})
    >>> print(f"{rp.compare(model, data).fit_percent:.3f} %")
    100.000 %
    >>> both = rp.compare(model, {"large": data, "small": 0.1 * data})
    >>> [f"{name}: {error.fit_percent:.3f} %" for name, error in both.records.items()]
    ['large: 100.000 %', 'small: 100.000 %']
    """
    if holds_frequency_response(data):
        given = {"window": window, "horizon": horizon, "standard_errors": standard_errors}
        for name, value in given.items():
            if value is not None:
                shown = described(f"{value} for frequency responses")
                raise invalid(name, shown, "a record over time", "Leave it out.")
        return compare_frequency_response(model, data)
    if window is not None and horizon is not None:
        raise invalid("horizon", horizon, "either a window or a horizon", "Leave one of them out.")
    model, record, left_out = measured(model, data, outputs)
    run = free_run(model, record)
    if window is not None:
        method, span = "windows", positive("window", window, "s")
    elif horizon is not None:
        method, span = "prediction", positive("horizon", horizon, "s", zero=True)
    else:
        method, span = "free run", None
    found = [free_runs.simulated_record(run, part, method, span) for part in record.parts]
    notes: list[str] = [*left_out, *(str(note) for note in record.data.attrs.get("notes", ()))]
    several = len(found) > 1
    for data_set, part in zip(record.sets, found, strict=True):
        free = _dataset(model, part.outputs, data_set["time"]) if method == "free run" else None
        said = [part.found.reason] if part.found.reason else []
        said += sanity_warnings(model, data_set, free)
        notes += [f"{part.record.name}: {note}" if several else note for note in said]
    if (repeated := repeats(model, record)) is not None:  # no model can do better
        sizes = zip(model.outputs, repeated.noise, strict=True)
        told = ", ".join(f"{o.name} {size:.3g} {model.unit_of(o)}" for o, size in sizes)
        notes.append(f"{repeated.names} repeat each other; they differ by noise of {told}")

    def simulate(changed: MechanicalModel) -> Array:
        """Simulate a changed model in the same way, from the same starts."""
        run = free_run(changed, record)
        if horizon is not None:
            return np.concatenate(
                [free_runs.predict(run, part.record, horizon)[0] for part in found]
            )
        pieces = (piece for part in found for piece in part.pieces)
        return np.concatenate([run.over(piece).outputs for piece in pieces])

    simulated, band = np.concatenate([part.outputs for part in found]), None
    if standard_errors:
        values, nominal = model.parameters, simulate(model)
        variance = np.zeros_like(nominal)  # of the simulated outputs, to first order
        for key, error in standard_errors.items():
            if key not in values:
                wanted = f"keys among {', '.join(values)}"
                raise invalid("standard_errors", described(f"{key!r}"), wanted, "Correct the key.")
            size = positive(f"standard_errors[{key!r}]", error, zero=True)
            if size > 0:  # Upwards only: a mass or a gap must not become negative.
                ahead = simulate(model.with_parameters({key: values[key] + size}))
                variance += (ahead - nominal) ** 2
        band = _dataset(model, 1.96 * np.sqrt(variance), record.data["time"])
    worst = min(found, key=lambda part: part.found.reproducible)
    return Comparison(
        model, record.data, _dataset(model, simulated, record.data["time"]),
        free_runs.output_errors(model, found), method, span,
        starts=np.concatenate([part.starts for part in found]), reproducibility=worst.found,
        band=band, notes=tuple(dict.fromkeys(notes)), records=free_runs.record_errors(model, found),
    )  # fmt: skip


def _dataset(model: MechanicalModel, values: Array, time: xr.DataArray) -> xr.Dataset:
    return xr.Dataset(
        {
            item.name: ("time", values[:, i], {"units": model.unit_of(item)})
            for i, item in enumerate(model.outputs)
        },
        coords={"time": time},
    )


# Free runs of the model after each step of a diagnosis.

# Swings of the strongest line in the stretch that is shown: so many can be followed by eye in a
# column of six inches.
_SWINGS_SHOWN = 8.0


@dataclass(frozen=True, eq=False, repr=False)
class StepRun(Displayed):
    """Free run of the model after one step of a diagnosis, compared with the record.

    Attributes
    ----------
    step : str
        As in the ledger.
    before : Comparison or None
        The model before this step; None for the first.
    after : Comparison
        The model after it.

    Examples
    --------
    >>> import robustpolish as rp
    >>> model, data = rp.datasets.sticky_slide()
    >>> part = data.isel(time=slice(0, 500))
    >>> last = rp.identification.step_runs(rp.diagnose(model, part), part)[-1]
    >>> last.step, last.worst, last.stretch()
    ('coulomb_friction at x, ground', 'x', None)
    >>> last.plot().get_xlabel(), len(last.plot_panels().axes)
    ('time [ms]', 2)
    """

    step: str
    before: Comparison | None
    after: Comparison

    @property
    def worst(self) -> str:
        """The output whose error was the largest share of its motion before."""
        outputs = (self.before or self.after).outputs
        return max(outputs, key=lambda name: outputs[name].nrmse)

    def stretch(self, output: str | None = None) -> slice | None:
        """Return where the step did most for an output, some swings long.

        Parameters
        ----------
        output : str, optional
            The worst by default.

        Returns
        -------
        slice of float or None
            Times in s; None if the whole record has no more swings.
        """
        name, data = self._named(output), self.after.data
        y, step = np.asarray(data[name].values, dtype=float), sampling_time(data)
        frequency, power = periodogram(y, 1 / step, window="hann", detrend="linear")
        strongest = max(frequency[1 + int(np.argmax(power[1:]))], frequency[1])
        samples = round(_SWINGS_SHOWN / float(strongest) / step)
        if 2 * samples >= y.size:
            return None
        # the squared error that the step took away, sample by sample
        runs = (run.simulated[name].values for run in (self.before, self.after) if run is not None)
        left = [np.nan_to_num((y - run) ** 2) for run in runs]
        gain = left[0] - left[-1] if len(left) > 1 else left[0]
        total = np.concatenate([[0.0], np.cumsum(gain)])
        first = int(np.argmax(total[samples:] - total[:-samples]))
        time = data["time"].values
        return slice(float(time[first]), float(time[first + samples - 1]))

    def plot(self, ax: Axes | None = None, *, output: str | None = None) -> Axes:
        """Draw an output as measured and as the model makes it after this step.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.
        output : str, optional
            The worst by default.

        Returns
        -------
        matplotlib.axes.Axes
        """
        name, stretch = self._named(output), self.stretch(output)
        signals = (run[name] for run in (self.after.data, self.after.simulated))
        measured, simulated = (s if stretch is None else s.sel(time=stretch) for s in signals)
        return plot_response(measured, simulated, ax=ax)

    def plot_panels(self, *, output: str | None = None, width: float = 9.0) -> Figure:
        """Draw an output as measured and with the models before and after, and the residual.

        Parameters
        ----------
        output : str, optional
            The worst by default.
        width : float, optional
            Inches.

        Returns
        -------
        matplotlib.figure.Figure
        """
        name = self._named(output)
        after = self.after.simulated[name]
        measured = self.after.data[name].assign_attrs(after.attrs)
        before = None if self.before is None else self.before.simulated[name]
        return plot_before_and_after(measured, before, after, self.stretch(name), width)

    def _named(self, output: str | None) -> str:
        return self.worst if output is None else one_of("output", output, tuple(self.after.outputs))

    def _card(self) -> Card:
        before = {} if self.before is None else self.before.outputs
        rows = tuple(
            (name, before[name].rmse if name in before else None, error.rmse, error.unit)
            for name, error in self.after.outputs.items()
        )
        head = ("output", "error before", "error after", "unit")
        return Card(f"{self.step}, {self.after.method}", (Table("", head, rows),))


def comparison_window(model: MechanicalModel, record: Record, reproducible: bool) -> float | None:
    """Return the length in s of the windows in which a model is compared, None for one free run.

    Models whose long runs judge nothing, and those that drift, run in short windows.
    """
    whole = reproducible and not has_integrator(model, record.samples * record.dt)
    return None if whole else window_samples(record.samples) * record.dt


def step_runs(diagnosis: Diagnosis, data: Any) -> tuple[StepRun, ...]:
    """Run the model of every step of a diagnosis over a record, freely.

    Parameters
    ----------
    diagnosis : Diagnosis
    data : xarray.Dataset
        The record that was diagnosed, or one that it never saw.

    Returns
    -------
    tuple of StepRun
        In the order of the ledger. Steps whose model cannot be run are left out, as are those of
        diagnoses that older versions saved. Models whose long runs judge nothing, and those that
        drift, run in short windows.

    Raises
    ------
    InvalidInputError
        If columns are missing.

    Examples
    --------
    >>> import robustpolish as rp
    >>> model, data = rp.datasets.sticky_slide()
    >>> part = data.isel(time=slice(0, 500))
    >>> runs = rp.identification.step_runs(rp.diagnose(model, part), part)
    >>> [run.step for run in runs]
    ['base', 'refit', 'coulomb_friction at x, ground']
    """
    record = measured(diagnosis.model, data).record
    data = record.data
    found: list[StepRun] = []
    for entry in diagnosis.ledger.entries:
        if entry.model is None:
            continue
        window = comparison_window(entry.model, record, diagnosis.reproducible)
        with suppress(RobustPolishError):  # as the diagnosis held it against the data
            after: Any = compare(entry.model, data, window=window)
            found.append(StepRun(entry.step, found[-1].after if found else None, after))
    return tuple(found)
