"""Measured and simulated signals, what is left over, and the spectra of both."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.signal import welch

from robustpolish.plotting.style import LINE_STYLES, log_axis
from robustpolish.plotting.time_series import plot_time_series


def plot_overlay(
    measured: xr.Dataset, simulated: xr.Dataset, band: xr.Dataset | None = None
) -> Figure:
    """Draw a row of three panels for each signal: overlay, residual, spectra.

    Parameters
    ----------
    measured, simulated : xarray.Dataset
        Signals over uniform ``time`` by the same names, with units; NaN is not drawn.
    band : xarray.Dataset, optional
        Half width of the simulated signals' confidence band.

    Returns
    -------
    matplotlib.figure.Figure
    """
    names = [str(name) for name in measured.data_vars]
    figure, panels = plt.subplots(
        len(names),
        3,
        squeeze=False,
        figsize=(14, 0.8 + 2.4 * len(names)),
        layout="constrained",
    )
    for row, name in zip(panels, names, strict=True):
        overlay, rest, spectra = row
        plot_response(
            measured[name], simulated[name], None if band is None else band[name], overlay
        )
        residual = (measured[name] - simulated[name]).assign_attrs(simulated[name].attrs)
        plot_time_series({"residual": residual}, rest)
        plot_spectra({"measured": measured[name], "residual": residual}, spectra)
        overlay.set_title(name)
        rest.set_title("residual")
        spectra.set_title("spectra")
    return figure


def plot_response(
    measured: xr.DataArray,
    simulated: xr.DataArray,
    band: xr.DataArray | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw one signal as measured and as simulated.

    Parameters
    ----------
    measured, simulated : xarray.DataArray
        Over ``time``, with units; NaN is not drawn.
    band : xarray.DataArray, optional
        Half width of the simulated signal's confidence band.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = plot_time_series({"measured": measured, "simulated": simulated}, ax)
    ax.lines[-2].set_linewidth(2.5)  # so that it shows beneath a model that fits
    if band is not None:
        _shade(ax, simulated, band)
    return ax


def plot_spectra(signals: dict[str, xr.DataArray], ax: Axes) -> Axes:
    """Draw amplitude spectral densities (Welch) over frequency.

    Parameters
    ----------
    signals : dict of str to xarray.DataArray
        Signals over uniform ``time``; samples that are NaN are left out.
    ax : matplotlib.axes.Axes
        Where to draw.

    Returns
    -------
    matplotlib.axes.Axes
    """
    unit = ""
    for style, (label, signal) in zip(LINE_STYLES[1:], signals.items(), strict=False):
        values = np.asarray(signal.values, dtype=float)
        values = values[np.isfinite(values)]
        if values.size < 8:
            continue
        time = signal["time"].values
        rate = (time.size - 1) / float(time[-1] - time[0])
        frequency, density = welch(values, rate, nperseg=min(values.size, 4096))
        ax.plot(frequency[1:], np.sqrt(density[1:]), label=label, **style)
        unit = str(signal.attrs.get("units", ""))
    if ax.lines:
        log_axis(ax, "x", "frequency", "Hz")
        ax.set_yscale("log")
    ax.set_ylabel(f"amplitude density [{unit or '1'}/sqrt(Hz)]")
    if ax.lines:
        ax.legend(loc="best")
    return ax


def _shade(ax: Axes, signal: xr.DataArray, width: xr.DataArray) -> None:
    low, high = signal - width, signal + width
    time = signal["time"].values
    ax.fill_between(time, low.values, high.values, alpha=0.3, color="#d55e00", label="95 % band")
    ax.legend(loc="best")
