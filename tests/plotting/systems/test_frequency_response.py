"""Gains over frequency show the data that they were given."""

import numpy as np
import xarray as xr

from robustpolish import plots as plotting
from tests.plotting.legends import names


def test_gains_with_the_norm_marked():
    frequency = np.geomspace(1, 1e3, 50)
    gain = xr.DataArray(
        1e-6 / frequency, {"frequency": frequency}, "frequency", attrs={"units": "m/N"}
    )
    ax = plotting.plot_gains({"loop": gain}, {"norm": (10.0, 1e-7), "level": (np.nan, 1e-8)})
    np.testing.assert_allclose(ax.lines[0].get_data(), [frequency, gain])
    np.testing.assert_allclose(np.ravel(ax.lines[1].get_data()), [10.0, 1e-7])
    assert names(ax) == ["loop", "norm", "level"]
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
    assert ax.yaxis.get_major_formatter()(1e-6) == "1 µm/N"


def test_units_that_differ_among_channels_are_all_told():
    gain = xr.DataArray([1e-6, 1e-7], {"frequency": [1.0, 2.0]}, "frequency")
    ax = plotting.plot_gains({"loop": gain.assign_attrs(units="m, rad per N")})
    assert ax.get_ylabel() == "largest singular value [m, rad per N]"


def test_curves_by_name_over_frequency():
    curves = xr.Dataset(
        {"S": ("frequency", [1.0, 2.0]), "T": ("frequency", [3.0, 4.0])},
        {"frequency": [10.0, 1e4]},
    )
    ax = plotting.plot_over_frequency(curves, "gain", unit="m/N")
    np.testing.assert_array_equal([line.get_ydata() for line in ax.lines], [[1, 2], [3, 4]])
    assert names(ax) == ["S", "T"]
    assert ax.get_ylabel() == "gain"
