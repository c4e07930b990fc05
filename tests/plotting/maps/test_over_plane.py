import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

from robustpolish.plots.charts import plot_over_plane

X, Y = np.linspace(0, 0.03, 7), np.linspace(0, 0.02, 5)
MAP = xr.DataArray(np.add.outer(X, Y), {"x": X, "y": Y}, ("x", "y"), "depth", {"units": "m"})


def test_a_map_has_its_axes_and_its_line():
    ax = plot_over_plane(MAP, level=0.02)
    assert (ax.get_xlabel(), ax.get_ylabel(), len(ax.collections)) == ("x [mm]", "y [mm]", 2)
    np.testing.assert_allclose(ax.collections[0].get_array().ravel(), MAP.values.T.ravel())
    plt.close("all")
