"""The brush feels the machine: the rigid limit, statics, labels, complaints."""

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from tests.closed_loop.with_brush.test_carrier import springs


@pytest.fixture(scope="module")
def brush():
    return rp.simulate_brush(run=2, duration=0.1)


def test_on_a_rigid_machine_nothing_changes(brush):
    coupled = rp.polishing.simulate_coupled(springs(1e12, mass=1.0), brush)
    for name in ("F_x", "F_y", "F_z", "theta", "psi"):
        scale = float(abs(brush[name]).max())
        np.testing.assert_allclose(coupled[name], brush[name], atol=0.002 * scale)
    for name in ("tool_x", "tool_y", "tool_z"):
        np.testing.assert_allclose(coupled[name], brush[name], atol=1e-9)


def test_the_tool_is_where_path_and_machine_put_it(brush):
    coupled = rp.polishing.simulate_coupled(springs(1e5), brush)
    for axis in "xyz":
        moved = coupled[axis] - coupled[axis][0]
        np.testing.assert_allclose(coupled[f"tool_{axis}"] - brush[f"tool_{axis}"], moved,
                                   atol=1e-12)  # fmt: skip
    assert coupled.attrs["simulator"] == "coupled"
    assert coupled.attrs["converged"] == 1
    assert coupled["y"].attrs["units"] in ("", "m")
    # It begins at rest under the first load.
    assert float(coupled["y"][0]) == pytest.approx(-float(brush.F_y[0]) / 1e5)
    assert float(coupled["z"][0]) == pytest.approx(float(brush.F_z[0]) / 1e5)


def test_a_design_shows_its_effort(brush):
    gain = np.kron(np.eye(6), [[-1e7, -200.0]])
    design = rp.given_controller(rp.air_bearing(actuation="force"), gain)
    coupled = rp.polishing.simulate_coupled(design, brush.isel(time=slice(0, 401)))
    assert coupled["u_y"].attrs["units"] == "N"
    assert float(coupled["u_y"][0]) == pytest.approx(-1e7 * float(coupled["y"][0]), rel=1e-6)


def test_bad_arguments_are_named(brush):
    with pytest.raises(InvalidInputError, match="brush: got dict"):
        rp.polishing.simulate_coupled(springs(1e6), {})
    with pytest.raises(InvalidInputError, match="max_passes"):
        rp.polishing.simulate_coupled(springs(1e6), brush, max_passes=1)
    with pytest.raises(InvalidInputError, match="tolerance"):
        rp.polishing.simulate_coupled(springs(1e6), brush, tolerance=0.0)
    with pytest.raises(InvalidInputError, match="run of the physical brush"):
        rp.polishing.simulate_coupled(springs(1e6), rp.simulate_brush("listing", 1, 0.01))
