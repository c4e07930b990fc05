"""A report as one HTML file that needs no network."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import jinja2
import matplotlib as mpl
import matplotlib.pyplot as plt
import xarray as xr
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robustpolish.base import results
from robustpolish.base.results import Table, shown
from robustpolish.plots.time import plot_panels

# What a report consists of, whatever it reports.


@dataclass(frozen=True, eq=False)
class Picture:
    """A figure with a caption; it can be zoomed.

    Attributes
    ----------
    caption : str
    figure : matplotlib.figure.Figure
    """

    caption: str
    figure: Figure


@dataclass(frozen=True, eq=False)
class Section:
    """A heading with paragraphs, pictures and tables.

    Attributes
    ----------
    title : str
    text : tuple of str
        Paragraphs.
    pictures : tuple of Picture
    tables : tuple of Table
    points : tuple of str
        A list below the paragraphs.
    """

    title: str
    text: tuple[str, ...] = ()
    pictures: tuple[Picture, ...] = ()
    tables: tuple[Table, ...] = ()
    points: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Report:
    """A report: the verdict first, then the evidence.

    Attributes
    ----------
    title : str
    verdict : str
        One or two sentences.
    good : bool
        Whether the verdict is good news, which sets its colour.
    sections : tuple of Section
    """

    title: str
    verdict: str
    good: bool
    sections: tuple[Section, ...]


# Figures as reports want them: narrow with large letters, so that a phone shows them legibly.

# A page 390 pixels wide shows 6 inches at 0.83 pixels per point: 13 points become 11 pixels.
WIDTH = 6.0
_STYLE: dict[Any, Any] = dict.fromkeys(("font.size", "axes.labelsize"), 13)
_STYLE |= {"legend.fontsize": 12, "lines.linewidth": 1.3}


def whole(caption: str, draw: Callable[[float], Figure]) -> Picture:
    """Return a picture that `draw` makes for a width in inches."""
    with mpl.rc_context(_STYLE):
        figure = draw(WIDTH)
        plt.close(figure)
    return Picture(caption, figure)


def picture(caption: str, draw: Callable[[Axes], object], height: float = 3.6) -> Picture:
    """Return a picture of one pair of axes that `draw` fills."""

    def drawn(width: float) -> Figure:
        figure, axes = plt.subplots(figsize=(width, height), layout="constrained")
        draw(axes)
        return figure

    return whole(caption, drawn)


def panels(caption: str, responses: Mapping[str, xr.Dataset], signals: Sequence[str]) -> Picture:
    """Return a picture of signals over time, one panel each."""
    return whole(caption, lambda width: plot_panels(responses, signals, width))


# Templates beside this module: the HTML page, and the paragraphs of reports.


@cache
def _templates() -> jinja2.Environment:
    filters = {
        "svg": _svg,
        "cell": lambda value, digits: shown(value, digits, missing="–"),
        "numbers": _numbers,
        "us": lambda seconds: f"{1e6 * seconds:.3g} µs",
    }
    return results.templates("robustpolish.app.templates", filters)


def paragraphs(block: str, **values: Any) -> tuple[str, ...]:
    """Return the paragraphs of a block of ``texts.jinja`` with values filled in."""
    return results.paragraphs(_templates().get_template("texts.jinja"), block, **values)


def render_html(report: Report, version: str) -> str:
    """Render a report as a self-contained HTML page.

    Parameters
    ----------
    report : Report
    version : str
        Version of the package, for the footer.

    Returns
    -------
    str
        Pictures are inline SVG that can be zoomed, tables sort by a click on their heads, and a
        printed page shows the same.
    """
    return _templates().get_template("report.html").render(report=report, version=version)


def _svg(figure: Figure) -> Markup:
    """Draw a figure as inline SVG; its text stays text, so that it can be searched."""
    buffer = io.StringIO()
    # A fixed salt and no date make the same report the same file.
    salted: dict[Any, Any] = {"svg.fonttype": "none", "svg.hashsalt": "robustpolish"}
    with mpl.rc_context(_STYLE | salted):  # ticks are made when they are drawn
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    text = buffer.getvalue()
    return Markup(text[text.index("<svg") :])


def _numbers(table: Table) -> list[bool]:
    """Tell which columns to set flush right: those that hold a number anywhere."""
    columns = zip(*table.rows, strict=True)
    found = [any(isinstance(cell, int | float) for cell in column) for column in columns]
    return found or [False] * len(table.columns)
