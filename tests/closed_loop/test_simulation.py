"""Loops under a load: statics by hand, effort, and complaints."""

import numpy as np
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish.errors import InvalidInputError


def test_statics_of_the_open_loop(load):
    """A constant load ends, on average, at force over stiffness."""
    p = rp.polishing.AirBearingParameters()
    response = rp.simulate(rp.air_bearing(p), load)
    swing = response["y"].sel(time=slice(0, 8 / 194.0691))
    assert float(swing.mean()) == pytest.approx(-10 * (1 / p.k_t + 1 / p.k_x), rel=0.02)
    assert float(np.abs(response["x"]).max()) == 0.0
    assert response["y"].attrs["units"] == "m"


def test_effort_is_the_gain_times_the_state(stiff, load):
    response = rp.simulate(stiff, load)
    assert response["u_y"].attrs["units"] == "N"
    speed = np.gradient(response["y"].to_numpy(), response["time"].to_numpy())
    expected = -1e7 * response["y"] - 200.0 * speed
    # The largest effort is quasi-static, so finite differences are good enough there.
    late = slice(0.1, None)
    np.testing.assert_allclose(
        response["u_y"].sel(time=late), expected.sel(time=late), rtol=2e-2, atol=0.1
    )


def test_a_system_is_simulated_as_it_is(stiff, load):
    direct = rp.simulate(stiff.closed_loop, load)
    through_design = rp.simulate(stiff, load)
    np.testing.assert_allclose(direct["y"], through_design["y"], rtol=1e-12, atol=1e-18)


def test_disturbances_that_are_not_given_are_zero(load):
    plant = rp.air_bearing()
    zero = load.assign(F_y=0 * load["F_y"])
    left_out = rp.simulate(plant, load.drop_vars("F_y"))
    xr.testing.assert_allclose(left_out, rp.simulate(plant, zero))


def test_bad_disturbances_are_named(load):
    plant = rp.air_bearing()
    with pytest.raises(InvalidInputError, match=r"'f_y'.*one named 'F_y'"):
        rp.simulate(plant, load.rename(F_y="f_y"))
    with pytest.raises(InvalidInputError, match="got variables none, expected one of 'F_x', 'F_y'"):
        rp.simulate(plant, xr.Dataset(coords={"time": load["time"]}))
    with pytest.raises(InvalidInputError, match="unit kN"):
        rp.simulate(plant, load.assign(F_y=load["F_y"].assign_attrs(units="kN")))
    with pytest.raises(InvalidInputError, match="no coordinate 'time'"):
        rp.simulate(plant, load.drop_vars("time"))
    with pytest.raises(InvalidInputError, match="uniform"):
        rp.simulate(plant, load.isel(time=[0, 1, 5]))
    with pytest.raises(InvalidInputError, match="disturbance: got dict"):
        rp.simulate(plant, {"F_x": 1})
    with pytest.raises(InvalidInputError, match="design: got float"):
        rp.simulate(3.0, load)
    with pytest.raises(InvalidInputError, match="finite"):
        rp.simulate(plant, load.assign(F_y=load["F_y"] * np.nan))
