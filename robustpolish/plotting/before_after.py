"""Signals before and after, one panel each, with a closer look where they oscillate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from robustpolish.plotting.style import si_axis
from robustpolish.plotting.time_series import plot_time_series
from robustpolish.si_prefix import prefix_power

# Periods of the slowest quick oscillation that the closer look shows, and how many the whole record
# must have to need one.
_SHOWN_PERIODS = 6
_TOO_MANY = 60


def plot_panels(
    responses: Mapping[str, xr.Dataset], signals: Sequence[str], width: float = 9.0
) -> Figure:
    """Draw every signal in a panel of its own, over a common time axis.

    Where signals oscillate too quickly to be seen they become bands, and a second column shows
    some periods from the middle of the record.

    Parameters
    ----------
    responses : mapping of str to xarray.Dataset
        Signals over `time`, by the name in the legend.
    signals : sequence of str
        Names of the variables; each response shows those that it has.
    width : float, optional
        Inches.

    Returns
    -------
    matplotlib.figure.Figure
    """
    shown = {name: {k: r[name] for k, r in responses.items() if name in r} for name in signals}
    closer = _closer([signal for found in shown.values() for signal in found.values()])
    figure, panels = plt.subplots(
        len(signals),
        1 if closer is None else 2,
        sharex="col",
        sharey="row",
        squeeze=False,
        figsize=(width, 1.4 + 1.7 * len(signals)),
        width_ratios=None if closer is None else (5, 3),
        layout="constrained",
    )
    for row, found in zip(panels, shown.values(), strict=True):
        plot_time_series(found, row[0], bands=True)
        if closer is not None:
            part = {label: signal.sel(time=slice(*closer)) for label, signal in found.items()}
            plot_time_series(part, row[1])
            row[1].set_ylabel("")
            row[1].margins(x=0)
        for ax in row:
            ax.label_outer()
            if ax.get_legend():
                ax.get_legend().remove()
    if closer is not None:
        panels[-1, 1].xaxis.set_major_locator(MaxNLocator(2))
    _share_prefixes(list(panels[:, 0]), shown)
    handles, labels = panels[0, 0].get_legend_handles_labels()
    if len(labels) > 1:
        figure.legend(handles, labels, loc="outside upper center", ncols=min(len(labels), 3))
    return figure


def _closer(signals: Sequence[xr.DataArray]) -> tuple[float, float] | None:
    """Return from when to when some periods show; None where no oscillation is too quick."""
    periods = [period for signal in signals if (period := _period(signal)) is not None]
    if not periods:
        return None
    time = signals[0]["time"].to_numpy()
    length, middle = _SHOWN_PERIODS * max(periods), (time[0] + time[-1]) / 2
    return float(middle), float(middle + length)


def _period(signal: xr.DataArray) -> float | None:
    """Return the period that dominates a signal, if the record holds too many to be seen."""
    time, values = signal["time"].to_numpy(), signal.to_numpy()
    if values.size < 4 * _TOO_MANY or not np.isfinite(values).all():
        return None
    content = np.abs(np.fft.rfft(values - values.mean()))
    strongest = int(content.argmax())
    if strongest < _TOO_MANY:
        return None
    return float(time[-1] - time[0]) / strongest


def _share_prefixes(axes: Sequence[Axes], shown: Mapping[str, Mapping[str, xr.DataArray]]) -> None:
    """Give panels of one unit one prefix, that of the largest."""
    units = {
        name: str(next(iter(found.values())).attrs.get("units", "")) if found else ""
        for name, found in shown.items()
    }
    limits = [max(map(abs, ax.get_ylim())) for ax in axes]
    for ax, (name, unit) in zip(axes, units.items(), strict=True):
        alike = [v for v, u in zip(limits, units.values(), strict=True) if u == unit]
        si_axis(ax.yaxis, name, unit, prefix_power(max(alike)))
