"""A path above a surface in three dimensions."""

from __future__ import annotations

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from mpl_toolkits.mplot3d.art3d import Line3DCollection

from robustpolish.plotting.style import si_axis

_PIECES = 4000  # of a line; more are not seen
_ACROSS = 60  # lines of a surface


def plot_path_in_space(
    ground: xr.DataArray, place: tuple[xr.DataArray, ...], colour: xr.DataArray, ax: Any = None
) -> Any:
    """Draw a surface, and above it a path coloured by what was met along it.

    Parameters
    ----------
    ground : xarray.DataArray
        Heights over ``x`` and ``y`` [m]; nan where there is none.
    place : tuple of xarray.DataArray
        x, y and z of the path over time [m].
    colour : xarray.DataArray
        What colours the path, at the same times, with units.
    ax : mpl_toolkits.mplot3d.Axes3D, optional
        A new figure by default.

    Returns
    -------
    mpl_toolkits.mplot3d.Axes3D
        In mm, with heights drawn to the same scale.
    """
    if ax is None:
        figure = plt.figure(layout="constrained", figsize=(7, 5))
        ax = figure.add_subplot(projection="3d")
    thin = [slice(None, None, max(1, n // _ACROSS)) for n in ground.shape]
    shown = 1e3 * ground.transpose("x", "y").values[thin[0], thin[1]]
    x, y = np.meshgrid(
        1e3 * ground["x"].values[thin[0]], 1e3 * ground["y"].values[thin[1]], indexing="ij"
    )
    ax.plot_surface(x, y, shown, color="#cccccc", alpha=0.4, linewidth=0, rstride=1, cstride=1)
    every = max(1, colour.size // _PIECES)
    points = 1e3 * np.stack([part.values[::every] for part in place], axis=1)
    pieces = Line3DCollection(list(np.stack([points[:-1], points[1:]], axis=1)), cmap="cividis")
    pieces.set_array(colour.values[::every][:-1])
    pieces.set_linewidth(2.0)
    pieces.set_zorder(2.5)
    ax.computed_zorder = False  # the path lies on the surface and has to be seen
    ax.add_collection(pieces)
    bar = ax.figure.colorbar(pieces, ax=ax, shrink=0.7)
    si_axis(
        bar.ax.yaxis, str(colour.attrs.get("long_name", colour.name)), colour.attrs.get("units", "")
    )
    ax.set(xlabel="x [mm]", ylabel="y [mm]", zlabel="z [mm]")
    heights = shown[np.isfinite(shown)]
    ax.set_box_aspect((np.ptp(x), np.ptp(y), max(np.ptp(heights), 0.15 * np.ptp(x))))
    return ax
