"""Prices and noises, and the channels they join."""

import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.models import air_bearing
from robustpolish.synthesis.problem.channels import channel
from robustpolish.synthesis.problem.pricing import noisy, priced


def test_price_and_noise_make_a_singular_plant_regular():
    plant = air_bearing(measured="displacement")
    weights = np.array([1.0, 2.0, 0.0, 3.0, 0.0, 0.5])
    regular = noisy(priced(plant, weights), 1e-6)
    assert np.linalg.matrix_rank(regular.D12) == 4
    assert np.linalg.matrix_rank(regular.D21) == 6
    assert regular.performance_names[6:] == (
        "price_u_x_m",
        "price_u_x",
        "price_u_y",
        "price_u_z",
    )
    assert (regular.A == plant.A).all()
    assert (regular.C2 == plant.C2).all()
    assert (regular.B2 == plant.B2).all()
    # The plant as it was is one of its channels.
    back = channel(regular, plant.disturbance_names, plant.performance_names)
    for name in ("B1", "C1", "D11", "D12", "D21", "D22"):
        assert (getattr(back, name) == getattr(plant, name)).all()


def test_nothing_to_pay_leaves_the_plant_alone():
    plant = air_bearing()
    assert priced(plant, 0.0) is plant
    assert priced(plant, None) is plant
    assert noisy(plant, None) is plant


@pytest.mark.parametrize("weight", [-1.0, [1.0, 2.0], np.inf, "dear"])
def test_bad_weights_are_named(weight):
    with pytest.raises(InvalidInputError, match="control_weight"):
        priced(air_bearing(), weight)
    with pytest.raises(InvalidInputError, match="measurement_noise"):
        noisy(air_bearing(), weight)
