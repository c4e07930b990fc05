"""The same signals before and after, one panel each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import xarray as xr
from matplotlib.figure import Figure

from robustpolish.plotting.time_series import plot_time_series


def plot_panels(
    responses: Mapping[str, xr.Dataset], signals: Sequence[str], width: float = 9.0
) -> Figure:
    """Draw every signal in a panel of its own, over a common time axis.

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
    figure, panels = plt.subplots(
        len(signals),
        1,
        sharex=True,
        squeeze=False,
        figsize=(width, 1.0 + 1.7 * len(signals)),
        layout="constrained",
    )
    for ax, name in zip(panels[:, 0], signals, strict=True):
        plot_time_series(
            {label: response[name] for label, response in responses.items() if name in response},
            ax,
        )
        if ax is not panels[-1, 0]:
            ax.set_xlabel("")
        if ax is not panels[0, 0] and ax.get_legend():
            ax.get_legend().remove()
    return figure
