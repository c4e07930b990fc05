"""Two machines in one experiment: what drives them, what they do, and how far they are apart."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robustpolish.plotting.style import BAD, GOOD, LINE_STYLES, log_axis, new_axes
from robustpolish.plotting.time_series import plot_time_series


def plot_two_machines(
    drive: xr.DataArray | None,
    responses: Sequence[xr.DataArray],
    names: Sequence[str],
    noise: float,
    width: float = 9.0,
) -> Figure:
    """Draw an experiment on two machines, and their difference against the noise.

    Parameters
    ----------
    drive : xarray.DataArray or None
        What is driven, over ``time``; None for a free decay.
    responses : sequence of xarray.DataArray
        One output of both machines, and of the second after it took after the first.
    names : sequence of str
        Of the two machines.
    noise : float
        Standard deviation of the output's noise.
    width : float, optional
        Inches.

    Returns
    -------
    matplotlib.figure.Figure
        Axes: the drive if there is one, the outputs, the differences.
    """
    first, second, adapted = responses
    rows = 2 + (drive is not None)
    figure, axes = plt.subplots(
        rows, 1, sharex=True, figsize=(width, 1.0 + 2.1 * rows), layout="constrained"
    )
    if drive is not None:
        plot_time_series({"drive": drive}, axes[0])
        axes[0].set_xlabel("")
    both, apart = axes[-2:]
    plot_time_series(dict(zip(names, (first, second), strict=True)), both)
    both.lines[0].set(linewidth=2.5)
    both.set_xlabel("")
    rest = {
        "as they are": first - second,
        "second fitted anew": first - adapted,
    }
    unit = {"units": first.attrs.get("units", "")}
    plot_time_series({k: d.rename("difference").assign_attrs(unit) for k, d in rest.items()}, apart)
    for line, style in zip(apart.lines, (LINE_STYLES[2], LINE_STYLES[1]), strict=True):
        line.set(**style)
    band = "noise, twice its standard deviation"
    apart.axhspan(-2 * noise, 2 * noise, color="#333333", alpha=0.25, label=band)
    apart.legend(loc="best")
    return figure


def plot_distances(ratios: xr.DataArray, clear: float, ax: Axes | None = None) -> Axes:
    """Draw how far each experiment takes two machines apart, the largest on top.

    Parameters
    ----------
    ratios : xarray.DataArray
        Differences over the noise, over one dimension with labels.
    clear : float
        From where they are told apart.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = new_axes(ax)
    values = np.maximum(np.asarray(ratios.values, dtype=float), 1e-3)
    for place, value in enumerate(values):
        ax.barh(place, value, height=0.7, **(GOOD if value >= clear else BAD))
    ax.set_yticks(range(values.size), [str(label) for label in ratios[ratios.dims[0]].values])
    ax.invert_yaxis()
    ax.axvline(clear, color="black", linestyle="--", linewidth=1, label="told apart from here")
    ax.set_xlim(min(values.min(), clear) / 2, max(values.max(), clear) * 2)
    log_axis(ax, "x", str(ratios.name or "difference over noise"), "")
    ax.legend(loc="best")
    return ax
