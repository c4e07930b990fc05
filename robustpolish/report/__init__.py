"""Reports that an engineer hands to a colleague."""

from robustpolish.display import Table
from robustpolish.report.document import Picture, Report, Section
from robustpolish.report.html import render_html

__all__ = ["Picture", "Report", "Section", "Table", "render_html"]
