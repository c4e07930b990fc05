"""The report stands alone, escapes what it is given and always comes out the same."""

import re

import matplotlib.pyplot as plt
import pytest

from robustpolish.app.report.html import Picture, Report, Section, render_html
from robustpolish.base.results import Table


@pytest.fixture
def page():
    figure, axes = plt.subplots()
    axes.plot([0, 1], [0, 1])
    axes.set_xlabel("time [s]")
    plt.close(figure)
    table = Table("Deviations", ("row", "y [m]"), (("a <b>", 1.25e-6), ("none", float("nan"))))
    section = Section("What was gained", ("It works.",), (Picture("A line", figure),), (table,))
    return render_html(Report("Design", "Certified & checked.", True, (section,)), "1.2.3")


def test_it_needs_no_network(page):
    links = re.findall(r"(?:src|href)=\"(?!#|data:)([^\"]+)\"", page)
    assert links == []
    assert "url(http" not in page


def test_content_is_there_and_escaped(page):
    assert "Certified &amp; checked." in page
    assert "a &lt;b&gt;" in page
    assert "<b>" not in page
    assert "1.25e-06" in page
    assert '<td data-value="nan" class="number">–</td>' in page
    assert "time [s]" in page
    assert "robustpolish 1.2.3" in page
