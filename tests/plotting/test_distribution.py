"""Histograms with reference values."""

from itertools import pairwise

import numpy as np
import xarray as xr

from robustpolish.plots.charts import plot_distribution
from tests.plotting.legends import names


def test_every_value_is_counted_and_the_marks_stand_where_they_are():
    values = xr.DataArray(np.linspace(1e-6, 3e-6, 80), dims="machine", name="norm")
    values.attrs["units"] = "m/N"
    ax = plot_distribution(values, {"certificate": 2e-6, "limit": 4e-6}, note="2 left out")
    heights = [bar.get_height() for bar in ax.patches]
    assert (len(heights), sum(heights)) == (10, 80)
    assert [line.get_xdata()[0] for line in ax.lines] == [2e-6, 4e-6]
    assert names(ax) == ["certificate", "limit"]
    assert ax.get_xlabel() == "norm [µm/N]"
    assert ax.get_ylabel() == "number per bin (machine)"
    assert ax.get_title() == "2 left out"


def test_nothing_at_all_leaves_the_marks():
    ax = plot_distribution(xr.DataArray(np.zeros(0), dims="machine"), {"certificate": 1.0})
    assert not ax.patches
    assert names(ax) == ["certificate"]


def test_ticks_of_values_that_hardly_scatter_are_told_apart():
    values = xr.DataArray(1.00002e-4 + 2e-11 * np.linspace(0, 1, 60), dims="machine", name="norm")
    values.attrs["units"] = "m/N"
    ax = plot_distribution(values)
    ax.figure.canvas.draw()
    labels = [label for label in ax.get_xticklabels() if label.get_text()]
    assert len({label.get_text() for label in labels}) == len(labels)
    boxes = [label.get_window_extent() for label in labels]
    assert all(a.x1 < b.x0 for a, b in pairwise(boxes))
    assert all(tick == round(tick) for tick in ax.get_yticks())
