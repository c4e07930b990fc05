"""Result of a parameter estimation: values, standard errors, covariance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import lmfit
import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from robustpolish.base.results import Card, Displayed, Table, estimate
from robustpolish.identification.diagnosis.uncertainty import Fitted
from robustpolish.identification.fit.parameters import FreeParameter
from robustpolish.identification.free_runs import RecordError, records_content, records_table
from robustpolish.machines.mechanical.data import unit_of
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.plots.charts import plot_bars

_UNDETERMINED = 1 / 3
"""Standard error over the value from which a number is called undetermined."""


@dataclass(frozen=True, eq=False, repr=False)
class Refit(Fitted, Displayed):
    """A model with fitted parameters.

    Attributes
    ----------
    model : MechanicalModel
    parameters : lmfit.Parameters
        Values, bounds and standard errors; "." and brackets in names are underscores.
    units : dict
        Unit of each parameter.
    nrmse : dict
        Error of a free run over each output's standard deviation; of a fit to frequency
        responses the relative error of each pair.
    undetermined : tuple of str
        Keys that the data leaves undetermined (a standard error above a third of the value).
    stderr : mapping of str to float
        Standard error by key of `units`.
    covariance : xarray.DataArray
        Covariance of the parameters, over their keys twice, in SI units.
    notes : tuple of str
        Remarks of the record, and what looks wrong: numbers that moved by decades, signs, units,
        clipped peaks.
    records : dict of str to RecordError
        The errors of each record by its name, of a free run as :func:`robustpolish.compare` has
        it; none of frequency responses.

    Examples
    --------
    >>> import robustpolish as rp
    >>> model, data = rp.datasets.sticky_slide()
    >>> fitted = rp.refit(model.with_effect("coulomb_friction", ("x", "ground")), data)
    >>> round(fitted.model.parameters["effect[0].force"], 1), fitted.undetermined
    (3.0, ())
    >>> sorted(fitted.to_dict()["parameters"]["effect[0].force"])
    ['determined', 'stderr', 'unit', 'value']
    >>> fitted.plot().get_xlabel()
    'relative standard error [%]'
    """

    model: MechanicalModel
    parameters: lmfit.Parameters
    units: dict[str, str]
    nrmse: dict[str, float]
    undetermined: tuple[str, ...]
    stderr: Mapping[str, float]
    covariance: xr.DataArray
    notes: tuple[str, ...] = ()
    records: Mapping[str, RecordError] = field(default_factory=dict)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the standard error of every parameter relative to its value.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
        """
        values, errors = self.model.parameters, self.stderr
        labels = {"parameter": [f"{k} = {values[k]:.4g} {self.units[k]}" for k in errors]}
        relative = [100 * e / abs(values[k]) if values[k] else np.inf for k, e in errors.items()]
        name, attributes = "relative standard error", {"units": "%"}
        bars = xr.DataArray(relative, labels, "parameter", name, attributes)
        left_open = xr.DataArray([k in self.undetermined for k in errors], labels, "parameter")
        meaning = ("determined", "left open by the data")
        return plot_bars(bars, left_open, ax, meaning=meaning)

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as in the JSON of ``robustpolish refit``.

        Returns
        -------
        dict
        """
        values = self.model.parameters
        return {
            "parameters": {
                key: {
                    "value": values[key],
                    "stderr": error,
                    "unit": self.units[key],
                    "determined": key not in self.undetermined,
                }
                for key, error in self.stderr.items()
            },
            "nrmse": dict(self.nrmse),
            "records": records_content(self.records),
        }

    def _card(self) -> Card:
        values = self.model.parameters
        rows = tuple(
            (key, *estimate(values[key], error), self.units[key], key not in self.undetermined)
            for key, error in self.stderr.items()
        )
        columns = ("parameter", "value", "standard error", "unit", "determined")
        errors = tuple(self.nrmse.items())
        tables = (Table("", columns, rows), Table("", ("output", "NRMSE"), errors))
        return Card("Refit", (*tables, *records_table(self.records)), self.notes)


def refit_of(
    model: MechanicalModel,
    free: Sequence[FreeParameter],
    covariance: xr.DataArray,
    nrmse: dict[str, float],
) -> Refit:
    """Return values, bounds and standard errors of a fit.

    Parameters
    ----------
    model : MechanicalModel
        Fitted.
    free : sequence of FreeParameter
    covariance : xarray.DataArray
        Over their keys twice.
    nrmse : dict of str to float
        Relative errors.
    """
    errors, values = stderr_from_covariance(covariance), model.parameters
    parameters = lmfit.Parameters()
    for f in free:
        # lmfit takes identifiers only
        name = "".join(c if c.isalnum() else "_" for c in f.key).strip("_")
        parameters.add(name, value=values[f.key], min=f.lower, max=f.upper)
        parameters[name].stderr = errors[f.key]
    units = {f.key: unit_of(model, f.key) for f in free}
    # not a number is left open, too
    left_open = (k for k in units if not errors[k] <= _UNDETERMINED * abs(values[k]) < np.inf)
    return Refit(model, parameters, units, nrmse, tuple(left_open), errors, covariance)


def stderr_from_covariance(covariance: xr.DataArray) -> dict[str, float]:
    """Return the standard errors that belong to a covariance."""
    errors = np.sqrt(np.maximum(np.diag(covariance.values), 0.0))
    return dict(zip(covariance["parameter"].values.tolist(), errors.tolist(), strict=True))
