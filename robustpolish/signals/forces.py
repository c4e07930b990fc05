"""Recorded forces, made ready to drive a model or a loop."""

from __future__ import annotations

from collections.abc import Mapping
from math import floor, isclose
from typing import Any

import numpy as np
import xarray as xr
from scipy.interpolate import CubicSpline

from robustpolish.base.checks import invalid, misfit, positive
from robustpolish.signals.filtering import decimate, lowpass
from robustpolish.signals.quality import sampling_time
from robustpolish.signals.read import read_measurement

_KEPT = 0.4  # of a new rate that is no whole share of the old one, up to where halves remain


def measured_forces(
    source: Any,
    forces: Mapping[str, str],
    *,
    factors: Mapping[str, float] | None = None,
    steady: Mapping[str, float] | None = None,
    units: Mapping[str, str] | None = None,
    unloaded: tuple[float, float] | None = None,
    between: tuple[float, float] | None = None,
    sample_rate: float | None = None,
) -> xr.Dataset:
    """Make a load of recorded forces, for `simulate` and every model with inputs of these names.

    Parameters
    ----------
    source : path, pandas.DataFrame or xarray.Dataset
        What :func:`robustpolish.read_measurement` reads, or what it has read where a file needs its
        other arguments.
    forces : mapping of str to str
        Column of the record for each input: ``{"F_x": "Kistler Fx"}``.
    factors : mapping of str to float, optional
        By which columns are multiplied, such as -1 where the sensor's axis points the other way:
        (8.45) counts F_x and F_y as forces that push the tool along -x and -y, F_z along +z.
    steady : mapping of str to float, optional
        Inputs that were not recorded but held, in N: ``{"F_p": 10.0}``.
    units : mapping of str to str, optional
        Units of columns that the record does not tell, or tells wrongly.
    unloaded : (float, float), optional
        First and last time [s], on the record's clock, at which nothing touched: the mean there is
        the sensor's offset and taken off.
    between : (float, float), optional
        First and last time [s] to be kept.
    sample_rate : float, optional
        Wanted samples per second [Hz]; those of the record by default. Fewer samples are taken
        behind a filter without delay (:func:`~robustpolish.signals.decimate`), more by a cubic
        spline.

    Returns
    -------
    xarray.Dataset
        The inputs [N] over uniform `time` from 0 s; ``attrs["notes"]`` tells what was done,
        ``attrs["began"]`` when the load began on the record's clock [s].

    Raises
    ------
    InvalidInputError
        As :func:`robustpolish.read_measurement`; also if a column is no force, its unit is not
        known, or a time lies outside the record.

    Examples
    --------
    >>> import pandas as pd
    >>> import robustpolish as rp
    >>> record = pd.DataFrame(
    ...     {"t [s]": [0.0, 0.001, 0.002, 0.003], "Fy [kN]": [0.0, 0.001, 0.003, 0.002]}
    ... )
    >>> load = rp.signals.measured_forces(
    ...     record, {"F_y": "Fy"}, factors={"F_y": -1.0}, sample_rate=20e3
    ... )
    >>> load.sizes["time"], load["F_y"].attrs["units"], round(float(load["F_y"][40]), 9)
    (61, 'N', -3.0)
    >>> response = rp.simulate(rp.air_bearing(), load)
    >>> bool(response["y"].max() > 0)
    True
    """
    if not isinstance(forces, Mapping) or not forces:
        expected = "a column for each input, such as {'F_x': 'Fx'}"
        raise invalid("forces", forces, expected, "Name them.")
    given, held = dict(factors or {}), dict(steady or {})
    strange = {"factors": given.keys() - forces.keys(), "steady": held.keys() & forces.keys()}
    for name, entries in strange.items():
        if entries:
            expected = "factors of recorded inputs, and steady values of others"
            shown = f"entries for {', '.join(sorted(entries))}"
            raise misfit(name, shown, expected, "Correct the names.")
    columns = list(dict.fromkeys(forces.values()))
    record = read_measurement(source, columns=columns, units=units)
    signals = {name: _force(record, name, column) for name, column in forces.items()}
    data = xr.Dataset(signals, attrs={"notes": list(record.attrs.get("notes", ()))})
    for name, factor in given.items():
        data[name] = factor * data[name]
    if unloaded is not None:
        told = f"mean from {unloaded[0]:g} to {unloaded[1]:g} s taken off as the sensor's offset"
        notes = [*data.attrs["notes"], told]
        data = (data - _part(data, "unloaded", unloaded).mean("time")).assign_attrs(notes=notes)
    if between is not None:
        data = _part(data, "between", between)
    if sample_rate is not None:
        data = _resampled(data, positive("sample_rate", sample_rate, "Hz"))
    began, step = float(data["time"][0]), sampling_time(data)
    time = step * np.arange(data.sizes["time"])
    load = {name: data[name].to_numpy() for name in forces}
    load |= {name: np.full(time.size, float(value)) for name, value in held.items()}
    return xr.Dataset(
        {name: ("time", values, {"units": "N"}) for name, values in load.items()},
        {"time": ("time", time, {"units": "s"})},
        {"notes": data.attrs["notes"], "began": began},
    )


def _force(record: xr.Dataset, name: str, column: str) -> xr.DataArray:
    """Return a column that is a force in N, and say so of any other."""
    unit = record[column].attrs["units"]
    if unit != "N":
        shown = f"column {column!r} with unit {unit or 'not known'}"
        remedy = f"Pass units={{{column!r}: 'N'}}, or another unit of force."
        raise misfit(f"forces[{name!r}]", shown, "a force", remedy)
    return record[column].astype(float)


def _part(data: xr.Dataset, argument: str, limits: tuple[float, float]) -> xr.Dataset:
    part = data.sel(time=slice(*limits))
    if part.sizes["time"] < 2:
        first, last = float(data["time"][0]), float(data["time"][-1])
        expected = f"two times between {first:g} and {last:g} s"
        raise invalid(argument, limits, expected, "Choose a part of the record.")
    return part


def _resampled(data: xr.Dataset, rate: float) -> xr.Dataset:
    """Return the data at another rate, without aliases."""
    old = 1.0 / sampling_time(data)
    if isclose(old, rate, rel_tol=1e-6):
        return data
    notes = data.attrs["notes"]
    if rate < old:
        ratio = old / rate
        if isclose(ratio, round(ratio), rel_tol=1e-6):
            return decimate(data, rate)
        data = lowpass(data, _KEPT * rate)
        notes = [*notes, f"filtered without delay: half the amplitude at {_KEPT * rate:.6g} Hz"]
    clock = data["time"].to_numpy()
    count = floor((clock[-1] - clock[0]) * rate * (1.0 + 1e-9)) + 1
    time = clock[0] + np.arange(count) / rate
    new = {
        name: ("time", CubicSpline(clock, values.to_numpy())(time), values.attrs)
        for name, values in data.data_vars.items()
    }
    notes = [*notes, f"from {old:.6g} to {rate:.6g} Hz by a cubic spline"]
    return xr.Dataset(new, {"time": time}, {"notes": notes})
