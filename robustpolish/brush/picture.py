"""A run of the brush on its mould in three dimensions."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from robustpolish.brush.surfaces.mould import Mould
from robustpolish.brush.surfaces.polished_surface import PolishedSurface
from robustpolish.plotting import plot_path_in_space

_PLACES = 80


def plot_polishing(signals: xr.Dataset, surface: PolishedSurface, ax: Any = None) -> Any:
    """Draw a mould and the path of the tool on it, coloured by the contact force.

    Parameters
    ----------
    signals : xarray.Dataset
        A run of :func:`robustpolish.simulate_brush`.
    surface : Surface or Mould
        The one of that run.
    ax : mpl_toolkits.mplot3d.Axes3D, optional

    Returns
    -------
    mpl_toolkits.mplot3d.Axes3D

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> import robustpolish as rp
    >>> signals = rp.simulate_brush(duration=0.05)
    >>> rp.plot_polishing(signals, rp.Surface()).get_zlabel()
    'z [mm]'
    >>> plt.close("all")
    """
    if isinstance(surface, Mould):
        x, y = surface.x, surface.y
    else:
        reach = 1.2 * float(signals.attrs["radius"])
        x, y = (
            np.linspace(float(part.min()) - reach, float(part.max()) + reach, _PLACES)
            for part in (signals["tool_x"], signals["tool_y"])
        )
    heights = surface.height(x[:, None], y[None, :])
    ground = xr.DataArray(heights, {"x": x, "y": y}, ("x", "y"))
    place = tuple(signals[name] for name in ("tool_x", "tool_y", "surface_height"))
    return plot_path_in_space(ground, place, _met(signals), ax)


def _met(signals: xr.Dataset) -> xr.DataArray:
    """Return the normal force of the whole rim; of the listing, which has none, that upwards."""
    if "contact_force" not in signals:
        return signals["F_z"]
    total = signals["contact_force"].sum("point")
    return total.assign_attrs(units="N", long_name="contact force")
