import numpy as np
import pytest

import robustpolish as rp
from robustpolish import InvalidInputError
from robustpolish.machines.rotor.rotor import DAMPED, FAST, ISOTROPIC, RotorModel

ENDS = {"left": 0.0, "right": 1.5}


def test_signals_have_names_and_units():
    plant = ISOTROPIC.plant(loads={"disc": 0.5}, actuators=ENDS, performance={"mid": 0.75})
    assert plant.disturbance_names == ("F_disc_x", "F_disc_y")
    assert plant.performance_names == ("mid_x", "mid_y")
    assert plant.measurement_names[:2] == ("measured_left_x", "measured_left_y")
    assert (plant.units["u_right_y"], plant.units["mid_x"]) == ("N", "m")
    assert not plant.D11.any()
    assert plant.nx == 104


def test_gains_and_poles_are_those_of_the_rotor():
    plant = DAMPED.plant(FAST, loads={"p": 0.3}, actuators={"p": 0.3})
    at_rest = DAMPED.plant(loads={"p": 0.3}, actuators={"p": 0.3})
    gain = at_rest.open_loop(0.0)[:2, :2].real
    np.testing.assert_allclose(np.linalg.inv(gain), DAMPED.static_stiffness(0.3), atol=1e-3)
    poles = np.linalg.eigvals(plant.A)
    for mode in DAMPED.modes(FAST, count=6):
        assert np.abs(poles - mode.eigenvalue).min() < 1e-8 * abs(mode.eigenvalue)


def test_a_controller_for_the_reduced_rotor_is_certified_and_holds_on_the_whole():
    places = {"loads": {"disc": 0.5}, "actuators": ENDS}
    rotor = RotorModel(DAMPED.shaft, DAMPED.discs, DAMPED.bearings, internal_damping=1e-5)
    plant = rotor.reduced(2, [0.0, 0.5, 1.5], speed=FAST).plant(**places)
    design = rp.output_feedback(plant, control_weight=1e-7, measurement_noise=1e-7)
    assert design.certificate.valid
    few = rp.hinf_norm(plant.closed_loop(design.controller)).value
    whole = rp.hinf_norm(rotor.plant(FAST, **places).closed_loop(design.controller)).value
    assert few < 0.03 * rp.hinf_norm(plant.open_loop).value
    assert whole == pytest.approx(few, rel=0.01)


def test_places_are_checked():
    for given, said in (({}, "at least one place"), ({"a": "b"}, "a place in m"), ([0.5], "name")):
        with pytest.raises(InvalidInputError, match=said):
            ISOTROPIC.plant(loads=given, actuators=ENDS)
    with pytest.raises(InvalidInputError, match="finite place"):
        ISOTROPIC.plant(loads={"a": np.inf}, actuators=ENDS)
