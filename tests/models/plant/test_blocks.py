"""The blocks of a plant, read off its system."""

import numpy as np

import robustpolish as rp
from tests.models.plant.random_plants import random_plant


def test_blocks_are_those_of_the_system():
    plant = random_plant(np.random.default_rng(0))
    again = rp.GeneralizedPlant(plant.system, measurements=2, controls=3)
    for name in ("A", "B1", "B2", "C1", "C2", "D11", "D12", "D21", "D22"):
        np.testing.assert_array_equal(getattr(again, name), getattr(plant, name))
    assert (again.nx, again.nw, again.nu, again.nz, again.ny) == (4, 2, 3, 2, 2)
    assert again.control_names == ("u1", "u2", "u3")
    assert again.measurement_names == ("y1", "y2")
