"""How a record is sampled, and whether that is fast enough for a model."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from robustpolish.arrays import Array
from robustpolish.validation import described, invalid


def sampling_time(data: xr.Dataset) -> float:
    """Return the sampling time in s of a dataset over a uniform ``time``.

    Parameters
    ----------
    data : xarray.Dataset

    Returns
    -------
    float

    Examples
    --------
    >>> import xarray as xr
    >>> sampling_time(xr.Dataset(coords={"time": [0.0, 0.5, 1.0]}))
    0.5
    """
    values: Array = data["time"].values
    return float((values[-1] - values[0]) / (values.size - 1))


def check_sampling(data: xr.Dataset, frequencies: Sequence[float]) -> None:
    """Refuse a record that cannot show a model's modes.

    Parameters
    ----------
    data : xarray.Dataset
        Over ``time``.
    frequencies : sequence of float
        Natural frequencies in Hz that the outputs show.

    Raises
    ------
    InvalidInputError
        If half the sampling rate, the Nyquist frequency, is below the highest of them.

    Examples
    --------
    >>> import xarray as xr
    >>> check_sampling(xr.Dataset(coords={"time": [0.0, 0.01, 0.02]}), [12.0])
    """
    rate = 1 / sampling_time(data)
    highest = float(np.max(frequencies, initial=0.0))
    if highest >= rate / 2:
        raise invalid(
            "sampling rate",
            described(f"{rate:.6g} Hz"),
            f"more than {2 * highest:.6g} Hz, for the model's mode at {highest:.6g} Hz",
            "Sample faster, or leave the mode out of the model.",
        )
