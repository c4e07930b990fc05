"""What a controller achieves against what it costs."""

from __future__ import annotations

import xarray as xr
from matplotlib.axes import Axes

from robustpolish.plotting.style import MARKER_STYLES, log_axis, new_axes, si_axis


def plot_gain_against_norm(points: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw one marker for each controller: its norm over its gain.

    Parameters
    ----------
    points : xarray.Dataset
        ``gain`` and ``norm`` over ``controller``; each with a ``long_name`` and ``units`` in its
        attributes. What is not finite is left out.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = new_axes(ax)
    known = points.where((points["gain"] > 0) & (points["norm"] > 0)).dropna("controller")
    for i, name in enumerate(known["controller"].values):
        one = known.sel(controller=name)
        style = MARKER_STYLES[i % len(MARKER_STYLES)]
        ax.plot(
            float(one["gain"]), float(one["norm"]), linestyle="", label=str(name), markersize=8,
            fillstyle="none", **style,
        )  # fmt: skip
    for which, key in (("x", "gain"), ("y", "norm")):
        name, unit = (str(points[key].attrs.get(k, "")) for k in ("long_name", "units"))
        values = known[key].values
        axis = ax.xaxis if which == "x" else ax.yaxis
        if values.size and values.max() > (1.5 if which == "x" else 10) * values.min():
            log_axis(ax, which, name, unit)
        else:
            si_axis(axis, name, unit)
    if known.sizes["controller"]:
        ax.legend(loc="best")
    return ax
