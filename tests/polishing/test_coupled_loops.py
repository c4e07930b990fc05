"""Loops that the brush feels: signals, coupled runs, comparison with replay, linearisation."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from robustpolish.polishing import contact as disc
from robustpolish.polishing.brush import rim_points
from robustpolish.polishing.coupled import GuidedBrush, brush_at_rest, integrate_coupled
from robustpolish.polishing.coupled_loops import carrier
from tests.identification import air_bearings

# A loop as the brush sees it: signals by name, signs, complaints.


def springs(stiffness, ratio=1.0, mass=0.2):
    """A mass on three springs with dampers, signs as (8.45)."""
    damping = 2 * ratio * np.sqrt(stiffness * mass)
    A = np.kron(np.eye(3), [[0.0, 1.0], [-stiffness / mass, -damping / mass]])
    B = np.kron(np.diag([-1.0, -1.0, 1.0]) / mass, [[0.0], [1.0]])
    C = np.kron(np.eye(3), [[1.0, 0.0]])
    return control.ss(A, B, C, 0, inputs=["F_x", "F_y", "F_z"], outputs=["x", "y", "z"])


def test_the_air_bearing_yields_as_its_springs_say():
    p = rp.polishing.AirBearingParameters()
    carried = carrier(rp.air_bearing(p), 10.0)
    sideways = 1 / (1 / p.k_t + 1 / p.k_x)
    along = 1 / (1 / p.k_A + 1 / p.k_z)
    np.testing.assert_allclose(carried.machine.stiffness, [sideways, sideways, along], rtol=1e-6)
    rest = carried.machine.C @ carried.machine.rest(np.array([1.0, 2.0, 10.0]))
    # Contact pushes along its force; F_p on the bearing and F_z on the brush stretch the spindle.
    np.testing.assert_allclose(rest, [1 / sideways, 2 / sideways, 10 / p.k_z], rtol=1e-6)
    given = carried.inputs(np.array([[1.0, 2.0, 3.0]]), 10.0)
    assert given.tolist() == [[-1.0, -2.0, 3.0, 10.0]]


def test_loops_that_do_not_fit_are_refused():
    good = springs(1e6)
    gain = np.kron(np.eye(6), [[-1e6, -200.0]])
    design = rp.given_controller(rp.air_bearing(actuation="force"), gain)
    names = {"inputs": ["F_x", "F_y", "F_z"], "outputs": ["x", "y", "z"]}
    for message, loop in {
        "F_z is missing": control.ss(good, inputs=["F_x", "F_y", "push"]),
        "z is missing": control.ss(good, outputs=["x", "y", "q"]),
        "discrete time": control.c2d(good, 1e-4),
        "a sampled design": design.discretize(1e-5),
        "with a mass": control.ss(good.A, good.B, good.C, np.eye(3), **names),
    }.items():
        with pytest.raises(InvalidInputError, match=message):
            carrier(loop, 10.0)


# The brush feels the machine: the rigid limit, statics, labels, complaints.


@pytest.fixture(scope="module")
def brush():
    return rp.polishing.simulate_brush(run=2, duration=0.1)


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
    gain = np.kron(np.eye(6), [[-1e7, -200.0]])
    design = rp.given_controller(rp.air_bearing(actuation="force"), gain)
    coupled = rp.polishing.simulate_coupled(design, brush.isel(time=slice(0, 401)))
    assert coupled["u_y"].attrs["units"] == "N"
    assert float(coupled["u_y"][0]) == pytest.approx(-1e7 * float(coupled["y"][0]), rel=1e-6)


def test_bad_arguments_are_named(brush):
    for message, (run, options) in {
        "brush: got dict": ({}, {}),
        "max_passes": (brush, {"max_passes": 1}),
        "tolerance": (brush, {"tolerance": 0.0}),
        "run of the physical brush": (rp.polishing.simulate_brush("listing", 1, 0.01), {}),
    }.items():
        with pytest.raises(InvalidInputError, match=message):
            rp.polishing.simulate_coupled(springs(1e6), run, **options)
    with pytest.raises(InvalidInputError, match="parameters"):
        rp.polishing.linearize_with_brush(springs(1e6), {"radius": 1})
    loose = springs(1e6)
    loose.A[1, 0] = 0.0
    with pytest.raises(InvalidInputError, match="pole at zero"):
        rp.polishing.simulate_coupled(loose, brush)


# Replayed against coupled: equal where the machine is stiff, apart where it is not.


@pytest.fixture(scope="module")
def gentle_brush():
    """Soft contact with little damping: then stiffness is what matters."""
    gentle = rp.polishing.BrushParameters(contact_damping=1.0)
    return rp.polishing.simulate_brush(duration=0.1, parameters=gentle, tolerance=5e-3)


@pytest.mark.long
def test_a_machine_a_hundred_times_stiffer_may_replay(gentle_brush):
    """At rest and wherever both are moved: then displacements agree to 1 %."""
    comparison = rp.polishing.compare_coupled(springs(1.2e7), gentle_brush)
    assert comparison.stiffness_ratio > 100
    assert 1 / comparison.loop_gain > 100
    assert comparison.replay_is_good_enough(0.01)


def test_they_part_as_the_machine_softens(gentle_brush):
    found = [rp.polishing.compare_coupled(springs(k), gentle_brush) for k in (1e4, 1e5, 1e6, 1e7)]
    shares = [one.largest_share for one in found]
    assert all(np.diff(shares) < 0)
    assert shares[0] > 0.05
    assert not found[0].replay_is_good_enough()
    # The gain of the loop through machine and contact bounds what replay leaves out.
    assert all(one.largest_share < 1.5 * one.loop_gain for one in found)


def test_contact_damps_what_replay_lets_ring():
    """The thesis's machine hardly damps 194 Hz; the spinning rim's friction and contact do."""
    comparison = rp.polishing.compare_coupled(
        rp.air_bearing(), rp.polishing.simulate_brush(run=1, duration=0.3)
    )
    late = [
        run["y"].sel(time=slice(0.2, None)) for run in (comparison.replayed, comparison.coupled)
    ]
    swing = [float((run - run.rolling(time=200, center=True).mean()).std()) for run in late]
    assert swing[1] < 0.2 * swing[0]
    assert comparison.stiffness_ratio > 10
    assert comparison.largest_share > 0.3


def test_it_shows_itself(gentle_brush):
    comparison = rp.polishing.compare_coupled(springs(1e5), gentle_brush.isel(time=slice(0, 401)))
    assert "Replayed against coupled" in repr(comparison)
    assert "times stiffer" in repr(comparison)
    assert comparison.plot(signal="x").get_xlabel() == "time [ms]"
    with pytest.raises(InvalidInputError, match="signal"):
        comparison.plot(signal="u")


# Brush and machine linearised together, against runs of the nonlinear two and against statics.


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


def test_statics_are_those_of_springs_in_parallel_and_controls_stay_open():
    """On the ground the contact's k_p adds to the spring under the machine."""
    plane = rp.polishing.BrushParameters(
        surface=rp.polishing.Surface.flat(), contact_stiffness=1e6, friction=0.0
    )
    found = rp.polishing.linearize_with_brush(springs(3e6), plane)
    gain = control.dcgain(found.system[2, 2])
    assert float(np.squeeze(gain)) == pytest.approx(1 / 4e6, rel=1e-4)
    assert found.system.output_labels[-3:] == ["contact_x", "contact_y", "contact_z"]
    assert found.residual < 1e-8
    plant = rp.air_bearing(actuation="force")
    found = rp.polishing.linearize_with_brush(plant, rp.polishing.BrushParameters.for_run(2))
    assert found.system.ninputs == plant.nw + plant.nu
    assert found.system.noutputs == plant.nz + plant.ny + 7


def test_a_record_of_a_machine_with_friction_against_an_integrator_of_its_own():
    load = air_bearings.brush(duration=0.1)
    rubbed = air_bearings.MODEL.with_effect("coulomb_friction", ("y", "ground"), {"force": 0.5})
    found = rp.polishing.brush_record(load, rubbed, noise=0.0)
    truth = air_bearings.measured(
        "coulomb_friction", ("y", "ground"), (0.5,), noise=0.0, duration=0.1
    )
    for name in "xyz":
        error = np.std(found[name] - truth[name]) / np.std(truth[name])
        assert error < 1e-3
        assert found[name].attrs["units"] == "m"
    noisy = rp.polishing.brush_record(load, rubbed, sensors=["y"], noise=1e-8, seed=2)
    assert [*noisy.data_vars] == ["F_x", "F_y", "F_z", "F_p", "y"]
    assert float(np.std(noisy["y"] - found["y"])) == pytest.approx(1e-8, rel=0.1)
    with pytest.raises(rp.InvalidInputError, match="sensors"):
        rp.polishing.brush_record(load, rubbed, sensors=["w"])
