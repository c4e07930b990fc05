"""Free runs of the model after each step of a diagnosis, compared with the record."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.signal import periodogram

from robustpolish.base.checks import one_of
from robustpolish.base.results import Card, Displayed, Table
from robustpolish.errors import RobustPolishError
from robustpolish.identification.compare import Comparison, compare
from robustpolish.identification.diagnosis.result import Diagnosis
from robustpolish.identification.fit.prepared import has_integrator, window_samples
from robustpolish.identification.record import Record, record_of
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
    ['base', 'refit', 'coulomb_friction']
    """
    record = record_of(diagnosis.model, data)
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
