"""What all plots share: colours that the colour-blind tell apart, and axes with SI prefixes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib.pyplot as plt
from matplotlib.ticker import EngFormatter

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


def new_axes(ax: Axes | None) -> Axes:
    """Return `ax`, or the axes of a new figure."""
    return plt.subplots(layout="constrained")[1] if ax is None else ax


def si_axis(axis: Axis, name: str, unit: str) -> None:
    """Label an axis; its ticks carry the unit with an SI prefix, such as 35 um."""
    axis.set_major_formatter(EngFormatter(unit=unit))
    axis.set_label_text(name)
