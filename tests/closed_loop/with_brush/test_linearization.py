"""Brush and machine linearised together, against runs of the nonlinear two and against statics."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from robustpolish.polishing import contact as disc
from robustpolish.polishing.brush import rim_points
from robustpolish.polishing.coupled import GuidedBrush, brush_at_rest, integrate_coupled
from robustpolish.polishing.coupled_loops import carrier
from tests.closed_loop.with_brush.test_carrier import springs


def run_from_rest(parameters, loop, tilt, seconds):
    """The nonlinear pair, standing on one spot, with the disc's axis moved a little."""
    rest = brush_at_rest(parameters, 0.016, 0.0)
    nodes = 4 * rim_points(parameters)  # as the derivatives are taken
    time = np.arange(round(seconds * 20e3) + 1) / 20e3
    start = np.zeros(disc.STATES)
    start[disc.AXES] = rest.axis + np.array(tilt) @ rest.across
    start[disc.AXES] /= np.linalg.norm(start[disc.AXES])
    start[disc.SPIN] = parameters.spin
    place = np.tile(rest.place, (time.size, 1))
    guided = GuidedBrush(parameters, False, time, place, 0 * place, start, rest.load[:3], nodes)
    run, states = integrate_coupled(guided, carrier(loop, parameters.polishing_force).machine, 8)
    assert run is not None
    axis = (run.track[:, disc.AXES] - rest.axis) @ rest.across.T
    return time, states - states[0], axis


@pytest.mark.parametrize("run", [1, 3])
def test_small_motions_follow_it(run):
    parameters, loop = rp.polishing.BrushParameters.for_run(run), springs(3e5, 0.05)
    # Small beside the tilt at which the contact's depth changes altogether.
    tilt = {1: 1e-4, 3: 1e-7}[run]
    time, states, axis = run_from_rest(parameters, loop, [0.0, tilt], 0.02)
    found = rp.polishing.linearize_with_brush(loop, parameters)
    start = np.zeros(10)
    start[7] = tilt
    linear = control.initial_response(found.system, time, start).states
    np.testing.assert_allclose(axis.T, linear[6:8], atol=0.02 * np.abs(linear[6:8]).max())
    displaced = linear[:6:2]
    np.testing.assert_allclose(states.T[::2], displaced, atol=0.02 * np.abs(displaced).max())


def test_a_stiff_brush_makes_the_bare_spindle_swing_up():
    """Friction and tilts feed a mode near 160 Hz, which replay cannot show; control stops it."""
    bare, stiff = rp.air_bearing(actuation="force"), rp.polishing.BrushParameters.for_run(3)
    assert (
        rp.polishing.linearize_with_brush(bare, rp.polishing.BrushParameters.for_run(1))
        .system.poles()
        .real.max()
        < 0
    )
    poles = rp.polishing.linearize_with_brush(bare, stiff).system.poles()
    growing = poles[poles.real > 0]
    assert growing.size == 2
    assert abs(growing[0].imag) / (2 * np.pi) == pytest.approx(160, rel=0.03)
    held = rp.given_controller(bare, np.kron(np.eye(6), [[-1e7, -2e3]]))
    assert rp.polishing.linearize_with_brush(held, stiff).system.poles().real.max() < 0


def test_statics_are_those_of_springs_in_parallel():
    """On the ground the contact's k_p adds to the spring under the machine."""
    plane = rp.polishing.BrushParameters(
        surface=rp.polishing.Surface.flat(), contact_stiffness=1e6, friction=0.0
    )
    found = rp.polishing.linearize_with_brush(springs(3e6), plane)
    gain = control.dcgain(found.system[2, 2])
    assert float(np.squeeze(gain)) == pytest.approx(1 / 4e6, rel=1e-4)
    assert found.system.output_labels[-3:] == ["contact_x", "contact_y", "contact_z"]
    assert found.residual < 1e-8


def test_controls_of_a_plant_stay_open():
    plant = rp.air_bearing(actuation="force")
    found = rp.polishing.linearize_with_brush(plant, rp.polishing.BrushParameters.for_run(2))
    assert found.system.ninputs == plant.nw + plant.nu
    assert found.system.noutputs == plant.nz + plant.ny + 7


def test_bad_arguments_are_named():
    with pytest.raises(InvalidInputError, match="parameters"):
        rp.polishing.linearize_with_brush(springs(1e6), {"radius": 1})
