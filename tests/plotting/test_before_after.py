"""Signals before and after, one panel each."""

import numpy as np
import xarray as xr

from robustpolish.plotting import plot_panels
from tests.plotting.legends import names


def test_every_signal_has_a_panel_and_every_response_its_line():
    time = np.linspace(0, 1, 20)
    before = xr.Dataset(
        {n: ("time", np.full(20, v), {"units": "m"}) for n, v in (("x", 2.0), ("y", 3.0))},
        {"time": time},
    )
    after = before[["x"]] / 2  # it has no y
    figure = plot_panels({"before": before, "after": after}, ("x", "y"), 6.0)
    top, bottom = figure.axes
    np.testing.assert_array_equal([line.get_ydata()[0] for line in top.lines], [2.0, 1.0])
    np.testing.assert_array_equal([line.get_ydata()[0] for line in bottom.lines], [3.0])
    assert names(top) == ["before", "after"]
    assert names(bottom) == []  # told once
    assert (top.get_xlabel(), bottom.get_xlabel()) == ("", "time [s]")
    assert figure.get_size_inches()[0] == 6.0
