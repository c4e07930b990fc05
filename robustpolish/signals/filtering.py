"""Zero-phase low-pass filters, decimation, and records cut into contiguous blocks."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import xarray as xr
from scipy.signal import butter, firwin, kaiserord, sosfiltfilt, upfirdn

from robustpolish.base.checks import invalid, is_whole, misfit, positive
from robustpolish.signals.quality import sampling_time

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
