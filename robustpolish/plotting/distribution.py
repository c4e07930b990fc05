"""How a number scatters, and where reference values lie."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from robustpolish.plotting.style import LEVEL, LINE_STYLES, legend, new_axes, si_axis

# Values that hardly scatter have long numbers at their ticks.
_TICKS = 4


def plot_distribution(
    values: xr.DataArray,
    marks: Mapping[str, float] | None = None,
    ax: Axes | None = None,
    *,
    note: str = "",
) -> Axes:
    """Draw a histogram with reference values as vertical lines.

    Parameters
    ----------
    values : xarray.DataArray
        Over one dimension; named, with units. None at all gives an empty picture with its marks.
    marks : mapping of str to float, optional
        Reference values by their name in the legend.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.
    note : str, optional
        A remark for the upper edge.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = new_axes(ax)
    numbers = np.asarray(values.values, dtype=float)
    if numbers.size:
        ax.hist(numbers, bins=min(30, max(5, numbers.size // 8)), **LEVEL)
    for style, (name, value) in zip(LINE_STYLES[1:], (marks or {}).items(), strict=False):
        ax.axvline(value, label=name, **style)
    si_axis(ax.xaxis, str(values.name or ""), str(values.attrs.get("units", "")))
    ax.xaxis.set_major_locator(MaxNLocator(_TICKS))
    ax.yaxis.set_major_locator(MaxNLocator(integer=True))
    ax.set_ylabel(f"number per bin ({values.dims[0]})")
    if note:
        ax.set_title(note, fontsize="medium")
    legend(ax, least=1 if marks else 2)
    return ax
