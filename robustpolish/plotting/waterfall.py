"""How an error fell step by step."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.patches import Patch

from robustpolish.plotting.style import BAD, GOOD, LEVEL, new_axes, si_axis


def plot_waterfall(
    levels: xr.DataArray, floor: float | None = None, ax: Axes | None = None
) -> Axes:
    """Draw levels after each step, and what each step took away or added.

    Parameters
    ----------
    levels : xarray.DataArray
        Over ``step``, with a name and units; the first is drawn as a whole.
    floor : float, optional
        The level that noise leaves, a line across.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = new_axes(ax)
    names = [str(step) for step in levels["step"].values]
    values = levels.values.astype(float)
    for i, level in enumerate(values):
        if i == 0:
            ax.bar(i, level, **LEVEL)
        else:
            before = values[i - 1]
            style = GOOD if level <= before else BAD
            ax.bar(i, abs(level - before), bottom=min(level, before), **style)
            ax.plot([i - 1.4, i + 0.4], [before, before], color="#333333", linewidth=0.6)
        top = level if i == 0 else max(level, values[i - 1])
        change = "" if i == 0 else ("↓ to " if level <= values[i - 1] else "↑ to ")
        ax.annotate(
            f"{change}{level:.3g}",
            (i, top),
            (0, 3),
            textcoords="offset points",
            ha="center",
            va="bottom",
        )
    handles: list[Any] = [
        Patch(label="start", **LEVEL),
        Patch(label="taken away", **GOOD),
        *([Patch(label="added", **BAD)] if np.any(np.diff(values) > 0) else []),
    ]
    if floor is not None and np.isfinite(floor):
        label = f"noise floor, {floor:.3g}"
        handles.append(ax.axhline(floor, color="black", linestyle="--", linewidth=1, label=label))
    ax.set_xticks(range(len(names)), [name.replace("_", " ") for name in names])
    if len(names) > 3 or max(map(len, names), default=0) > 14:
        ax.tick_params(axis="x", rotation=20)
    ax.set_xlabel("step")
    si_axis(ax.yaxis, str(levels.name or "level"), str(levels.attrs.get("units", "")))
    ax.margins(y=0.2)  # for the numbers on top of the bars
    # Bars fill the picture: there is no place for names but above it.
    ax.legend(handles=handles, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    return ax
