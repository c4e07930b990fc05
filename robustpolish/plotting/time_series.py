"""Signals over time, drawn so that no peak gets lost."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray

from robustpolish.plotting.style import LINE_STYLES, new_axes, si_axis

_BINS = 2000
# A band has fewer bins, so that each holds some periods and the edges are smooth, and is drawn
# where the signal moves through this part of its range within a typical bin.
_BAND_BINS = 400
_QUICK = 0.05


def plot_time_series(
    signals: Mapping[str, xr.DataArray], ax: Axes | None = None, *, bands: bool = False
) -> Axes:
    """Draw signals over time.

    Long records are reduced to the smallest and largest value per bin, so that every peak stays
    visible and the file stays small.

    Parameters
    ----------
    signals : mapping of str to xarray.DataArray
        Signals over `time` by the name in the legend; the units come from their attributes.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.
    bands : bool, optional
        Draw oscillations that are too quick to be seen one by one as a pale band between their
        smallest and largest values, through which the other signals show.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = new_axes(ax)
    unit, banded = "", False
    shown: set[str] = set()
    for i, (label, signal) in enumerate(signals.items()):
        time, values = signal["time"].to_numpy(), signal.to_numpy()
        style = LINE_STYLES[(i if len(signals) > 1 else 1) % len(LINE_STYLES)]
        band = _band(time, values) if bands else None
        if band is not None:
            banded = True
            _draw_band(ax, band, label, style["color"])
        else:
            ax.plot(*_envelope(time, values), label=label, linewidth=1.0, **style)
        shown.add(str(signal.name or ""))
        unit = signal.attrs.get("units", "")
    si_axis(ax.xaxis, "time", "s")
    si_axis(ax.yaxis, shown.pop() if len(shown) == 1 else "", unit)  # the legend names the others
    if len(signals) > 1 and banded:  # "best" does not see what lies within a band
        ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=min(len(signals), 3))
    elif len(signals) > 1:
        ax.legend(loc="best")
    return ax


def _band(
    time: NDArray[np.float64], values: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]] | None:
    """Return time, smallest and largest value of bins; None for what a line can show."""
    size = values.size // _BAND_BINS
    if size < 4:
        return None
    whole = values[: size * _BAND_BINS].reshape(_BAND_BINS, size)
    low, high = whole.min(axis=1), whole.max(axis=1)
    if np.median(high - low) <= _QUICK * np.ptp(values):
        return None
    turns = np.sum(np.diff(np.sign(np.diff(whole, axis=1)), axis=1) != 0, axis=1)
    if np.median(turns) < 2:  # steep, not quick
        return None
    middles = time[: size * _BAND_BINS].reshape(_BAND_BINS, size).mean(axis=1)
    return middles, low, high


def _draw_band(ax: Axes, band: tuple[NDArray[np.float64], ...], label: str, color: str) -> None:
    time, low, high = band
    ax.fill_between(time, low, high, facecolor=color, alpha=0.35, label=label, linewidth=0)
    for edge in (low, high):
        ax.plot(time, edge, color=color, linewidth=0.8)


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
