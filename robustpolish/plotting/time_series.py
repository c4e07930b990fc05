"""Signals over time, drawn so that no peak gets lost."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray

from robustpolish.plotting.style import LINE_STYLES, new_axes, si_axis

_BINS = 2000


def plot_time_series(signals: Mapping[str, xr.DataArray], ax: Axes | None = None) -> Axes:
    """Draw signals over time.

    Long records are reduced to the smallest and largest value per bin, so that every peak stays
    visible and the file stays small.

    Parameters
    ----------
    signals : mapping of str to xarray.DataArray
        Signals over `time` by the name in the legend; the units come from their attributes.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = new_axes(ax)
    name, unit = "", ""
    for i, (label, signal) in enumerate(signals.items()):
        time, values = _envelope(signal["time"].to_numpy(), signal.to_numpy())
        style = LINE_STYLES[(i if len(signals) > 1 else 1) % len(LINE_STYLES)]
        ax.plot(time, values, label=label, linewidth=1.0, **style)
        name, unit = str(signal.name or ""), signal.attrs.get("units", "")
    si_axis(ax.xaxis, "time", "s")
    si_axis(ax.yaxis, name, unit)
    if len(signals) > 1:
        ax.legend(loc="best")
    return ax


def _envelope(
    time: NDArray[np.float64], values: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Keep the smallest and the largest sample of every bin, in their order in time."""
    size = values.size // _BINS
    if size < 4:
        return time, values
    whole = values[: size * _BINS].reshape(_BINS, size)
    pairs = np.sort(np.stack([whole.argmin(axis=1), whole.argmax(axis=1)], axis=1), axis=1)
    kept = (pairs + size * np.arange(_BINS)[:, None]).ravel()
    kept = np.unique(np.concatenate([kept, np.arange(size * _BINS, values.size)]))
    return time[kept], values[kept]
