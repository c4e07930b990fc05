import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

from robustpolish.plots.charts import plot_path_in_space

X, Y = np.linspace(0, 0.03, 7), np.linspace(0, 0.02, 5)
MAP = xr.DataArray(np.add.outer(X, Y), {"x": X, "y": Y}, ("x", "y"), "depth", {"units": "m"})


def test_a_path_stands_in_space_in_millimetres():
    time = np.linspace(0, 1, 11)
    place = tuple(xr.DataArray(0.01 * time, dims="time") for _ in range(3))
    colour = xr.DataArray(time, dims="time", name="force", attrs={"units": "N"})
    ax = plot_path_in_space(MAP, place, colour)
    _, line = ax.collections
    assert len(line.get_array()) == 10
    plt.close("all")
