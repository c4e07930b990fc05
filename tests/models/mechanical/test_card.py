"""How a model shows itself."""

from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import Damper, Dof, Output, Spring


def test_the_table_shows_units_of_effects():
    turning = MechanicalModel(
        [Dof("phi", 1.0, rotational=True)],
        [Spring(("phi", "ground"), 1.0)],
        [Damper(("phi", "ground"), 1.0)],
        outputs=[Output("angle", ("phi", "ground"))],
    )
    turning = turning.with_effect("cubic_stiffness", "phi", {"stiffness": 2.0})
    shown = str(turning.with_effect("sensor_offset", "angle", {"offset": 0.1}))
    for unit in ("kg m^2", "N m/rad\n", "N m s/rad", "N m/rad^3", "0.1  rad"):
        assert unit in shown


def test_a_channel_is_no_mass_and_no_motion():
    model = MechanicalModel([Dof("x", 1.0)], outputs=[Output("x", ("x", "ground"))])
    lines = [line.split() for line in str(model.with_channel("u", "V")).splitlines()]
    assert ["input", "u", "channel", "V"] in lines
    assert not any(line[:2] == ["mass", "u"] for line in lines)
