"""The air bearing, its spindle and its hardware, against the numbers of the thesis."""

import math
from dataclasses import FrozenInstanceError, fields

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from robustpolish.polishing.parameters import RUN_STIFFNESS, BrushParameters
from robustpolish.polishing.surfaces.surface import Surface

# The air bearing against the numbers printed in the thesis, each under its stated reading.


def positive_modes(plant):
    eigenvalues = np.linalg.eigvals(plant.A)
    return eigenvalues[eigenvalues.imag > 0]


def test_modes_and_damping_of_section_8_5():
    """Reading: bearing of 1.337 kg, holder 1e9 N/m, inertia of the listing."""
    modes = positive_modes(rp.air_bearing(dissipation=0))
    expected = [194.0691, 194.0691, 2069.58, 2069.58, 2824.58, 4610.75]
    np.testing.assert_allclose(np.sort(modes.imag) / (2 * np.pi), expected, rtol=2e-6)
    np.testing.assert_allclose(modes.real, 0, atol=1e-7)
    assert rp.polishing.AirBearingParameters().damping(0).c_Z == 0
    # The fourth is printed as 5.7860e-13; the exponent is a misprint.
    modes = positive_modes(rp.air_bearing(dissipation=0.001))
    modes = modes[np.argsort(modes.imag)]
    zeta = -modes.real / np.abs(modes)
    expected = [7.93745e-5, 7.93745e-5, 8.17425e-5, 8.17425e-5, 5.78604e-5, 1.99226e-5]
    np.testing.assert_allclose(zeta, expected, rtol=3e-6)


def test_equations_of_motion():
    """Each row of (8.46), written out."""
    p = rp.polishing.AirBearingParameters()
    c = p.damping(0.001)
    plant = rp.air_bearing(p, actuation="force")
    rng = np.random.default_rng(0)
    q = rng.standard_normal(12)
    F_x, F_y, F_z, F_p = w = rng.standard_normal(4)
    u = rng.standard_normal(6)
    x_m, dx_m, x, dx, y_m, dy_m, y, dy, z_m, dz_m, z, dz = q
    expected = [
        dx_m,
        (-p.k_t * x_m + p.k_x * (x - x_m) - c.c_A * dx_m + c.c_D * (dx - dx_m) + u[0]) / p.m_x,
        dx,
        (-p.k_x * (x - x_m) - c.c_D * (dx - dx_m) - F_x + u[1]) / p.m_t,
        dy_m,
        (-p.k_t * y_m + p.k_x * (y - y_m) - c.c_A * dy_m + c.c_D * (dy - dy_m) + u[2]) / p.m_x,
        dy,
        (-p.k_x * (y - y_m) - c.c_D * (dy - dy_m) - F_y + u[3]) / p.m_t,
        dz_m,
        (-p.k_z * (z_m - z) - p.k_A * z_m - c.c_R * (dz_m - dz) - F_p + u[4]) / p.m_z,
        dz,
        (p.k_z * (z_m - z) + c.c_R * (dz_m - dz) - c.c_Z * dz + F_z + u[5]) / p.m_t,
    ]
    np.testing.assert_allclose(plant.A @ q + plant.B1 @ w + plant.B2 @ u, expected, rtol=1e-12)
    np.testing.assert_array_equal(plant.C1 @ q, q[::2])


def test_printed_load_swaps_x_and_y_and_options_are_checked():
    right, printed = rp.air_bearing().B1, rp.air_bearing(load="printed").B1
    np.testing.assert_array_equal(printed[:, [1, 0, 2, 3]], right)
    for option in ("actuation", "measured", "load"):
        with pytest.raises(InvalidInputError, match=f"{option}: got 'no'"):
            rp.air_bearing(**{option: "no"})
    with pytest.raises(InvalidInputError, match="parameters: got dict"):
        rp.air_bearing({"m": 1})
    with pytest.raises(InvalidInputError, match="dissipation: got -1"):
        rp.air_bearing(dissipation=-1)


# What the air bearing is made of, against the numbers printed in the thesis.


def test_damping_and_natural_frequencies_of_table_9_1():
    published = rp.polishing.AirBearingParameters.as_published()
    damping, frequency = published.damping(0.001), published.natural_frequencies()
    assert damping.c_A == pytest.approx(1.31593, abs=5e-6)
    assert damping.c_D == pytest.approx(0.0389224, abs=5e-8)
    assert damping.c_R == pytest.approx(0.558123, abs=5e-7)
    np.testing.assert_allclose(frequency["x"], [13003.5, 1219.37], rtol=5e-6)
    assert frequency["z"][0] == pytest.approx(28970.2, rel=2e-6)
    assert frequency["z_free"][0] == pytest.approx(20157, rel=1e-5)
    assert frequency["z_free"][1] == 0


