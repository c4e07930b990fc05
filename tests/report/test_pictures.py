"""Figures as reports want them."""

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

from robustpolish.app.report.html import WIDTH, panels, picture, whole


def test_a_picture_is_narrow_with_large_letters_and_leaves_no_trace():
    before = mpl.rcParams["font.size"]
    found = picture("A line.", lambda axes: axes.plot([0, 1], [0, 1], label="a"), height=2.0)
    assert found.caption == "A line."
    assert tuple(found.figure.get_size_inches()) == (WIDTH, 2.0)
    assert found.figure.axes[0].get_xticklabels()[0].get_fontsize() >= 13
    assert mpl.rcParams["font.size"] == before
    assert plt.get_fignums() == []


def test_panels_show_the_signals_one_by_one():
    time = np.linspace(0, 1, 10)
    data = xr.Dataset({n: ("time", time, {"units": "m"}) for n in "xyz"}, {"time": time})
    found = panels("Motion.", {"loop": data}, ("x", "z"))
    assert [axes.get_ylabel() for axes in found.figure.axes] == ["x [m]", "z [m]"]
    assert found.figure.get_size_inches()[0] == WIDTH
    assert plt.get_fignums() == []


def test_a_whole_figure_is_drawn_as_wide_as_reports_want_it():
    found = whole("All.", lambda width: plt.subplots(2, 1, figsize=(width, 4.0))[0])
    assert (found.caption, found.figure.get_size_inches()[0]) == ("All.", WIDTH)
    assert len(found.figure.axes) == 2
    assert plt.get_fignums() == []
