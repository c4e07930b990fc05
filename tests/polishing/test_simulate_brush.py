"""Runs of the brush simulators: interface, mechanics, accuracy, dissipation, work."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson, cumulative_trapezoid

from robustpolish.errors import InvalidInputError, RobustPolishWarning, SolverError
from robustpolish.polishing import contact
from robustpolish.polishing.brush import integrate, tool_velocity
from robustpolish.polishing.parameters import BrushParameters
from robustpolish.polishing.simulate import simulate_brush
from robustpolish.polishing.surfaces.surface import Surface
from robustpolish.polishing.thesis.listing import ListingDefects

# The one interface: contents, options, complaints.

SHARED = {
    "theta", "psi", "theta_rate", "psi_rate", "F_x", "F_y", "F_z", "F_p", "contact",
    "tool_x", "tool_y", "surface_height", "elevation",
}  # fmt: skip


@pytest.mark.parametrize("simulator", ["physical", "listing"])
def test_both_simulators_share_names_and_units(simulator: str) -> None:
    signals = simulate_brush(simulator, run=2, duration=0.005)
    assert set(signals.data_vars) >= SHARED
    assert signals.time.attrs["units"] == "s"
    assert all("units" in signals[name].attrs for name in signals.data_vars)
    assert {signals[name].attrs["units"] for name in ("F_x", "F_y", "F_z", "F_p")} == {"N"}
    assert signals.attrs["simulator"] == simulator
    assert signals.attrs["contact_stiffness"] == 1e6


def test_defaults_and_what_replaces_them() -> None:
    assert simulate_brush(duration=0.001).attrs["surface_across"] == Surface().across
    assert simulate_brush("listing", duration=0.001).attrs["surface_across"] == 5.0
    assert simulate_brush(duration=0.001).attrs["contact_stiffness"] == 1e4
    given = BrushParameters(contact_stiffness=3e5, friction=0.1)
    assert simulate_brush(duration=0.001, parameters=given).attrs["contact_stiffness"] == 3e5
    replaced = simulate_brush(duration=0.001, parameters=given, run=3)
    assert replaced.attrs["contact_stiffness"] == 1e8
    assert replaced.attrs["friction"] == 0.1


PHYSICAL = {
    "simulator": "magic", "run": 7, "duration": -1.0, "sample_rate": 0.0, "disc": "flat",
    "tolerance": float("nan"), "start": "falling", "max_passes": 1, "workaround": "divide",
    "parameters": {"friction": 0.1}, "defects": ListingDefects(),
}  # fmt: skip
LISTING = {
    "disc": "two-angle", "start": "landing", "max_passes": 3, "workaround": "hope", "defects": True,
}  # fmt: skip


@pytest.mark.parametrize(("simulator", "given"), [("physical", PHYSICAL), ("listing", LISTING)])
def test_bad_arguments_and_options_of_the_other_simulator_are_named(simulator, given) -> None:
    for name, value in given.items():
        arguments = {"simulator": simulator, "duration": 0.001, name: value}
        with pytest.raises(InvalidInputError, match=name):
            simulate_brush(**arguments)
    with pytest.raises(InvalidInputError, match="duration"):
        simulate_brush(simulator, duration=1e-9)


def test_the_listing_needs_a_moving_tool_and_any_number_of_samples_comes_back():
    resting = BrushParameters(feed=0.0, rotation_rate=0.0)
    with pytest.raises(InvalidInputError, match="at rest"):
        simulate_brush("listing", duration=0.001, parameters=resting)
    held = simulate_brush(duration=0.05, parameters=resting)
    assert float(abs(held.elevation).max()) == 0.0
    assert bool((held.tool_x == held.tool_x[0]).all())
    for samples in (1, 3, 7, 49, 1003):
        for simulator, rate in (("physical", 20e3), ("listing", 1e5)):
            assert simulate_brush(simulator, duration=samples / rate).sizes["time"] == samples + 1


# The physical simulator: mechanics, accuracy, dissipation, work.

FORCES = ("F_x", "F_y", "F_z")


@pytest.fixture(scope="module")
def default_run():
    return simulate_brush(duration=1.0)


def test_no_moment_no_motion() -> None:
    """Section 9.3: on a plane without friction nothing turns the disc, which stays level."""
    plane = BrushParameters(surface=Surface.flat(), friction=0.0)
    for run in (1, 3):
        signals = simulate_brush(run=run, duration=0.2, parameters=plane)
        assert float(abs(signals.theta).max()) < 1e-12
        assert float(abs(signals.psi).max()) < 1e-12
        np.testing.assert_allclose(signals.F_z, 10.0, rtol=1e-6)
        assert float(abs(signals.F_x).max()) < 1e-9


def test_forces_balance_and_angles_and_rates_belong_together(default_run):
    change = float(default_run.tool_z_rate[-1] - default_run.tool_z_rate[0])
    pressed = float(default_run.F_z.integrate("time") - default_run.F_p.integrate("time"))
    assert pressed == pytest.approx(0.2 * change, abs=1e-6)
    assert float(default_run.F_z.mean()) == pytest.approx(10.0, rel=1e-3)
    settled = slice(400, -1)  # central differences are too coarse for the start
    for name in ("theta", "psi", "tool_z"):
        slope = default_run[name].differentiate("time").isel(time=settled)
        rate = default_run[f"{name}_rate"].isel(time=settled)
        assert float(abs(slope - rate).max()) < 1e-3 * float(abs(rate).max())


def test_magnitudes_of_dissipative_contact() -> None:
    """With damping 50 s/m about 10 N at every stiffness, and not the thesis's thousands."""
    for run in (1, 2, 3, 4):
        signals = simulate_brush(run=run, duration=0.5).sel(time=slice(0.1, None))
        assert 9.5 < float(signals.F_z.min()) <= float(signals.F_z.max()) < 11.0
        assert 1.0 < float(abs(signals.F_y).max()) < 12.0
        assert float(abs(signals.F_x).max()) < 5.0


