"""Free runs of the model after each step of a diagnosis, compared with the record."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.signal import periodogram

from robustpolish.base.arrays import Array
from robustpolish.base.checks import one_of
from robustpolish.base.results import Card, Displayed, Table
from robustpolish.errors import RobustPolishError
from robustpolish.identification.compare import Comparison, compare
from robustpolish.identification.diagnosis.findings import Findings
from robustpolish.identification.fit.prepared import has_integrator
from robustpolish.identification.policy import POLICY
from robustpolish.identification.record import record_of
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.plots.time import plot_before_and_after, plot_response
from robustpolish.signals.quality import sampling_time

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
    ('coulomb_friction', 'x', None)
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
        name = self._named(output)
        y = np.asarray(self.after.data[name].values, dtype=float)
        step = sampling_time(self.after.data)
        samples = round(_SWINGS_SHOWN / _dominant_frequency(y, step) / step)
        if 2 * samples >= y.size:
            return None
        gain = _squared_error_reduction(self, name)
        total = np.concatenate([[0.0], np.cumsum(gain)])
        first = int(np.argmax(total[samples:] - total[:-samples]))
        time = self.after.data["time"].values
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
        """Draw an output as measured and with the models before and after, and what is left.

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
        rows = tuple(
            (
                name,
                None if self.before is None else self.before.outputs[name].rmse,
                error.rmse,
                error.unit,
            )
            for name, error in self.after.outputs.items()
        )
        head = ("output", "error before", "error after", "unit")
        return Card(f"{self.step}, {self.after.method}", (Table("", head, rows),))


def step_runs(diagnosis: Findings, data: Any) -> tuple[StepRun, ...]:
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
    ['base', 'refit', 'coulomb_friction']
    """
    data = record_of(diagnosis.model, data).data
    found: list[StepRun] = []
    for entry in diagnosis.ledger.entries:
        after = (
            None
            if entry.model is None
            else _compare_step(entry.model, data, diagnosis.reproducible)
        )
        if after is not None:
            found.append(StepRun(entry.step, found[-1].after if found else None, after))
    return tuple(found)


def _compare_step(
    model: MechanicalModel, data: xr.Dataset, reproducible: bool
) -> Comparison | None:
    """Hold a model against the data as its diagnosis did; None where that cannot be."""
    step, samples = sampling_time(data), data.sizes["time"]
    window = POLICY.window(samples) * step
    whole = reproducible and not has_integrator(model, samples * step)
    try:
        return compare(model, data, window=None if whole else window)
    except RobustPolishError:
        return None


def _dominant_frequency(y: Array, step: float) -> float:
    """Return the frequency of the strongest line of a signal in Hz."""
    frequency, power = periodogram(y, 1 / step, window="hann", detrend="linear")
    return float(max(frequency[1 + int(np.argmax(power[1:]))], frequency[1]))


def _squared_error_reduction(run: StepRun, name: str) -> Array:
    """Return how much squared error a step took away, sample by sample."""
    measured = run.after.data[name].values
    left = [
        np.nan_to_num((measured - held.simulated[name].values) ** 2)
        for held in (run.before, run.after)
        if held is not None
    ]
    return left[0] - left[-1] if len(left) > 1 else left[0]
