"""A residual over time and frequency."""

import numpy as np
import xarray as xr

from robustpolish import plots as plotting
from tests.plotting.legends import names


def test_the_residual_map_is_bright_where_the_residual_is():
    time = np.arange(8000) / 2000.0
    values = 1e-3 * np.sin(2 * np.pi * 200 * time) * (time > 3)
    values += 1e-9 * np.random.default_rng(0).standard_normal(time.size)
    residual = xr.DataArray(values, {"time": time}, "time", "a", {"units": "m"})
    ax = plotting.plot_residual_map(residual, {"mode": [200.0, 5e4]})
    mesh = ax.collections[0]
    density = mesh.get_array()
    row, column = np.unravel_index(np.argmax(density), density.shape)
    corners = mesh.get_coordinates()[row : row + 2, column : column + 2]
    assert corners[..., 0].min() > 2.9
    assert corners[..., 1].min() <= 200 <= corners[..., 1].max()
    assert names(ax) == ["mode"]
    assert ax.lines[0].get_ydata()[0] == 200
    assert ax.get_xlabel() == "time [s]"
    bar = ax.figure.axes[1]
    assert bar.get_ylabel() == "amplitude density [m/sqrt(Hz)]"
