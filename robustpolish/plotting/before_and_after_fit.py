"""A measured signal and two models of it, before and after a step, with what is left of both."""

from __future__ import annotations

import matplotlib.pyplot as plt
import xarray as xr
from matplotlib.figure import Figure

from robustpolish.plotting.style import LINE_STYLES
from robustpolish.plotting.time_series import plot_time_series


def plot_before_and_after(
    measured: xr.DataArray,
    before: xr.DataArray | None,
    after: xr.DataArray,
    stretch: slice | None = None,
    width: float = 9.0,
) -> Figure:
    """Draw a signal with two models of it, and below what each leaves.

    Parameters
    ----------
    measured, before, after : xarray.DataArray
        Over the same ``time``, with units; `before` may be missing.
    stretch : slice of float, optional
        Times between which single swings are shown, in s; the third panel shows the residuals of
        the whole record then.
    width : float, optional
        Inches.

    Returns
    -------
    matplotlib.figure.Figure
        Axes: signals, residuals, and residuals of the whole record.
    """
    models = {"before": before, "after": after}
    given = {label: signal for label, signal in models.items() if signal is not None}
    rest = {
        label: (measured - signal).assign_attrs(measured.attrs).rename("residual")
        for label, signal in given.items()
    }
    rows = 2 if stretch is None else 3
    figure, axes = plt.subplots(rows, 1, figsize=(width, 1.0 + 2.1 * rows), layout="constrained")
    shown = {"measured": measured, **given}
    for ax, signals in zip(axes[:2], (shown, rest), strict=True):
        inside = {k: s if stretch is None else s.sel(time=stretch) for k, s in signals.items()}
        plot_time_series(inside, ax)
        for line in ax.lines:  # one look for one thing in every panel
            line.set(**_STYLES[str(line.get_label())])
        if ax.get_legend() is not None:
            ax.get_legend().remove()
    axes[0].set_xlabel("")
    if stretch is not None:
        whole = axes[2]
        plot_time_series(rest, whole)
        for line in whole.lines:
            line.set(**_STYLES[str(line.get_label())])
        if whole.get_legend() is not None:
            whole.get_legend().remove()
        whole.axvspan(stretch.start, stretch.stop, color="#333333", alpha=0.15)
        whole.set_title("the whole record; shaded: shown above")
    # Swings fill every panel: there is no place for names but above them all.
    figure.legend(handles=axes[0].lines, loc="outside upper center", ncols=len(shown))
    return figure


_STYLES = {
    "measured": {**LINE_STYLES[0], "linewidth": 3.0},
    "before": LINE_STYLES[2],
    "after": LINE_STYLES[1],
}
