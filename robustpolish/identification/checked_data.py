"""Whether data can be held against a model: columns, units, numbers, time, sampling rate."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from robustpolish.analysis import modes
from robustpolish.measurements import check_sampling, read_measurement, same_kind
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.parts import Input, Output
from robustpolish.validation import described, invalid


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
    frequencies = modes(model.state_space()).frequencies_hz if model.free else ()
    check_sampling(data, list(frequencies))
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
