"""A run of the physical simulator as labelled signals."""

import numpy as np
import pytest

from robustpolish.polishing import contact as disc
from robustpolish.polishing.brush import Refinement, integrate, physical_dataset
from robustpolish.polishing.parameters import BrushParameters

BRUSH = BrushParameters.for_run(2)


@pytest.fixture(scope="module")
def run():
    return integrate(BRUSH, np.arange(41) / 20e3, 0, three_angles=True)


@pytest.mark.parametrize("three_angles", [False, True])
def test_forces_act_on_the_tool_and_contact_on_the_brush(run, three_angles):
    data = physical_dataset(run, Refinement(2, 1e-4, True), BRUSH, three_angles)
    np.testing.assert_array_equal(data["F_x"], -run.forces[:, 0])
    np.testing.assert_array_equal(data["F_y"], -run.forces[:, 1])
    np.testing.assert_array_equal(data["F_z"], run.forces[:, 2])
    assert set(data["F_p"].values) == {BRUSH.polishing_force}
    np.testing.assert_array_equal(data["contact"], data["contact_force"] > 0)
    np.testing.assert_array_equal(data["tool_z"], run.track[:, disc.HEIGHT])
    assert all("units" in data[name].attrs for name in data)


def test_the_attributes_tell_how_it_was_checked(run):
    data = physical_dataset(run, Refinement(3, 0.25, False), BRUSH, False)
    assert (data.attrs["passes"], data.attrs["impulse_error"], data.attrs["converged"]) == (
        3, 0.25, 0,
    )  # fmt: skip
    assert (data.attrs["steps"], data.attrs["rim_points"]) == (run.steps, run.rim_points)
    assert data.attrs["friction_heat"] == run.track[-1, disc.FRICTION_HEAT]
    assert data.attrs["contact_stiffness"] == 1e6
    assert data.attrs["disc"] == "two-angle"


def test_two_angles_know_level_and_three_the_spin(run):
    check = Refinement(2, 0.0, True)
    two, three = (physical_dataset(run, check, BRUSH, many) for many in (False, True))
    assert two["psi"].attrs["level"] == 0.0
    assert "level" not in three["psi"].attrs
    assert set(three.data_vars) - set(two.data_vars) == {"phi", "phi_rate", "omega_z"}
    spin = three["phi_rate"] + three["psi_rate"] * np.cos(three["theta"])
    np.testing.assert_allclose(spin, three["omega_z"], rtol=1e-12)
