"""What all plots share: colours that the colour-blind tell apart, and axes with SI prefixes."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any

import matplotlib.pyplot as plt
from matplotlib.ticker import EngFormatter, LogLocator, NullFormatter

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

# Okabe and Ito's colours, dark to light, with line styles for a print in grey.
LINE_STYLES: tuple[dict[str, Any], ...] = (
    {"color": "#999999", "linestyle": "-"},
    {"color": "#0072b2", "linestyle": "-"},
    {"color": "#d55e00", "linestyle": "--"},
    {"color": "#009e73", "linestyle": "-."},
    {"color": "#cc79a7", "linestyle": ":"},
    {"color": "#000000", "linestyle": "--"},
)
# The same for points and for areas.
MARKER_STYLES: tuple[dict[str, Any], ...] = (
    {"color": "#0072b2", "marker": "o"},
    {"color": "#d55e00", "marker": "s"},
    {"color": "#009e73", "marker": "^"},
    {"color": "#cc79a7", "marker": "D"},
    {"color": "#000000", "marker": "v"},
    {"color": "#56b4e9", "marker": "P"},
)
LEVEL: dict[str, Any] = {"facecolor": "#999999", "edgecolor": "#333333"}
GOOD: dict[str, Any] = {"facecolor": "#56b4e9", "edgecolor": "#333333", "hatch": "//"}
BAD: dict[str, Any] = {"facecolor": "#d55e00", "edgecolor": "#333333", "hatch": "xx"}

# A prefix before a power ("mm^2") or a kilogram would be read wrongly.
_PREFIXABLE = re.compile(r"(?!kg\b|deg\b)[A-Za-zΩ]+(?![A-Za-zΩ^²³0-9])")
_FEW_DECADES = 1.5


def new_axes(ax: Axes | None) -> Axes:
    """Return `ax`, or the axes of a new figure."""
    return plt.subplots(layout="constrained")[1] if ax is None else ax


def si_axis(axis: Axis, name: str, unit: str) -> None:
    """Label an axis; its ticks carry the unit with an SI prefix, such as 35 um.

    Units that bear no prefix (none at all, %, 1/s, m^2, kg) stand in the label instead.
    """
    if _PREFIXABLE.match(unit):
        axis.set_major_formatter(EngFormatter(unit=unit))
        axis.set_label_text(name)
    else:
        axis.set_label_text(name if unit in ("", "1") else f"{name} [{unit}]")


def log_axis(ax: Axes, which: str, name: str, unit: str) -> None:
    """Make an axis logarithmic with a tick for each decade; call it when the data is drawn.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
    which : {"x", "y"}
    name, unit : str
        As for :func:`si_axis`.
    """
    axis = ax.xaxis if which == "x" else ax.yaxis
    (ax.set_xscale if which == "x" else ax.set_yscale)("log")
    low, high = ax.get_xlim() if which == "x" else ax.get_ylim()
    if math.log10(high / low) <= _FEW_DECADES:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    si_axis(axis, name, unit)
    if not _PREFIXABLE.match(unit):
        axis.set_major_formatter(lambda value, _: f"{value:.3g}")
    axis.set_minor_formatter(NullFormatter())


def legend(ax: Axes) -> None:
    """Add a legend where more than one thing has a name."""
    if len(ax.get_legend_handles_labels()[0]) > 1:
        ax.legend(loc="best")
