"""Long records keep their peaks when they are drawn."""

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

from robustpolish.plotting import plot_time_series


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
