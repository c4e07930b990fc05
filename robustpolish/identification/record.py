"""Measured data that suit a model: checked, as arrays, cut into contiguous pieces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from robustpolish.arrays import Array
from robustpolish.measurements import check_sampling, read_measurement, same_kind
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.parts import Input, Output
from robustpolish.validation import described, invalid

_REPEATS = 0.98
"""Correlation of inputs with themselves, a period later, from which they repeat."""


@dataclass(frozen=True, eq=False)
class Record:
    """Data that a model can be held against, or a contiguous part of them.

    Attributes
    ----------
    data : xarray.Dataset
        Inputs and outputs over uniform ``time``, of the whole record: derivatives and delays of
        inputs do not know where a part begins.
    times : ndarray
        Its times in s.
    dt : float
        Sampling step in s.
    Y : ndarray, shape (samples, ny)
        Measured outputs of this part, in the model's order.
    first : int
        Where this part begins.
    """

    data: xr.Dataset
    times: Array
    dt: float
    Y: Array
    first: int = 0

    @property
    def samples(self) -> int:
        """Number of samples."""
        return self.Y.shape[0]

    @property
    def start(self) -> float:
        """Time of the first sample in s."""
        return float(self.times[self.first])

    @property
    def time(self) -> Array:
        """Times of the samples in s."""
        return self.own(self.times)

    def own(self, rows: Array) -> Array:
        """Return the rows of this part, of one for each sample of the whole record."""
        return rows[self.first : self.first + self.samples]

    def part(self, begin: int, end: int) -> Record:
        """Return the contiguous samples from `begin` up to `end`."""
        return Record(self.data, self.times, self.dt, self.Y[begin:end], self.first + begin)


def record_of(model: MechanicalModel, data: Any) -> Record:
    """Check that the data holds the model's columns, and return its arrays.

    Raises
    ------
    InvalidInputError
        If the data does not suit the model.
    """
    data = checked_data(model, data)
    time = np.asarray(data["time"].values, dtype=float)
    Y = np.column_stack([np.asarray(data[n].values, dtype=float) for n in model.output_names])
    dt = float((time[-1] - time[0]) / (time.size - 1))
    return Record(data, time, dt, np.ascontiguousarray(Y))


def least_samples(model: MechanicalModel) -> int:
    """Return how many samples an observer or a fit of a model needs."""
    return 20 * (2 * len(model.free) + 1)


def long_enough(model: MechanicalModel, record: Record) -> Record:
    """Return a record if it is long enough for observers and fits of a model.

    Raises
    ------
    InvalidInputError
        If it is too short.
    """
    least = least_samples(model)
    if record.samples < least:
        shown = described(f"{record.samples} samples")
        raise invalid("data", shown, f"at least {least}", "Record for longer.")
    return record


def repetition(inputs: Array, dt: float) -> float | None:
    """Return the period in s with which inputs repeat, None if they do not.

    Parameters
    ----------
    inputs : ndarray, shape (samples, nu)
    dt : float
        Sampling step in s.

    Returns
    -------
    float or None
        The shortest period; at most half of the record, so that it is seen twice.
    """
    U = inputs[:, np.ptp(inputs, axis=0) > 0]
    if not U.size:
        return None
    U = (U - U.mean(axis=0)) / U.std(axis=0)
    n, half = len(U), len(U) // 2
    spectrum = np.abs(np.fft.rfft(U, 2 * n, axis=0)) ** 2
    products = np.fft.irfft(spectrum, axis=0)[: half + 1].sum(axis=1)
    power = np.concatenate([[0.0], np.cumsum(np.sum(U**2, axis=1))])
    lags = np.arange(half + 1)
    likeness = 2 * products / (power[n - lags] + power[n] - power[lags])
    apart = np.flatnonzero(likeness < 0)  # short lags are alike in every smooth signal
    again = np.flatnonzero(likeness > _REPEATS)
    again = again[again > apart[0]] if apart.size else again[:0]
    if not again.size:
        return None
    run = again[: int(np.argmax(np.append(np.diff(again) > 1, True))) + 1]
    return float(run[np.argmax(likeness[run])] * dt)


def checked_data(model: MechanicalModel, data: Any, outputs: bool = True) -> xr.Dataset:
    """Return `data`, the model's columns checked.

    Parameters
    ----------
    model : MechanicalModel
    data : xarray.Dataset, path or pandas.DataFrame
        Anything but a dataset is read with :func:`robustpolish.measurements.read_measurement`.
    outputs : bool, optional
        Whether the outputs have to be there, or the inputs only.

    Returns
    -------
    xarray.Dataset
        Inputs, outputs and whatever else it holds, over uniform ``time``.

    Raises
    ------
    InvalidInputError
        If a column is missing, has another unit than the model, or is not finite; if time is not
        uniform; if the sampling rate is too low for the model's modes.
    """
    if not isinstance(model, MechanicalModel):
        shown = described(type(model).__name__)
        raise invalid("model", shown, "a MechanicalModel", "Read it with from_toml.")
    items = [*model.inputs, *(model.outputs if outputs else ())]
    if not isinstance(data, xr.Dataset):
        data = read_measurement(data, columns=[item.name for item in items])
    _check_time(data)
    for item in items:
        _check_column(model, item, data)
    check_sampling(data, _frequencies(model))
    return data


def _check_time(data: xr.Dataset) -> None:
    if "time" not in data.coords or data["time"].dims != ("time",):
        shown = described(f"coordinates {', '.join(map(str, data.coords)) or 'none'}")
        raise invalid("data", shown, "the coordinate time", "Read it with read_measurement.")
    time = np.asarray(data["time"].values)
    if time.dtype.kind not in "fiu":
        shown = described(f"time of type {time.dtype}")
        raise invalid("data", shown, "seconds", "Read it with read_measurement.")
    if time.size < 3:
        raise invalid("data", described(f"{time.size} samples"), "three or more", "Record longer.")
    steps = np.diff(time.astype(float))
    step = (time[-1] - time[0]) / (time.size - 1)
    rounding = 1e-3 * step + 4 * np.spacing(np.max(np.abs(time)))
    if not np.isfinite(time).all() or step <= 0 or np.max(np.abs(steps - step)) > rounding:
        raise invalid(
            "time",
            described(f"steps from {np.min(steps):.6g} to {np.max(steps):.6g} s"),
            "a uniform, rising grid",
            "Read it with read_measurement, which resamples small irregularities.",
        )


def _check_column(model: MechanicalModel, item: Input | Output, data: xr.Dataset) -> None:
    name = item.name
    if name not in data:
        listed = ", ".join(str(column) for column in data.data_vars) or "none"
        raise invalid(
            "data",
            described(f"no column {name!r}"),
            f"the model's inputs and outputs among the columns: {listed}",
            "Rename the column, or the input or output in the model.",
        )
    column = data[name]
    values = np.asarray(column.values)
    if column.dims != ("time",) or values.dtype.kind not in "fiub":
        shown = described(f"{values.dtype} over {', '.join(map(str, column.dims))}")
        raise invalid(name, shown, "numbers over time", "Read it with read_measurement.")
    if not np.isfinite(values).all():
        i = int(np.flatnonzero(~np.isfinite(values))[0])
        shown = described(f"{values[i]} at sample {i}")
        raise invalid(name, shown, "finite numbers", "Cut the record there.")
    unit, wanted = str(column.attrs.get("units", "")), model.unit_of(item)
    converts = isinstance(item, Input) and abs(item.gain) != 1 and item.unit is None
    if not converts and not same_kind(unit, wanted):
        raise invalid(
            name,
            described(f"a column in {unit}"),
            f"{wanted}, as the model says",
            "Correct the unit or the quantity, or give the gain that converts.",
        )


def _frequencies(model: MechanicalModel) -> list[float]:
    """Return the frequencies in Hz at which the linear part of a model swings."""
    if not model.free:
        return []
    poles = np.linalg.eigvals(model.matrices.first_order()[0])
    return [abs(float(pole.imag)) / (2 * np.pi) for pole in poles]
