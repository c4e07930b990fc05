"""The errors of a model's outputs, and of one record among several."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from robustpolish.display import Table
from robustpolish.identification.observer.reproducibility import Reproducibility


@dataclass(frozen=True)
class OutputError:
    """The error of one output.

    Attributes
    ----------
    name, unit : str
        Output and its SI unit.
    nrmse : float
        Norm of the error over the norm of the measured signal without its mean.
    rmse : float
        Root of the mean squared error, in `unit`.
    band : (float, float)
        95 % confidence band of `rmse`. It is wide where the error is slow: samples that resemble
        each other count less.
    relative : float
        Norm of the error over the norm of the measured signal with its mean.
    """

    name: str
    unit: str
    nrmse: float
    rmse: float
    band: tuple[float, float]
    relative: float

    @property
    def fit_percent(self) -> float:
        """100 (1 - NRMSE), as in MATLAB: 100 is perfect, 0 no better than the mean."""
        return 100 * (1 - self.nrmse)

    @property
    def fit_band(self) -> tuple[float, float]:
        """95 % confidence band of `fit_percent`."""
        share = self.nrmse / self.rmse if self.rmse else 0.0
        return 100 * (1 - share * self.band[1]), 100 * (1 - share * self.band[0])


class OverOutputs:
    """What has errors by output, in one figure."""

    outputs: Mapping[str, OutputError]

    @property
    def nrmse(self) -> float:
        """Root of the mean squared NRMSE of the outputs."""
        return float(np.sqrt(np.mean([error.nrmse**2 for error in self.outputs.values()])))

    @property
    def fit_percent(self) -> float:
        """100 (1 - NRMSE) over all outputs."""
        return 100 * (1 - self.nrmse)


@dataclass(frozen=True, eq=False)
class RecordError(OverOutputs):
    """The errors of one record, which may be one of several.

    Attributes
    ----------
    outputs : dict of str to OutputError
        Errors by output.
    starts : ndarray, shape (runs, n)
        Estimated starts: free displacements, velocities, internal states of effects.
    reproducibility : Reproducibility
        Of the free run over this record.
    """

    outputs: Mapping[str, OutputError]
    starts: np.ndarray
    reproducibility: Reproducibility


def records_table(records: Mapping[str, RecordError]) -> tuple[Table, ...]:
    """Return the errors of several records as a table; none for one alone."""
    if len(records) < 2:
        return ()
    rows = tuple(
        (record, error.name, float(f"{error.fit_percent:.2f}"), error.rmse, error.unit)
        for record, errors in records.items()
        for error in errors.outputs.values()
    )
    return (Table("Record by record", ("record", "output", "fit [%]", "RMS error", "unit"), rows),)


def records_content(records: Mapping[str, RecordError]) -> dict[str, Any]:
    """Return the errors of records as the command line writes them."""
    return {
        name: {
            "nrmse": {output: error.nrmse for output, error in record.outputs.items()},
            "fit_percent": record.fit_percent,
            "reproducible": record.reproducibility.reproducible,
        }
        for name, record in records.items()
    }
