"""The same zero-phase filter on all channels."""

from __future__ import annotations

import numpy as np
import xarray as xr
from scipy.signal import butter, sosfiltfilt

from robustpolish.measurements.sampling import sampling_time
from robustpolish.validation import described, invalid, positive


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
        shown = described(f"{cutoff} Hz")
        raise invalid("cutoff", shown, f"less than {0.5 / step:.6g} Hz", "Choose a lower one.")
    edge = int(np.ceil(4 / (frequency * step)))
    samples = data.sizes["time"]
    if samples < 3 * edge + 30:
        shown = described(f"{samples} samples for {cutoff} Hz")
        raise invalid("cutoff", shown, "a longer record", "Choose a higher one.")
    sos = butter(order, frequency, fs=1 / step, output="sos")
    filtered = data.copy()
    for name, variable in data.data_vars.items():
        values = sosfiltfilt(sos, np.asarray(variable.values, dtype=float))
        filtered[name] = ("time", values, variable.attrs)
    return filtered.isel(time=slice(edge, samples - edge))
