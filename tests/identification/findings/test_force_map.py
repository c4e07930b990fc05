import numpy as np
import pytest
import xarray as xr

from robustpolish.identification.diagnosis.findings import ForceMap


def a_map(at=("x", "ground"), follows=0.834):
    q, v = np.linspace(-1e-3, 1e-3, 5), np.linspace(-0.1, 0.1, 4)
    force = xr.DataArray(np.outer(q * 2e3, np.ones(4)), dims=("displacement", "velocity"))
    surface = xr.Dataset({"force": force, "samples": xr.full_like(force, 0.05)})
    surface = surface.assign_coords(displacement=q, velocity=v)
    surface["force"].attrs["units"] = "N"
    surface["displacement"].attrs["units"] = "m"
    surface["velocity"].attrs["units"] = "m/s"
    return ForceMap(at, surface, 1.4142, follows)


def test_a_place_is_named_and_described():
    assert a_map().name == "x"
    assert a_map(("x", "y")).name == "x - y"
    assert a_map().describe() == (
        "x: 1.41 N (root mean square) are missing here, 83 % of their power follow from "
        "displacement and velocity."
    )


def test_the_picture_shows_the_force():
    ax = a_map().plot()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("displacement [mm]", "velocity [mm/s]")
    assert ax.get_title() == "missing force at x"
    shown = np.asarray(ax.collections[0].get_array(), dtype=float)
    assert shown.max() == pytest.approx(2.0)
    assert shown.shape == (4, 5)
