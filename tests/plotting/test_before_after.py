"""Signals before and after, one panel each."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr

from robustpolish.plots.time import plot_panels
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
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["before", "after"]
    assert names(top) == names(bottom) == []  # told once, off the data
    assert (top.get_xlabel(), bottom.get_xlabel()) == ("", "time [s]")
    assert figure.get_size_inches()[0] == 6.0


def test_quick_oscillations_become_bands_with_a_closer_look():
    time = np.linspace(0, 2, 20_001)
    quick = np.sin(2 * np.pi * 500 * time) * 3e-5
    data = xr.Dataset(
        {n: ("time", v, {"units": "m"}) for n, v in (("x", quick), ("y", 1e-7 * time))},
        {"time": time},
    )
    figure = plot_panels({"loop": data}, ("x", "y"))
    whole, closer, below, _ = figure.axes
    edges = [line.get_ydata() for line in whole.lines]
    assert len(whole.collections) == 1
    np.testing.assert_allclose(edges[0], -3e-5, rtol=0.01)
    np.testing.assert_allclose(edges[1], 3e-5, rtol=0.01)
    shown = closer.lines[0].get_xdata()
    assert np.ptp(shown) == pytest.approx(0.012, rel=0.02)  # six periods
    assert not closer.collections
    assert not below.collections  # a ramp is not quick
    assert [ax.get_ylabel() for ax in (whole, closer, below)] == ["x [µm]", "", "y [µm]"]
    plt.close(figure)
