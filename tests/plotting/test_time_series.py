"""Long records keep their peaks when they are drawn."""

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

from robustpolish.plots.time import plot_time_series


def test_a_single_peak_survives_the_reduction():
    values = np.zeros(100_001)
    values[54_321] = 7.0
    values[-1] = -3.0
    signal = xr.DataArray(
        values,
        dims="time",
        coords={"time": np.arange(values.size) / 2e4},
        name="y",
        attrs={"units": "m"},
    )
    axes = plot_time_series({"y": signal})
    time, drawn = axes.lines[0].get_data()
    assert drawn.size < 6000
    assert drawn.max() == 7.0
    assert drawn[-1] == -3.0
    assert time[np.argmax(drawn)] == 54_321 / 2e4
    assert (np.diff(time) > 0).all()
    assert axes.get_legend() is None
    plt.close(axes.figure)


def signal(name, values, unit="N"):
    time = np.linspace(0.0, 1.0, len(values))
    return xr.DataArray(values, {"time": time}, "time", name, {"units": unit})


def test_an_axis_of_several_signals_bears_their_unit_alone():
    one, other = signal("F_x", [0.0, 1.0]), signal("F_y", [1.0, 2.0])
    assert plot_time_series({"F_x": one, "F_y": other}).get_ylabel() == "[N]"
    assert plot_time_series({"before": one, "after": one}).get_ylabel() == "F_x [N]"


def test_names_stand_above_a_band():
    quick = signal("y", np.sin(np.linspace(0.0, 5000.0, 20_001)))
    ax = plot_time_series({"without": quick, "with": 0.0 * quick}, bands=True)
    ax.figure.canvas.draw()
    box = ax.get_legend().get_window_extent()
    assert box.y0 >= ax.get_window_extent().y1 - 1