def test_other_readings_give_other_modes():
    printed = rp.polishing.AirBearingParameters.as_printed()
    corrected = rp.polishing.AirBearingParameters.corrected()
    assert (printed.bearing_mass, printed.holder_stiffness) == (0.337, 1e10)
    assert corrected.m_x == pytest.approx(0.242, abs=5e-4)
    upper = [p.natural_frequencies()["x"][0] / (2 * np.pi) for p in (printed, corrected)]
    assert upper[0] == pytest.approx(5271.9, abs=0.05)
    assert upper[1] == pytest.approx(3361, abs=0.5)


# The air bearing as a mechanical model.


@pytest.mark.parametrize("actuation", ["force", "displacement"])
@pytest.mark.parametrize("measured", ["state", "displacement"])
@pytest.mark.parametrize("dissipation", [0.0, 0.001])
def test_the_air_bearing_is_the_same_plant(actuation, measured, dissipation):
    plant = rp.air_bearing(None, dissipation, actuation, measured)
    ours = rp.polishing.air_bearing_model(None, dissipation).linearize(
        actuation=actuation, measured=measured
    )
    for name in ("A", "B1", "B2", "C1", "C2", "D11", "D12", "D21", "D22"):
        np.testing.assert_allclose(getattr(ours, name), getattr(plant, name), rtol=1e-12)
    for names in ("states", "disturbance_names", "control_names", "performance_names"):
        assert getattr(ours, names) == getattr(plant, names)
    assert ours.measurement_names == plant.measurement_names
    assert dict(ours.units) == dict(plant.units)


def test_the_old_name_warns():
    with pytest.warns(DeprecationWarning, match="air_bearing_model"):
        old = rp.MechanicalModel.from_air_bearing(dissipation=0.0)
    assert old == rp.polishing.air_bearing_model(dissipation=0.0)


# The air bearing as wired, and the numbers of its hardware.


def test_forces_act_between_brush_and_bearing_and_axes_can_be_taken_apart():
    ideal = dict.fromkeys(("sensor_bandwidth_hz", "actuator_bandwidth_hz"), math.inf)
    plant = rp.polishing.polishing_plant(rp.polishing.PolishingHardware(**ideal, sensor_noise=0.0))
    whole = rp.air_bearing(actuation="force", measured="displacement")
    np.testing.assert_array_equal(plant.A, whole.A)
    np.testing.assert_array_equal(plant.B2[:, 0], whole.B2[:, 1] - whole.B2[:, 0])
    np.testing.assert_array_equal(plant.C2[1], whole.C2[3] - whole.C2[2])
    part = rp.polishing.polishing_plant(axes="y")
    assert part.nx == 6
    assert part.disturbance_names == ("F_y", "noise_gap_y")
    with pytest.raises(rp.InvalidInputError, match="axes"):
        rp.polishing.polishing_plant(axes="z")


# The spindle as a rotating beam.

LIKE_THE_THESIS = {"theory": "euler", "brush": "point", "bearing": "reduced", "density": 0.0}
W = 2j * np.pi * np.r_[0.1, np.geomspace(1.0, 1e4, 40)]


def test_with_the_assumptions_of_the_thesis_it_is_the_lumped_plant():
    """Modes, damping and every response; 1e-8 is what digits are left of 1e8 N/m beside 1e5."""
    lumped = rp.air_bearing(actuation="force", measured="displacement")
    beam = rp.polishing.rotating_beam(modes=None, **LIKE_THE_THESIS)
    for names in ("disturbance_names", "control_names", "performance_names", "measurement_names"):
        assert getattr(beam, names) == getattr(lumped, names)
    shared = (*beam.disturbance_names, *beam.control_names, *beam.measurement_names)
    assert {name: beam.units[name] for name in shared} == {n: lumped.units[n] for n in shared}
    assert beam.nx == lumped.nx == 12
    np.testing.assert_allclose(beam.system(W), lumped.system(W), rtol=1e-8, atol=1e-19)
    found = [mode.damping_ratio for mode in rp.modes(beam.open_loop)]
    expected = [mode.damping_ratio for mode in rp.modes(lumped.open_loop)]
    np.testing.assert_allclose(found, expected, rtol=1e-7)


def test_each_thing_that_the_lumped_model_leaves_out_softens_the_lowest_mode():
    steps = [{}, {"density": 7850.0}, {"theory": "timoshenko"}, {"brush": "disc"}]
    given, lowest = dict(LIKE_THE_THESIS), []
    for step in steps:
        given |= step
        lowest.append(rp.polishing.spindle_rotor(**given).modes(count=1)[0].frequency_hz)
    assert (np.diff(lowest) < 0).all()
    # Nearly all of it is the brush's middle, half a height behind the rod.
    p = rp.polishing.AirBearingParameters()
    arm = p.brush_height / 2 / p.rod_length
    static = 1 + 3 * arm + 3 * arm**2
    assert lowest[3] / lowest[2] == pytest.approx(1 / math.sqrt(static), rel=0.06)


