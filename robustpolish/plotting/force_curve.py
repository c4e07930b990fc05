"""A force over what it depends on, with its band."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from robustpolish.plotting.style import LINE_STYLES, legend, new_axes, si_axis


def plot_force_curve(
    force: xr.DataArray, band: xr.DataArray | None = None, ax: Axes | None = None
) -> Axes:
    """Draw a force over a displacement or a velocity, or what else its name says over time.

    Parameters
    ----------
    force : xarray.DataArray
        Over one dimension, both with units; its name stands at the axis.
    band : xarray.DataArray, optional
        Half width of the 95 % band; where it is not finite, none is drawn.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = new_axes(ax)
    name = str(force.dims[0])
    x, y = force[name].values, force.values
    ax.axhline(0.0, **{**LINE_STYLES[0], "linewidth": 0.8})
    ax.plot(x, y, label="learned", **LINE_STYLES[1])
    if band is not None:
        # a band of many times the force would flatten the curve
        half = np.minimum(np.nan_to_num(band.values, posinf=np.inf), np.ptp(y))
        shade = {"alpha": 0.3, "color": LINE_STYLES[2]["color"], "label": "95 % band"}
        ax.fill_between(x, y - half, y + half, **shade)
    si_axis(ax.xaxis, name, str(force[name].attrs.get("units", "")))
    si_axis(ax.yaxis, str(force.name or "force"), str(force.attrs.get("units", "")))
    legend(ax)
    return ax
