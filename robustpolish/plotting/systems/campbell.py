"""Whirl frequencies of a rotor over its speed."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from robustpolish.plotting.style import new_axes, si_axis

_WAYS: dict[str, dict[str, Any]] = {
    "forward": {"color": "#0072b2", "linestyle": "-"},
    "backward": {"color": "#d55e00", "linestyle": "--"},
    "neither": {"color": "#009e73", "linestyle": "-."},
}
_CLEAR = 0.05
"""Below this roundness a whirl is drawn as going neither way."""


def plot_campbell(
    speeds: ArrayLike,
    frequencies: ArrayLike,
    whirl: ArrayLike,
    critical: ArrayLike = (),
    ax: Axes | None = None,
) -> Axes:
    """Draw a Campbell diagram: frequencies over speed by the way round, and the line of the spin.

    Parameters
    ----------
    speeds : array_like, shape (speeds,)
        In rad/s.
    frequencies : array_like, shape (speeds, modes)
        In Hz.
    whirl : array_like, shape (speeds, modes)
        From -1, backward, to 1, forward.
    critical : array_like, optional
        Critical speeds in rad/s, marked where the line of the spin meets the curves.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    matplotlib.axes.Axes
        Speed in rev/min across, frequency upwards.
    """
    ax = new_axes(ax)
    turns: np.ndarray = np.asarray(speeds, dtype=float) * 30 / math.pi
    heights, ways = np.asarray(frequencies, dtype=float), np.asarray(whirl, dtype=float)
    used: set[str] = set()
    for height, way in zip(heights.T, ways.T, strict=True):
        # At rest nothing goes round: the rest of the curve says which one it is.
        mean = float(way[np.abs(way).argmax()])
        name = "neither" if abs(mean) < _CLEAR else "forward" if mean > 0 else "backward"
        used.add(name)
        ax.plot(turns, height, **_WAYS[name])
    top = float(np.nanmax(heights, initial=0.0)) * 1.05
    ax.plot(turns, turns / 60, color="#999999", linewidth=0.8)
    where = np.asarray(critical, dtype=float) * 30 / math.pi
    if where.size:
        ax.plot(where, where / 60, "o", color="black", fillstyle="none")
    ax.set_xlim(float(turns.min()), float(turns.max()))
    ax.set_ylim(0.0, top or 1.0)
    ax.set_xlabel("speed [rev/min]")
    si_axis(ax.yaxis, "whirl frequency", "Hz")
    handles = [Line2D([], [], label=name, **way) for name, way in _WAYS.items() if name in used]
    handles.append(Line2D([], [], color="#999999", linewidth=0.8, label="once per turn"))
    if where.size:
        ring: dict[str, Any] = {"marker": "o", "color": "black", "fillstyle": "none"}
        handles.append(Line2D([], [], linestyle="", label="critical speed", **ring))
    ax.legend(handles=handles, loc="best")
    return ax
