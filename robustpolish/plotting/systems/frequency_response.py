"""Gains over frequency."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from robustpolish.plotting.style import LINE_STYLES, legend, log_axis, new_axes


def plot_gains(
    gains: Mapping[str, xr.DataArray],
    marks: Mapping[str, tuple[float, float]] | None = None,
    ax: Axes | None = None,
    *,
    name: str = "largest singular value",
    first_style: int = 1,
) -> Axes:
    """Draw gains over frequency on logarithmic axes.

    Parameters
    ----------
    gains : mapping of str to xarray.DataArray
        Over ``frequency`` in Hz by the name in the legend; the unit comes from the attributes, or
        several of them with commas between, if the gain mixes channels.
    marks : mapping of str to (float, float), optional
        Points to mark: frequency in Hz and gain. A frequency that is not positive and finite
        makes a level line.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.
    name : str, optional
        What the gain is.
    first_style : int, optional
        Where to begin in the list of line styles; 0 is grey, for a reference.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = new_axes(ax)
    unit = ""
    for i, (label, gain) in enumerate(gains.items(), first_style):
        values = np.where(gain.values > 0, gain.values, np.nan)
        style = LINE_STYLES[i % len(LINE_STYLES)]
        ax.plot(gain["frequency"].values, values, label=label, linewidth=1.2, **style)
        unit = str(gain.attrs.get("units", unit))
    for label, (frequency, value) in (marks or {}).items():
        if not np.isfinite(value) or value <= 0:
            continue
        if np.isfinite(frequency) and frequency > 0:
            ax.plot([frequency], [value], "o", color="black", fillstyle="none", label=label)
        else:
            ax.axhline(value, color="black", linewidth=0.8, linestyle=":", label=label)
    log_axis(ax, "x", "frequency", "Hz")
    if "," in unit:  # no prefix suits all of them
        name, unit = f"{name} [{unit}]", ""
    log_axis(ax, "y", name, unit)
    legend(ax, least=1)
    return ax


def plot_over_frequency(
    curves: xr.Dataset, name: str, ax: Axes | None = None, *, unit: str = ""
) -> Axes:
    """Draw positive curves over ``frequency`` in Hz on logarithmic axes.

    Parameters
    ----------
    curves : xarray.Dataset
        One variable per curve, by the name in the legend.
    name, unit : str
        Of the vertical axis.
    ax : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = new_axes(ax)
    for i, (label, curve) in enumerate(curves.data_vars.items(), 1):
        style = LINE_STYLES[i % len(LINE_STYLES)]
        ax.plot(curve["frequency"].values, curve.values, label=str(label), **style)
    log_axis(ax, "x", "frequency", "Hz")
    log_axis(ax, "y", name, unit)
    legend(ax)
    return ax
