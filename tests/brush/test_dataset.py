"""What the datasets of both simulators share."""

from dataclasses import replace

import numpy as np
import pytest

from robustpolish.polishing.dataset import (
    angle_variables,
    force_variables,
    labelled,
    parameter_attributes,
    parameters_from_attributes,
    path_variables,
    quantity,
)
from robustpolish.polishing.parameters import BrushParameters
from robustpolish.polishing.surfaces.surface import Surface

TIME = np.linspace(0.0, 0.3, 31)


def test_parameters_come_back_from_attributes():
    brush = BrushParameters(friction=0.1, feed=0.002, surface=Surface(0.3, 0.7))
    attributes = parameter_attributes(brush)
    assert all(isinstance(value, float) for value in attributes.values())
    assert parameters_from_attributes(attributes) == brush


def test_elevation_is_the_slope_in_the_direction_of_movement():
    brush = BrushParameters()
    found = {name: values for name, (_, values, _) in path_variables(TIME, brush).items()}
    climb = np.gradient(found["surface_height"], TIME)
    way = np.hypot(np.gradient(found["tool_x"], TIME), np.gradient(found["tool_y"], TIME))
    np.testing.assert_allclose(
        np.tan(found["elevation"])[1:-1], (climb / way)[1:-1], atol=0.02 * np.ptp(climb / way)
    )


def test_a_tool_at_rest_has_no_elevation():
    resting = replace(BrushParameters(), feed=0.0, rotation_rate=0.0)
    assert not path_variables(TIME, resting)["elevation"][1].any()


def test_signals_are_labelled_with_units():
    forces = {name: np.full(31, value) for value, name in enumerate(("F_x", "F_y", "F_z", "F_p"))}
    angles = (TIME, 2 * TIME, 3 * TIME, 4 * TIME)
    variables = {
        **force_variables(forces),
        **angle_variables(angles, ("tilt about x", "tilt about y"), level=0.5),
        "share": quantity(np.ones((31, 4)), "1", "share", ("time", "point")),
    }
    data = labelled(TIME, variables, {"simulator": "none"})
    assert dict(data.sizes) == {"time": 31, "point": 4}
    assert {data[name].attrs["units"] for name in forces} == {"N"}
    assert float(data["F_z"][0]) == 2.0
    assert (data["psi"].attrs["level"], "level" in data["theta"].attrs) == (0.5, False)
    assert data["psi_rate"].attrs == {"units": "rad/s", "long_name": "rate of tilt about y"}
    np.testing.assert_array_equal(data["theta_rate"], 3 * TIME)
    assert data.attrs == {"simulator": "none"}
    assert "level" not in angle_variables(angles, ("a", "b"), level=None)["psi"][2]


@pytest.mark.parametrize("name", ["surface_along", "friction"])
def test_an_attribute_that_is_missing_is_named(name):
    attributes = parameter_attributes(BrushParameters())
    del attributes[name]
    with pytest.raises(KeyError, match=name):
        parameters_from_attributes(attributes)
