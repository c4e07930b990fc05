import math

import numpy as np
import pytest

import robustpolish as rp
from robustpolish import InvalidInputError

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


def test_a_rod_with_mass_takes_its_density_from_it():
    heavy = rp.polishing.AirBearingParameters(rod_mass=0.002)
    (rod,) = rp.polishing.spindle_rotor(heavy).shaft
    assert rod.density * rod.area * rod.length == pytest.approx(0.002)


@pytest.mark.parametrize(
    ("arguments", "key"),
    [
        ({"brush": "ring"}, "brush"),
        ({"bearing": "soft"}, "bearing"),
        ({"theory": "plate"}, "theory"),
        ({"density": -1.0}, "density"),
        ({"parameters": 3}, "parameters"),
        ({"elements": 0}, "elements"),
        ({"speed": math.nan}, "speed"),
        ({"modes": 0}, "modes"),
    ],
)
def test_bad_arguments_are_refused(arguments, key):
    with pytest.raises(InvalidInputError) as caught:
        rp.polishing.rotating_beam(**arguments)
    assert caught.value.key[0] == key
