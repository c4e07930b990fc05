"""Where the error is: its share by time, frequency, motion, spin phase and contact."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray
from scipy.signal import welch

from robustpolish.arrays import Array


def window_shares(residual: xr.Dataset, windows: int) -> xr.DataArray:
    """Return the share of each output's squared error in each time window.

    Parameters
    ----------
    residual : xarray.Dataset
        Over uniform ``time``.
    windows : int

    Returns
    -------
    xarray.DataArray, shape (output, window)
        Rows add up to 1; the coordinates ``begin`` and ``end`` are in s.
    """
    time = residual["time"].values
    edges = np.linspace(0, time.size, windows + 1).astype(int)
    rows = [np.add.reduceat(e**2, edges[:-1]) for e in _rows(residual)]
    coords = {
        "begin": ("window", time[edges[:-1]]),
        "end": ("window", time[edges[1:] - 1]),
    }
    return _normalised(rows, residual, "window", coords)


def band_shares(residual: xr.Dataset, edges: ArrayLike) -> xr.DataArray:
    """Return the share of each output's squared error in each frequency band.

    Parameters
    ----------
    residual : xarray.Dataset
        Over uniform ``time``.
    edges : array_like
        Rising frequencies in Hz; the first band begins at 0, whatever the first edge says.

    Returns
    -------
    xarray.DataArray, shape (output, band)
        The coordinates ``low`` and ``high`` are in Hz.
    """
    limits = np.asarray(edges, dtype=float)
    rows = []
    for frequency, power in (error_spectrum(residual, name) for name in residual.data_vars):
        band = np.clip(np.searchsorted(limits, frequency, side="right") - 1, 0, limits.size - 2)
        rows.append(np.bincount(band, power, limits.size - 1))
    coords = {"low": ("band", limits[:-1]), "high": ("band", limits[1:])}
    return _normalised(rows, residual, "band", coords)


def line_shares(residual: xr.Dataset, frequencies: Sequence[float], dim: str) -> xr.DataArray:
    """Return the share of each output's squared error near some frequencies.

    Near is within 5 % or two lines of the spectrum, whichever is more.

    Parameters
    ----------
    residual : xarray.Dataset
    frequencies : sequence of float
        In Hz, such as those of modes, or of spin harmonics.
    dim : str
        Name of the dimension, such as ``"mode"``.

    Returns
    -------
    xarray.DataArray, shape (output, `dim`)
        The coordinate ``frequency`` is in Hz. Rows do not add up to 1.
    """
    rows = []
    for name in residual.data_vars:
        frequency, power = error_spectrum(residual, name)
        width = 2.5 * (frequency[1] - frequency[0])
        near = [np.abs(frequency - f) <= max(0.05 * f, width) for f in frequencies]
        rows.append([float(power[mask].sum()) for mask in near])
    return xr.DataArray(
        np.array(rows).reshape(len(residual.data_vars), len(frequencies)),
        dims=("output", dim),
        coords={"output": list(residual.data_vars), "frequency": (dim, list(frequencies))},
    )


def error_spectrum(residual: xr.Dataset, name: object) -> tuple[Array, Array]:
    """Return frequencies in Hz and the share of one output's squared error at each of them."""
    e = np.asarray(residual[name].values, dtype=float)
    time = residual["time"].values
    rate = (time.size - 1) / float(time[-1] - time[0])
    length = min(e.size, max(256, e.size // 8))
    # The mean is an error too; the stubs of SciPy know no detrend=False.
    frequency, power = welch(e, rate, nperseg=length, detrend=False)  # pyright: ignore[reportArgumentType]
    total = float(power.sum())
    return frequency, power / total if total > 0 else power


def value_shares(residual: xr.Dataset, values: Array, bins: int, dim: str) -> xr.DataArray:
    """Return the share of each output's squared error by the value of a signal.

    Parameters
    ----------
    residual : xarray.Dataset
    values : ndarray, shape (samples,)
        Such as a displacement or a velocity.
    bins : int
        Of equal width.
    dim : str
        Name of the dimension; its coordinate holds the middle of each bin.

    Returns
    -------
    xarray.DataArray, shape (output, `dim`)
        The coordinate ``samples`` is the share of the samples in each bin: where the error's share
        is larger, there the model is worse than elsewhere.
    """
    edges = np.linspace(values.min(), values.max(), bins + 1)
    index = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, bins - 1)
    rows = [np.bincount(index, e**2, bins) for e in _rows(residual)]
    coords = {
        dim: (dim, (edges[:-1] + edges[1:]) / 2),
        "samples": (dim, np.bincount(index, minlength=bins) / values.size),
    }
    return _normalised(rows, residual, dim, coords)


def phase_shares(residual: xr.Dataset, spin_frequency: float, bins: int) -> xr.DataArray:
    """Return the share of each output's squared error by the phase of the spin.

    Parameters
    ----------
    residual : xarray.Dataset
    spin_frequency : float
        In Hz; the phase is 0 at time 0, of each of several records on its own clock.
    bins : int

    Returns
    -------
    xarray.DataArray, shape (output, phase)
        Over ``phase`` in rad; the coordinate ``mean`` (output, phase) is the error averaged in
        phase with the spin, in the unit of the output.
    """
    time = residual["own_time" if "own_time" in residual.coords else "time"].values
    turns = np.mod(time * spin_frequency, 1.0)
    index = np.minimum((turns * bins).astype(int), bins - 1)
    count = np.bincount(index, minlength=bins)
    rows = [np.bincount(index, e**2, bins) for e in _rows(residual)]
    means = [np.bincount(index, e, bins) / np.maximum(count, 1) for e in _rows(residual)]
    coords = {
        "phase": ("phase", (np.arange(bins) + 0.5) * 2 * np.pi / bins),
        "samples": ("phase", count / index.size),
        "mean": (("output", "phase"), np.array(means)),
    }
    return _normalised(rows, residual, "phase", coords)


def contact_shares(residual: xr.Dataset, contact: NDArray[np.bool_]) -> xr.DataArray:
    """Return the share of each output's squared error in contact and in free flight.

    Parameters
    ----------
    residual : xarray.Dataset
    contact : ndarray of bool, shape (samples,)

    Returns
    -------
    xarray.DataArray, shape (output, state)
        ``state`` is ``"contact"`` or ``"flight"``; the coordinate ``samples`` as elsewhere.
    """
    index = np.where(contact, 0, 1)
    rows = [np.bincount(index, e**2, 2) for e in _rows(residual)]
    coords = {
        "state": ("state", ["contact", "flight"]),
        "samples": ("state", np.bincount(index, minlength=2) / index.size),
    }
    return _normalised(rows, residual, "state", coords)


def surface(q: Array, v: Array, force: Array, bins: int) -> xr.Dataset:
    """Return the mean force over displacement and velocity: the restoring-force surface.

    Parameters
    ----------
    q, v, force : ndarray, shape (samples,)
        Relative displacement and velocity at a place, and the force there.
    bins : int
        In each direction.

    Returns
    -------
    xarray.Dataset
        ``force``, NaN where nothing was measured, and ``samples`` (share), over
        (``displacement``, ``velocity``).
    """
    axes = [np.linspace(x.min(), x.max(), bins + 1) for x in (q, v)]
    count, _, _ = np.histogram2d(q, v, bins=axes)
    total, _, _ = np.histogram2d(q, v, bins=axes, weights=force)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = total / count
    dims = ("displacement", "velocity")
    return xr.Dataset(
        {"force": (dims, mean), "samples": (dims, count / q.size)},
        coords={dim: (edges[:-1] + edges[1:]) / 2 for dim, edges in zip(dims, axes, strict=True)},
    )


def _rows(residual: xr.Dataset) -> list[Array]:
    return [np.asarray(residual[name].values, dtype=float) for name in residual.data_vars]


def _normalised(
    rows: Sequence[NDArray[Any]], residual: xr.Dataset, dim: str, coords: dict
) -> xr.DataArray:
    table = np.array(rows, dtype=float)
    total = table.sum(axis=1, keepdims=True)
    return xr.DataArray(
        np.divide(table, total, out=np.zeros_like(table), where=total > 0),
        dims=("output", dim),
        coords={"output": list(residual.data_vars), **coords},
    )