def test_contact_never_pulls_and_always_dissipates(default_run) -> None:
    landing = simulate_brush(run=2, duration=0.2, start="landing")
    for signals in (default_run, landing):
        assert bool((signals.contact_force >= 0.0).all())
        assert bool((signals.friction_power >= 0.0).all())
        assert bool((signals.damping_power >= 0.0).all())
    assert float(landing.contact_share[0]) < float(landing.contact_share.max())


@pytest.mark.parametrize("three_angles", [False, True])
@pytest.mark.parametrize(
    ("stiffness", "damping", "friction", "spin"),
    [(1e4, 0.0, 0.0, 314.0), (1e4, 50.0, 0.0, 314.0), (1e6, 0.0, 0.35, 314.0),
     (1e6, 50.0, 0.35, 0.0), (1e6, 50.0, 0.35, 314.0), (1e8, 5.0, 0.1, 50.0)],
)  # fmt: skip
def test_energy_balance(stiffness, damping, friction, spin, three_angles):
    """Carriage and drive do the work that is stored or lost, to 1e-5 of what is exchanged."""
    brush = BrushParameters(
        contact_stiffness=stiffness, contact_damping=damping, friction=friction, spin=spin
    )
    time = np.arange(1601) / 40e3
    run = integrate(brush, time, 2, three_angles=three_angles, landing=True)
    track, loads, force = run.track.T, run.loads.T, brush.polishing_force
    kinetic = brush.mass * track[contact.CLIMB] ** 2
    kinetic += brush.tilt_inertia * np.sum(track[contact.TURNINGS] ** 2, axis=0)
    kinetic += brush.spin_inertia * track[contact.SPIN] ** 2
    stored = 0.5 * kinetic + loads[contact.ENERGY] + force * track[contact.HEIGHT]
    heat = track[contact.FRICTION_HEAT] + track[contact.DAMPING_HEAT]
    led = tool_velocity(0.5 * (time[1:] + time[:-1]), brush)
    carriage = -np.sum(led * np.diff(track[contact.IMPULSES][:2]), axis=0)
    carriage = np.r_[0.0, carriage.cumsum()]
    about = np.sum(loads[contact.MOMENT : contact.MOMENT + 3] * track[contact.AXES], axis=0)
    held = loads[contact.ABOUT] - about  # an ideal drive
    slowed = brush.spindle_damping * (spin - track[contact.SPIN])
    power = track[contact.SPIN] * (slowed if three_angles else held)
    drive = cumulative_simpson(power, x=time, initial=0.0)
    gap = stored - stored[0] + heat - drive - carriage
    exchanged = heat[-1] + np.ptp(stored) + np.ptp(drive) + np.ptp(carriage)
    assert np.max(np.abs(gap)) < 1e-5 * exchanged


