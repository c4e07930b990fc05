"""Something over a plane."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from robustpolish.plotting.style import new_axes, si_axis


def plot_over_plane(
    shown: xr.DataArray, ax: Axes | None = None, *, level: float | None = None
) -> Axes:
    """Draw a map over x and y: dark is little, light is much.

    Parameters
    ----------
    shown : xarray.DataArray
        Over ``x`` and ``y``, with units.
    ax : matplotlib.axes.Axes, optional
    level : float, optional
        Where to draw a line.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = new_axes(ax)
    x, y = shown["x"].values, shown["y"].values
    values = shown.transpose("y", "x").values
    image = ax.pcolormesh(x, y, values, cmap="cividis", rasterized=True)
    known = values[np.isfinite(values)]
    if level is not None and known.size and known.min() < level < known.max():
        ax.contour(x, y, values, levels=[level], colors="white", linewidths=1.5)
    colorbar = ax.figure.colorbar(image, ax=ax)
    si_axis(colorbar.ax.yaxis, str(shown.name), str(shown.attrs.get("units", "")))
    si_axis(ax.xaxis, "x", "m")
    si_axis(ax.yaxis, "y", "m")
    ax.set_aspect("equal")
    return ax
