import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr

from robustpolish.plots.time import plot_distances, plot_two_machines

TIME = np.arange(100) / 10


def signal(size, unit="m"):
    return xr.DataArray(size * np.cos(TIME), {"time": TIME}, "time", "x", {"units": unit})


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


def test_the_difference_stands_against_the_noise():
    runs = [signal(1.0), signal(0.5), signal(0.9)]
    drive, both, apart = plot_two_machines(signal(3.0, "N"), runs, ("one", "other"), 0.02).axes
    assert np.asarray(drive.lines[0].get_ydata())[0] == pytest.approx(3.0)
    assert [str(line.get_label()) for line in both.lines] == ["one", "other"]
    assert [line.get_ydata()[0] for line in apart.lines] == pytest.approx([0.5, 0.1])
    (band,) = apart.patches
    assert (band.get_y(), band.get_height()) == pytest.approx((-0.04, 0.08))
    assert len(plot_two_machines(None, runs, ("one", "other"), 0.02).axes) == 2


def test_bars_show_what_tells_and_what_does_not():
    ratios = xr.DataArray([5.0, 0.2, 0.0], {"experiment": list("abc")}, name="over noise")
    ax = plot_distances(ratios, 0.75)
    told, not_told, nothing = ax.patches
    assert [bar.get_width() for bar in ax.patches] == pytest.approx([5.0, 0.2, 1e-3])
    assert told.get_facecolor() != not_told.get_facecolor() == nothing.get_facecolor()
    assert ax.lines[0].get_xdata()[0] == 0.75
    assert [label.get_text() for label in ax.get_yticklabels()] == list("abc")
    assert ax.get_xscale() == "log"
