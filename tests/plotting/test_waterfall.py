"""A waterfall falls from level to level."""

import numpy as np
import xarray as xr

from robustpolish import plots as plotting
from tests.plotting.legends import names


def test_the_waterfall_falls_from_level_to_level():
    levels = xr.DataArray(
        [0.5, 0.3, 0.02, 0.05], {"step": ["base", "refit", "a_b", "worse"]}, "step", "error of x"
    )
    ax = plotting.plot_waterfall(levels, 0.01)
    edges = [(bar.get_y(), bar.get_y() + bar.get_height()) for bar in ax.patches]
    np.testing.assert_allclose(edges, [(0, 0.5), (0.3, 0.5), (0.02, 0.3), (0.02, 0.05)])
    assert [text.get_text() for text in ax.get_xticklabels()] == ["base", "refit", "a b", "worse"]
    assert names(ax) == ["start", "taken away", "added", "noise floor, 0.01"]
    assert [t.get_text() for t in ax.texts] == ["0.5", "↓ to 0.3", "↓ to 0.02", "↑ to 0.05"]
    assert ax.get_ylabel() == "error of x"
    ax.figure.canvas.draw()
    assert ax.get_legend().get_window_extent().y0 >= ax.get_window_extent().y1 - 1  # off the bars
