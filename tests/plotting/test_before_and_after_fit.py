import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr

from robustpolish.plots.time import plot_before_and_after

TIME = np.arange(100) / 10


def signal(size):
    return xr.DataArray(size * np.sin(TIME), {"time": TIME}, "time", "x", {"units": "m"})


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


def test_what_each_model_leaves_stands_below_it():
    above, below = plot_before_and_after(signal(1.0), signal(0.5), signal(0.9)).axes
    sizes = [np.abs(np.asarray(line.get_ydata())).max() for line in above.lines]
    top = np.abs(np.sin(TIME)).max()
    assert sizes == pytest.approx([top, 0.5 * top, 0.9 * top])
    rest = [np.abs(np.asarray(line.get_ydata())).max() for line in below.lines]
    assert rest == pytest.approx([0.5 * top, 0.1 * top])
    # one model looks the same in every panel
    colours = [
        {str(line.get_label()): line.get_color() for line in ax.lines} for ax in (above, below)
    ]
    assert colours[1].items() <= colours[0].items()
    assert below.get_ylabel() == "residual [m]" or below.get_ylabel().startswith("residual")


def test_a_stretch_is_shown_large_and_marked_in_the_whole():
    figure = plot_before_and_after(signal(1.0), None, signal(0.9), slice(2.0, 4.0), width=6.0)
    above, below, whole = figure.axes
    for ax in (above, below):
        times = np.asarray(ax.lines[0].get_xdata())
        assert (times[0], times[-1]) == pytest.approx((2.0, 4.0))
    assert len(whole.lines[0].get_xdata()) == 100
    assert whole.patches[0].get_x() == 2.0
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["measured", "after"]
    assert [ax.get_legend() for ax in figure.axes] == [None] * 3
    assert figure.get_size_inches()[0] == 6.0
