"""The measured signals of a model as arrays, cut into contiguous pieces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from robustpolish.identification.checked_data import checked_data
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.validation import described, invalid

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Record:
    """Data that a model can be held against.

    Attributes
    ----------
    data : xarray.Dataset
        Inputs and outputs over uniform ``time``.
    dt : float
        Sampling step in s.
    Y : ndarray, shape (samples, ny)
        Measured outputs in the model's order.
    """

    data: xr.Dataset
    dt: float
    Y: Array

    @property
    def samples(self) -> int:
        """Number of samples."""
        return self.Y.shape[0]

    @property
    def start(self) -> float:
        """Time of the first sample in s."""
        return float(self.data["time"].values[0])

    def part(self, begin: int, end: int) -> Record:
        """Return the contiguous samples from `begin` up to `end`."""
        return Record(self.data.isel(time=slice(begin, end)), self.dt, self.Y[begin:end])


def record_of(model: MechanicalModel, data: Any) -> Record:
    """Check that the data holds the model's columns, and return its arrays.

    Raises
    ------
    InvalidInputError
        If the data does not suit the model, or the record is too short.
    """
    data = checked_data(model, data)
    if not model.outputs:
        raise invalid("model.outputs", (), "at least one output", "Add what was measured.")
    time = np.asarray(data["time"].values, dtype=float)
    least = 20 * (2 * len(model.free) + 1)
    if time.size < least:
        raise invalid(
            "data", described(f"{time.size} samples"), f"at least {least}", "Record for longer."
        )
    Y = np.column_stack([np.asarray(data[n].values, dtype=float) for n in model.output_names])
    dt = float((time[-1] - time[0]) / (time.size - 1))
    return Record(data[[*model.input_names, *model.output_names]], dt, np.ascontiguousarray(Y))


@dataclass(frozen=True)
class Split:
    """Contiguous pieces for estimation and for judging, as sample ranges."""

    estimation: tuple[tuple[int, int], ...]
    held_out: tuple[tuple[int, int], ...]


def split(samples: int, decays: bool = False) -> Split:
    """Return two held-out pieces of a record, 30 % of it, between the estimation pieces.

    Free decays keep their beginning, where the amplitude is, for estimation.
    """
    marks = (0.0, 0.4, 0.55, 0.85, 1.0) if not decays else (0.0, 0.35, 0.65, 0.9, 1.0)
    a, b, c, d, e = (round(samples * mark) for mark in marks)
    return Split(((a, b), (c, d)), ((b, c), (d, e)))
