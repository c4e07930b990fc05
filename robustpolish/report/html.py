"""A report as one HTML file that needs no network."""

from __future__ import annotations

import io
from importlib import resources
from typing import Any

import jinja2
import matplotlib as mpl
from markupsafe import Markup
from matplotlib.figure import Figure

from robustpolish.display import Table, shown
from robustpolish.report.document import Report
from robustpolish.report.pictures import report_style


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
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    environment.filters["svg"] = _svg
    environment.filters["cell"] = lambda value, digits: shown(value, digits, missing="–")
    environment.filters["numbers"] = _numbers
    source = resources.files("robustpolish.report").joinpath("template.html").read_text("utf-8")
    return environment.from_string(source).render(report=report, version=version)


def _svg(figure: Figure) -> Markup:
    """Draw a figure as inline SVG; its text stays text, so that it can be searched."""
    buffer = io.StringIO()
    # A fixed salt and no date make the same report the same file.
    salted: dict[Any, Any] = {"svg.fonttype": "none", "svg.hashsalt": "robustpolish"}
    with report_style(), mpl.rc_context(salted):  # ticks are made when they are drawn
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    text = buffer.getvalue()
    return Markup(text[text.index("<svg") :])


def _numbers(table: Table) -> list[bool]:
    """Tell which columns to set flush right: those that hold a number anywhere."""
    columns = zip(*table.rows, strict=True)
    found = [any(isinstance(cell, int | float) for cell in column) for column in columns]
    return found or [False] * len(table.columns)
