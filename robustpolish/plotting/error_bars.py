"""Values with bars of uncertainty over a positive quantity."""

from __future__ import annotations

from collections.abc import Mapping

import xarray as xr
from matplotlib.axes import Axes

from robustpolish.plotting.style import MARKER_STYLES, legend, new_axes, si_axis


def plot_error_bars(
    curves: Mapping[str, xr.DataArray],
    name: str,
    unit: str,
    ax: Axes | None = None,
    *,
    over: str,
) -> Axes:
    """Draw values with error bars over a logarithmic axis.

    Parameters
    ----------
    curves : mapping of str to xarray.DataArray
        Over the dimension `over`, with the coordinate ``bar``: half the length of each bar.
    name, unit : str
        Of the values.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.
    over : str
        Name of the dimension, positive numbers.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = new_axes(ax)
    for i, (label, curve) in enumerate(curves.items()):
        style = MARKER_STYLES[i % len(MARKER_STYLES)]
        ax.errorbar(
            curve[over].values, curve.values, curve["bar"].values, label=label, capsize=3, **style
        )
    ax.set_xscale("log")
    ax.set_xlabel(over)
    si_axis(ax.yaxis, name, unit)
    legend(ax, least=1)
    return ax
