"""Zero-phase filters, and recorded forces made ready to drive a model or a loop."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from math import floor, isclose
from typing import Any

import numpy as np
import xarray as xr
from scipy.interpolate import CubicSpline
from scipy.signal import butter, firwin, kaiserord, sosfiltfilt, upfirdn

from robustpolish.base.checks import invalid, is_whole, misfit, positive
from robustpolish.signals.raw import sampling_time
from robustpolish.signals.read import read_measurement

FLAT = 0.8
"""Share of half the new sampling rate up to which `decimate` leaves a signal as it is."""

_ATTENUATION = 80.0
"""dB by which it takes out what would come back as another frequency below that: more than the
16 bits of a good converter show of one frequency beside another."""


def lowpass(data: xr.Dataset, cutoff: float, order: int = 4) -> xr.Dataset:
    """Take the high frequencies out of all channels alike, without a delay.

    A linear model relates filtered inputs to filtered outputs just as it does the raw ones. That
    makes it possible to judge a force model at frequencies where the acceleration, twice the
    derivative of a measured position, is more than noise.

    Parameters
    ----------
    data : xarray.Dataset
        Over uniform ``time``.
    cutoff : float
        In Hz; the amplitude there is halved.
    order : int, optional
        Of the Butterworth filter, which runs forwards and backwards.

    Returns
    -------
    xarray.Dataset
        Shorter by four periods of the cut-off frequency at both ends, where the filter has no past
        or no future.

    Raises
    ------
    InvalidInputError
        If the cut-off frequency is not below half the sampling rate, or the record too short.

    Examples
    --------
    >>> import numpy as np
    >>> import xarray as xr
    >>> time = np.arange(1000) * 0.001
    >>> hum = np.sin(2 * np.pi * 5 * time) + np.sin(2 * np.pi * 300 * time)
    >>> smooth = lowpass(xr.Dataset({"x": ("time", hum)}, {"time": time}), 50.0)
    >>> bool(np.allclose(smooth["x"], np.sin(2 * np.pi * 5 * smooth["time"]), atol=1e-3))
    True
    """
    step = sampling_time(data)
    frequency = positive("cutoff", cutoff, "Hz")
    if frequency >= 0.5 / step:
        want = f"less than {0.5 / step:.6g} Hz"
        raise misfit("cutoff", f"{cutoff} Hz", want, "Choose a lower one.")
    edge = int(np.ceil(4 / (frequency * step)))
    samples = data.sizes["time"]
    if samples < 3 * edge + 30:
        shown = f"{samples} samples for {cutoff} Hz"
        raise misfit("cutoff", shown, "a longer record", "Choose a higher one.")
    sos = butter(order, frequency, fs=1 / step, output="sos")
    filtered = data.copy()
    for name, variable in data.data_vars.items():
        values = sosfiltfilt(sos, np.asarray(variable.values, dtype=float))
        filtered[name] = ("time", values, variable.attrs)
    return filtered.isel(time=slice(edge, samples - edge))


def decimate(data: xr.Dataset, rate: float) -> xr.Dataset:
    """Keep as many samples as `rate` asks for, without a delay and without aliases.

    A record of 50 kHz holds nothing more about a mode of 40 Hz than one of 2 kHz does, and takes 25
    times as long to fit.

    Parameters
    ----------
    data : xarray.Dataset
        Over uniform ``time``.
    rate : float
        Wanted sampling rate in Hz; every n-th sample is kept, with the largest n that does not
        come below it.

    Returns
    -------
    xarray.Dataset
        `data` itself if there is nothing to leave out. Otherwise all channels behind the same
        symmetric filter, as they were up to 80 % of half the new rate (within 0.01 %), shorter at
        both ends by what the filter has no past or no future for: 13 of the new samples.
        ``attrs["notes"]`` says so.

    Raises
    ------
    InvalidInputError
        If the rate is not positive, or the record too short for it.

    Notes
    -----
    A finite impulse response of linear phase with a Kaiser window; what lies between 80 and 100 %
    of half the new rate may hold aliases. J. F. Kaiser, Nonrecursive digital filter design using
    the I0-sinh window function, IEEE ISCAS 1974.

    Examples
    --------
    >>> import numpy as np
    >>> import xarray as xr
    >>> time = np.arange(50_000) / 50e3
    >>> hum = np.sin(2 * np.pi * 40 * time) + np.sin(2 * np.pi * 9000 * time)
    >>> fewer = decimate(xr.Dataset({"x": ("time", hum)}, {"time": time}), 2000.0)
    >>> float(abs(fewer["x"] - np.sin(80 * np.pi * fewer["time"])).max()) < 1e-3
    True
    >>> fewer.attrs["notes"]
    ['decimated from 50000 to 2000 Hz: every 25th sample, no delay, unchanged up to 800 Hz']
    """
    step = sampling_time(data)
    # A rate read as 999.9999 Hz is one of 1000 Hz.
    every = int(np.floor(1 / (step * positive("rate", rate, "Hz")) * (1 + 1e-6)))
    if every < 2:
        return data
    band = 2 * (1 - FLAT) / every  # of the transition: aliases stay above the flat part
    count, beta = kaiserord(_ATTENUATION, band)
    taps = np.asarray(firwin(count | 1, 1 / every, window=("kaiser", beta)))  # pyright: ignore[reportArgumentType]
    edge = int(np.ceil((taps.size // 2) / every))  # in new samples
    samples = data.sizes["time"]
    kept = np.arange(edge * every, samples - edge * every, every)
    if kept.size < 2:
        shown = f"{samples} samples for {rate:.6g} Hz, every {every}th"
        least = f"at least {2 * (edge + 1) * every} samples"
        raise misfit("rate", shown, least, "Choose a higher rate, or record longer.")
    fewer = data.isel(time=kept)
    for name, variable in data.data_vars.items():
        if variable.dims == ("time",):
            values = np.asarray(variable.values, dtype=float)
            fewer[name] = ("time", _filtered(values, taps, kept), variable.attrs)
    new = 1 / (step * every)
    ending = {1: "st", 2: "nd", 3: "rd"}.get(every % 10 * (every // 10 % 10 != 1), "th")
    note = (
        f"decimated from {1 / step:.6g} to {new:.6g} Hz: every {every}{ending} sample, no "
        f"delay, unchanged up to {FLAT * new / 2:.6g} Hz"
    )
    fewer.attrs["notes"] = [*data.attrs.get("notes", ()), note]
    return fewer


def _filtered(values: np.ndarray, taps: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """Return the filtered signal at the kept samples, which the filter reaches past on no side."""
    half, every = taps.size // 2, int(kept[1] - kept[0])
    inside = values[kept[0] - half : kept[-1] + half + 1]
    about = inside.mean()  # so that an offset is kept to the last digit
    # The first full overlap of taps and samples belongs to the first kept one.
    whole = upfirdn(taps, np.concatenate([np.zeros((-2 * half) % every), inside - about]), 1, every)
    first = (2 * half + (-2 * half) % every) // every
    return about + whole[first : first + kept.size]


# Records in contiguous parts, for estimation and for judging.


def split_blocks(data: xr.Dataset, parts: int | Sequence[float] = (0.6, 0.4)) -> list[xr.Dataset]:
    """Cut a record into contiguous blocks; samples are never shuffled.

    Neighbouring samples of a vibration are nearly copies of each other, so that a model fitted to
    every second one has seen the others too.

    Parameters
    ----------
    data : xarray.Dataset
        Over ``time``.
    parts : int or sequence of float, optional
        Number of equal blocks, or the shares of the record; 60 % for estimation and 40 % held
        out by default.

    Returns
    -------
    list of xarray.Dataset
        In the order of time, which keeps running.

    Raises
    ------
    InvalidInputError
        If the shares are not positive or exceed 1, or a block would have less than two samples.

    Examples
    --------
    >>> import xarray as xr
    >>> data = xr.Dataset({"x": ("time", range(10))}, {"time": range(10)})
    >>> [block.sizes["time"] for block in split_blocks(data)]
    [6, 4]
    """
    samples, remedy = data.sizes["time"], "Pass (0.6, 0.4)."
    if is_whole(parts):
        if parts < 1:
            raise invalid("parts", parts, "one block or more", "Ask for fewer or more blocks.")
        shares = [1 / parts] * int(parts)
    else:
        try:
            shares = [float(share) for share in parts]  # type: ignore[union-attr]
        except (TypeError, ValueError):
            raise invalid("parts", parts, "a number or shares", remedy) from None
    if not shares or not all(share > 0 for share in shares) or sum(shares) > 1 + 1e-9:
        raise invalid("parts", parts, "positive shares of at most 1 in all", remedy)
    edges = np.rint(np.concatenate([[0.0], np.cumsum(shares)]) * samples).astype(int)
    if np.min(np.diff(edges)) < 2:
        shown = f"{len(shares)} blocks of a record with {samples} samples"
        remedy = "Ask for fewer blocks or record longer."
        raise misfit("parts", shown, "two samples or more in each", remedy)
    return [data.isel(time=slice(first, last)) for first, last in pairwise(edges)]


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
