"""A positive number for each of several things."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.patches import Patch

from robustpolish.plotting.style import BAD, GOOD, log_axis, new_axes


def plot_bars(
    values: xr.DataArray, bad: xr.DataArray | None = None, ax: Axes | None = None, *,
    meaning: tuple[str, str] = ("good", "bad"),
) -> Axes:  # fmt: skip
    """Draw horizontal bars on a logarithmic axis, the first on top.

    Parameters
    ----------
    values : xarray.DataArray
        Over one dimension with labels; named, with units. What is zero or not finite gets no bar.
    bad : xarray.DataArray of bool, optional
        Which bars to draw as bad.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.
    meaning : (str, str), optional
        Names of the good and the bad bars in the legend.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = new_axes(ax)
    labels = [str(label) for label in values[values.dims[0]].values]
    numbers = np.asarray(values.values, dtype=float)
    flags = np.zeros(numbers.size, bool) if bad is None else np.asarray(bad.values, bool)
    places = np.arange(numbers.size)
    usable = np.isfinite(numbers) & (numbers > 0)
    least = numbers[usable].min() if usable.any() else 1.0
    for style, chosen in ((GOOD, ~flags), (BAD, flags)):
        shown = np.where(usable, numbers, 0.0)[chosen]
        ax.barh(places[chosen], shown, height=0.7, **style)
    ax.set_yticks(places, labels)
    ax.invert_yaxis()
    ax.set_xlim(least / 3, (numbers[usable].max() if usable.any() else 1.0) * 3)
    log_axis(ax, "x", str(values.name or ""), str(values.attrs.get("units", "")))
    ax.set_ylabel(str(values.dims[0]))
    if bad is not None:
        good, worse = meaning
        ax.legend(handles=[Patch(label=good, **GOOD), Patch(label=worse, **BAD)], loc="best")
    return ax