def test_the_spin_parts_forward_from_backward_and_couples_x_with_y():
    rested, spun = (rp.polishing.rotating_beam(speed=speed) for speed in (0.0, 314.0))
    x, y = (spun.performance_names.index(name) for name in ("x", "y"))
    gains = [np.abs(plant.open_loop(2j * np.pi * 100.0)[[x, y], 0]) for plant in (rested, spun)]
    along, across = np.transpose(gains)
    assert across[0] < 1e-12 * along[0]
    assert across[1] > 0.05 * along[1]
    found = rp.polishing.spindle_rotor().modes(314.0, count=2)
    at_rest = rp.polishing.spindle_rotor().modes(count=1)[0].frequency_hz
    assert found[0].frequency_hz < at_rest < found[1].frequency_hz
    # The rod's damping turns with it: it damps forward whirl less than backward whirl.
    assert 0 < found[1].damping_ratio < found[0].damping_ratio


def test_reduction_keeps_the_forces_of_the_thesis_exact():
    beam, whole = rp.polishing.rotating_beam(), rp.polishing.rotating_beam(modes=None)
    assert beam.nx < whole.nx
    np.testing.assert_allclose(beam.open_loop(0.0), whole.open_loop(0.0), rtol=1e-9, atol=1e-18)
    for sign, force, seen in ((-1, "F_x", "x"), (-1, "F_y", "y"), (1, "F_z", "z")):
        gain = beam.open_loop(0.0)
        o, i = beam.performance_names.index(seen), beam.disturbance_names.index(force)
        assert sign * gain[o, i].real > 0
    heavy = rp.polishing.AirBearingParameters(rod_mass=0.002)
    (rod,) = rp.polishing.spindle_rotor(heavy).shaft
    assert rod.density * rod.area * rod.length == pytest.approx(0.002)


def test_bad_arguments_are_refused():
    for key, value in {
        "brush": "ring", "bearing": "soft", "theory": "plate", "density": -1.0, "parameters": 3,
        "elements": 0, "speed": math.nan, "modes": 0,
    }.items():  # fmt: skip
        with pytest.raises(InvalidInputError) as caught:
            rp.polishing.rotating_beam(**{key: value})
        assert caught.value.key[0] == key


# Parameters of the brush, against table 9.1.


def test_derived_values_and_runs_of_table_9_2() -> None:
    brush = BrushParameters()
    assert brush.rim_distance == pytest.approx(0.01118, abs=5e-6)
    assert brush.spin_inertia == pytest.approx(1.0e-5)
    assert brush.tilt_inertia == pytest.approx(6.67e-6, rel=1e-3)
    assert brush.impact_duration == pytest.approx(np.pi / 2 * np.sqrt(0.2 / 1e4))
    assert dict(RUN_STIFFNESS) == {1: 1e4, 2: 1e6, 3: 1e8, 4: 1e10}
    for run, stiffness in RUN_STIFFNESS.items():
        assert BrushParameters.for_run(run).contact_stiffness == stiffness
    assert BrushParameters.as_published(2).surface == Surface.as_published()
    with pytest.raises(InvalidInputError, match="run"):
        BrushParameters.for_run(5)


# Numbers, their units and sources.

TYPES = (
    rp.polishing.AirBearingParameters,
    rp.polishing.PolishingHardware,
    rp.polishing.BrushParameters,
)


@pytest.mark.parametrize("kind", TYPES)
def test_every_number_has_a_unit_and_a_source(kind):
    for item in fields(kind):
        assert item.metadata["source"], item.name
        assert item.metadata["unit"] or item.name in ("inertia_reading", "surface", "path")
    with pytest.raises(FrozenInstanceError):
        setattr(kind(), fields(kind)[0].name, 1.0)


NOT_PHYSICAL = {
    rp.polishing.AirBearingParameters: {
        "brush_mass": -0.2, "rod_length": 0, "young_modulus": np.nan, "rod_mass": -1,
        "inertia_reading": "guess", "bearing_mass": "heavy",
    },
    rp.polishing.PolishingHardware: {
        "sensor_noise": -1.0, "sample_rate_hz": np.inf, "computation_delay": 1.0,
        "actuator_limit": -1.0,
    },
    rp.polishing.BrushParameters: {
        "mass": -0.2, "radius": 0.0, "friction": np.nan, "spin": np.inf, "surface": 5.0,
        "path": 5.0,
    },
    rp.polishing.Surface: {"along": -0.1, "across": "steep"},
    rp.polishing.PolishingAxis: {"mass": 0.0, "damping": -1.0, "contact_stiffness": np.nan},
}  # fmt: skip


@pytest.mark.parametrize("kind", NOT_PHYSICAL)
def test_numbers_that_are_not_physical_are_named(kind):
    for name, value in NOT_PHYSICAL[kind].items():
        with pytest.raises(InvalidInputError, match=name):
            kind(**{name: value})


def test_an_inertia_that_leaves_no_mass_is_refused():
    with pytest.raises(InvalidInputError, match="bearing_mass"):
        rp.polishing.AirBearingParameters(rod_mass=10.0)