@pytest.mark.parametrize("run", [1, 4])
def test_passes_converge_and_report_their_accuracy(run: int) -> None:
    """Impulses and peaks settle as steps are halved and rim points doubled."""
    signals = simulate_brush(run=run, duration=0.2)
    samples = signals.time.values
    passes = [integrate(BrushParameters.for_run(run), samples, level) for level in range(4)]
    impulse = [cumulative_trapezoid(p.forces, samples, axis=0) for p in passes]
    gaps = [float(np.max(np.abs(a - impulse[-1]))) for a in impulse[:-1]]
    assert gaps[0] < 2e-3 * 10.0 * samples[-1]
    assert gaps[2] < 0.5 * gaps[0]
    peaks = [np.max(np.abs(p.forces), axis=0) for p in passes]
    np.testing.assert_allclose(peaks[2], peaks[3], rtol=0.02)
    # The impulse error in the attributes is that against a far finer integration, or more.
    got = np.stack([-signals.F_x, -signals.F_y, signals.F_z], axis=1)
    total = cumulative_trapezoid(got - passes[-1].forces, samples, axis=0)
    window = np.abs(total[200:] - total[:-200]).max() / (10.0 * 0.01)
    assert signals.attrs["converged"] == 1
    assert window <= max(signals.attrs["impulse_error"], 1e-4)


def test_sampled_forces_keep_the_impulse_at_any_rate() -> None:
    """A sharp landing sampled coarsely has the same impulse as sampled finely."""
    coarse, fine = (
        simulate_brush(run=3, duration=0.05, start="landing", sample_rate=rate, tolerance=1e-3)
        for rate in (2e3, 40e3)
    )
    for name in FORCES:
        difference = float(coarse[name].integrate("time") - fine[name].integrate("time"))
        assert abs(difference) < 1e-3 * 10.0 * 0.05
    assert float(fine.F_z.max()) > 1.05 * float(coarse.F_z.max())


def test_three_angle_disc_loses_spin_to_friction() -> None:
    two = simulate_brush(run=2, duration=0.3)
    three = simulate_brush(run=2, duration=0.3, disc="three-angle")
    assert {"phi", "phi_rate", "omega_z"} <= set(three.data_vars)
    assert float(three.omega_z[0]) == pytest.approx(100 * np.pi)
    held = 100 * np.pi - three.omega_z[-1]
    friction_moment = 0.3536 * 10.0 * 0.010
    assert 0.9 * friction_moment < 0.01 * float(held) < 2.0 * friction_moment
    rate = three.phi.differentiate("time").isel(time=slice(2000, -1))
    np.testing.assert_allclose(rate, three.phi_rate.isel(time=slice(2000, -1)), rtol=1e-3)
    np.testing.assert_allclose(three.F_y[2000:], two.F_y[2000:], atol=0.1)


def test_little_damping_rattles_and_a_disc_that_tips_over_is_an_error():
    """Contact damping decides: at 1 s/m and 1e10 N/m the passes cannot agree."""
    loose = BrushParameters(contact_damping=1.0)
    with pytest.warns(RobustPolishWarning, match="contact_damping"):
        signals = simulate_brush(run=4, duration=0.6, parameters=loose, max_passes=2)
    assert signals.attrs["converged"] == 0
    assert float(signals.F_z.max()) > 100.0
    assert bool((signals.contact_force >= 0.0).all())
    sticky = BrushParameters(friction=3.0, spin=0.0, surface=Surface(0.1, 0.0), height=0.04)
    with pytest.raises(SolverError, match="tipped over"):
        simulate_brush(run=2, parameters=replace(sticky, feed=0.3, rotation_rate=0.0))


@pytest.mark.parametrize(("run", "rim_points"), [(1, 192), (4, 4096)])
def test_five_seconds_take_two_passes_of_two_steps_per_sample(run: int, rim_points: int) -> None:
    """The work, which is the same on every machine; it was 5 s of an idle core at most."""
    signals = simulate_brush(run=run)
    assert signals.sizes["time"] == 100001
    assert signals.attrs["converged"] == 1
    assert (signals.attrs["passes"], signals.attrs["rim_points"]) == (2, rim_points)
    assert signals.attrs["steps"] + signals.attrs["refused_steps"] < 2.01 * 100_000
