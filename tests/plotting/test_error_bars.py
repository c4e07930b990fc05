"""Values with bars over a positive quantity."""

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

from robustpolish.plots.charts import plot_error_bars


def test_values_and_bars_stand_where_they_belong():
    level = np.array([0.1, 1.0, 10.0])
    curve = xr.DataArray(
        [1.0, 2.0, 4.0], {"level": level, "bar": ("level", [0.1, 0.2, 0.3])}, "level"
    )
    ax = plot_error_bars({"first": curve, "second": 2 * curve}, "change", "%", over="level")
    assert (ax.get_xscale(), ax.get_xlabel(), ax.get_ylabel()) == ("log", "level", "change [%]")
    line, _, bars = ax.containers[0].lines
    np.testing.assert_allclose(line.get_ydata(), [1, 2, 4])
    np.testing.assert_allclose(bars[0].get_segments()[2][:, 1], [3.7, 4.3])
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["first", "second"]
    plt.close(ax.figure)
