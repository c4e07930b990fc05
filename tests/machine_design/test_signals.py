"""Signals by the names that users have for them: the right rows and columns of the machine."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.app.design_task import machine_plant
from tests.machine_design.machines import SPINDLE

MODEL = rp.MechanicalModel.from_toml(SPINDLE)


def test_every_name_finds_its_column_and_row():
    plant = machine_plant(MODEL, ["F"], ["x", "dspindle"], ["spindle", "acc"], ["F_cut", "slide"])
    assert plant.control_names == ("F",)
    assert plant.measurement_names == ("measured_x", "measured_dspindle")
    assert plant.performance_names == ("spindle", "output_acc")
    assert plant.disturbance_names == ("F_cut", "disturbance_slide")
    whole = MODEL.state_space()  # from F_cut, F to x, acc
    for s in (0.0, 300j, 2000j):
        own = np.asarray(plant.system(s))  # from w, u to z, y
        np.testing.assert_allclose(own[1, 0], whole(s)[1, 0], atol=1e-12)
        np.testing.assert_allclose(own[1, 1], whole(s)[1, 1], atol=1e-12)  # F acts on the slide
        np.testing.assert_allclose(own[2, 2], whole(s)[0, 1])
        np.testing.assert_allclose(own[3, 0], s * own[0, 0], atol=1e-12)
    assert plant.units["output_acc"] == "m/s^2"
    assert plant.units["disturbance_slide"] == "N"


def test_what_is_not_named():
    plant = machine_plant(MODEL, ["F"], (), (), ())
    assert plant.disturbance_names == ("F_cut",)
    assert plant.performance_names == ("slide", "spindle")
    assert plant.measurement_names == ("measured_x", "measured_acc")
    alone = machine_plant(MODEL, ["F", "F_cut"], (), (), ())
    assert alone.disturbance_names == ("disturbance_F", "disturbance_F_cut")
    pushed = machine_plant(MODEL, ["u_slide"], (), (), ())
    assert pushed.control_names == ("u_slide",)


def test_a_plant_keeps_what_is_named_and_its_delays():
    given = rp.air_bearing().with_delay("u_x", 1e-4)
    plant = machine_plant(given, ["x", "y"], ["measured_x"], ["z", "x"], ["u_y"])
    assert (plant.control_names, plant.measurement_names) == (("u_x", "u_y"), ("measured_x",))
    assert (plant.performance_names, plant.disturbance_names) == (("z", "x"), ("disturbance_y",))
    assert dict(plant.delays) == {"u_x": 1e-4}
    assert machine_plant(given, (), (), (), ()).nu == 6
    response = control.frd([1.0, 2.0], [1.0, 2.0])
    measured = rp.GeneralizedPlant(response, measurements=1, controls=1)
    with pytest.raises(rp.InvalidInputError, match="model with states"):
        machine_plant(measured, (), (), (), ())


@pytest.mark.parametrize(
    ("names", "says"),
    [
        ((["Fcut"], (), (), ()), "controls: got 'Fcut'.*Write F_cut"),
        (((), (), (), ()), "controls: got none"),
        ((["F", "F"], (), (), ()), "F twice"),
        ((["F"], ["acceleration"], (), ()), "measurements: got 'acceleration', expected one of x"),
        ((["F"], (), ["spindel"], ()), "performance.*Write spindle"),
        ((["F"], (), (), ["cut"]), "disturbances: got 'cut'"),
    ],
)
def test_unknown_names(names, says):
    with pytest.raises(rp.InvalidInputError, match=says):
        machine_plant(MODEL, *names)
