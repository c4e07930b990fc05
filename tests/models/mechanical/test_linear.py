"""A mechanical model as a plant for synthesis."""

import numpy as np

from tests.models.mechanical.two_masses import two_masses


def test_an_input_can_become_a_control():
    plant = two_masses().linearize(controls=["F"])
    assert plant.nw == 0
    assert plant.control_names == ("F",)
    np.testing.assert_allclose(plant.B2[:, 0], [0, 0, 0, -5.0])
