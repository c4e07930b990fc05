"""Norm over gain, a marker per controller."""

import numpy as np
import xarray as xr

from robustpolish import plots as plotting
from tests.plotting.legends import names


def test_gain_against_norm_names_every_controller():
    points = xr.Dataset(
        {
            "gain": ("controller", [1.0, 1e3, np.nan], {"long_name": "gain"}),
            "norm": ("controller", [2e-6, 1e-6, np.nan], {"long_name": "norm", "units": "m/N"}),
        },
        {"controller": ["a", "b", "failed"]},
    )
    ax = plotting.plot_gain_against_norm(points)
    assert names(ax) == ["a", "b"]
    np.testing.assert_allclose([np.ravel(line.get_data()) for line in ax.lines],
                               [(1.0, 2e-6), (1e3, 1e-6)])  # fmt: skip
    assert ax.get_xscale() == "log"
    assert ax.get_ylabel() == "norm [µm/N]"
