"""Figures as reports want them: narrow with large letters, so that a phone shows them legibly."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robustpolish.plotting import plot_panels
from robustpolish.report.document import Picture

# A page 390 pixels wide shows 6 inches at 0.83 pixels per point: 13 points become 11 pixels.
WIDTH = 6.0
_STYLE: dict[Any, Any] = {
    "font.size": 13,
    "axes.labelsize": 13,
    "legend.fontsize": 12,
    "lines.linewidth": 1.3,
}


def picture(caption: str, draw: Callable[[Axes], object], height: float = 3.6) -> Picture:
    """Return a picture of one pair of axes that `draw` fills."""
    with report_style():
        figure, axes = plt.subplots(figsize=(WIDTH, height), layout="constrained")
        draw(axes)
        plt.close(figure)
    return Picture(caption, figure)


def panels(caption: str, responses: Mapping[str, xr.Dataset], signals: Sequence[str]) -> Picture:
    """Return a picture of signals over time, one panel each."""
    with report_style():
        figure = plot_panels(responses, signals, WIDTH)
        plt.close(figure)
    return Picture(caption, figure)


def whole(caption: str, draw: Callable[[float], Figure]) -> Picture:
    """Return a picture that `draw` makes for a width in inches."""
    with report_style():
        figure = draw(WIDTH)
        plt.close(figure)
    return Picture(caption, figure)


@contextmanager
def report_style() -> Iterator[None]:
    """Draw with the letters of reports."""
    with mpl.rc_context(_STYLE):
        yield
