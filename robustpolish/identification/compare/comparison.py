"""What came out of holding a model against data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robustpolish.display import Card, Displayed, Table
from robustpolish.identification.findings.record_error import (
    OutputError,
    OverOutputs,
    RecordError,
    records_content,
    records_table,
)
from robustpolish.identification.observer.reproducibility import Reproducibility
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.plotting import plot_overlay, plot_response
from robustpolish.validation import one_of


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(OverOutputs, Displayed):
    """A model held against data.

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
    outputs: Mapping[str, OutputError]
    method: str
    span: float | None
    starts: np.ndarray
    reproducibility: Reproducibility
    band: xr.Dataset | None = None
    notes: tuple[str, ...] = field(default_factory=tuple)
    records: Mapping[str, RecordError] = field(default_factory=dict)

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
        return {
            "outputs": {
                name: {
                    "nrmse": error.nrmse,
                    "fit_percent": error.fit_percent,
                    "rmse": error.rmse,
                    "unit": error.unit,
                    "rmse_band": list(error.band),
                }
                for name, error in self.outputs.items()
            },
            "overall": {"nrmse": self.nrmse, "fit_percent": self.fit_percent},
            "method": self.method,
            "span": self.span,
            "reproducible": self.reproducible,
            "records": records_content(self.records),
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
            (
                error.name,
                float(f"{error.fit_percent:.2f}"),
                error.nrmse,
                error.rmse,
                *error.band,
                error.unit,
            )
            for error in self.outputs.values()
        )
        columns = ("output", "fit [%]", "NRMSE", "RMS error", "95 % from", "to", "unit")
        title = f"Comparison ({how}), fit {self.fit_percent:.2f} %"
        tables = [Table("", columns, rows)]
        tables += records_table(self.records)
        return Card(title, tuple(tables), self.notes)
