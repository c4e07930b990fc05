import numpy as np
import pytest
import xarray as xr

from robustpolish.identification.compare import compare
from robustpolish.identification.residuals.analysis import residual_analysis
from robustpolish.identification.residuals.tests import place_shares
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import Dof, Input, Output, Spring
from tests.identification.oscillators import PLACE, oscillator
from tests.identification.oscillators import record as short_record
from tests.identification.residuals.two_masses import (
    RANDOM,
    SAMPLES,
    TIME,
    analyse,
    model,
    record,
)


@pytest.mark.parametrize("place", [("a", "ground"), ("a", "b")])
def test_the_restoring_force_surface_shows_a_cubic_spring_at_its_place(place):
    truth = model().with_effect("cubic_stiffness", place, {"stiffness": 1e11})
    result = analyse(record(truth))
    shown = result.places["a" if place[1] == "ground" else "a - b"]
    assert shown.observed
    assert shown.at == place
    force = shown.surface["force"].weighted(shown.surface["samples"]).mean("velocity")
    q = shown.surface["displacement"].values
    good = shown.surface["samples"].sum("velocity").values > 0.01
    assert np.corrcoef(force.values[good], -(q[good] ** 3))[0, 1] > 0.95
    size = np.polyfit(q[good] ** 3, force.values[good], 1)[0]
    assert size == pytest.approx(-1e11, rel=0.5)


def test_the_place_whose_motion_foretells_the_force_is_drawn():
    truth = model().with_effect("cubic_stiffness", ("a", "b"), {"stiffness": 1e11})
    result = analyse(record(truth))
    assert result.places["a - b"].follows > 0.3
    assert result.plot_surface().get_title() == "missing force at a - b"
    assert result.plot_surface(place="a").get_title() == "missing force at a"


def test_errors_at_large_motion_are_seen_in_the_bins():
    truth = model().with_effect("cubic_stiffness", ("a", "ground"), {"stiffness": 1e11})
    share = analyse(record(truth)).places["a"].displacement
    outside = share.sel(output="a").values[[0, 1, -2, -1]].sum()
    assert outside > 2 * share["samples"].values[[0, 1, -2, -1]].sum()


def test_a_rig_without_states():
    rig = MechanicalModel(
        [Dof("x", 0.0)],
        [Spring(("x", "ground"), 50.0)],
        inputs=[Input("x", ("x", "ground"), "displacement")],
        outputs=[Output("f", ("x", "ground"), "force")],
    )
    x = np.sin(20 * TIME)
    f = 50 * x + 20 * np.sign(np.cos(20 * TIME)) + 0.1 * RANDOM.standard_normal(SAMPLES)
    data = xr.Dataset({"x": ("time", x), "f": ("time", f)}, {"time": TIME})
    surface = residual_analysis(compare(rig, data)).places["x"].surface["force"]
    right = surface.sel(displacement=0, method="nearest")
    assert float(right.isel(velocity=-1)) == pytest.approx(-20, rel=0.1)
    assert float(right.isel(velocity=0)) == pytest.approx(20, rel=0.1)


def test_a_place_is_a_coordinate_or_what_something_joins():
    result = analyse(record())
    assert list(result.places) == ["a", "b", "a - b"]
    between = result.places["a - b"]
    assert between.at == ("a", "b")
    for place in result.places.values():
        assert place.displacement.sizes["displacement"] == 12
        assert place.surface["force"].attrs["units"] == "N"
        assert place.surface["velocity"].attrs["units"] == "m/s"


def test_turning_coordinates_have_moments():
    arm = oscillator(dofs=[Dof("x", 1.0, rotational=True)])
    data = short_record(noise=0.01)
    data = data.assign(F=data["F"].assign_attrs(units="N m"), x=data["x"].assign_attrs(units="rad"))
    comparison = compare(arm, data)
    surface = place_shares(comparison, comparison.residual, 5)["x"].surface
    assert surface["force"].attrs["units"] == "N m"
    assert surface["displacement"].attrs["units"] == "rad"
    assert surface["force"].shape == (5, 5)


def test_a_short_record_shows_the_simulated_motion_and_no_force():
    data = short_record().isel(time=slice(0, 59))
    comparison = compare(oscillator(), data)
    place = place_shares(comparison, comparison.residual, 4)["x"]
    assert place.at == PLACE
    assert not place.observed
    assert np.isnan(place.surface["force"]).all()
    x = data["x"].values
    edges = np.linspace(x.min(), x.max(), 5)
    found = place.displacement["displacement"].values
    np.testing.assert_allclose(found, (edges[:-1] + edges[1:]) / 2, rtol=1e-3)


def test_a_channel_is_no_place():
    data = record(model().with_effect("cubic_stiffness", ("a", "ground"), {"stiffness": 1e11}))
    data = data.assign(u=("time", np.cos(TIME), {"units": "V"}))
    found = residual_analysis(compare(model().with_channel("u", "V"), data))
    assert "u" not in found.places
    assert "a" in found.places
