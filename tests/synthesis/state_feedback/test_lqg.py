"""The H2 optimum: textbook values, optimality conditions, and what singular problems approach."""

import numpy as np
import pytest
from hard_plants import random_plant

import robustpolish as rp
from robustpolish.synthesis.problem.matrices import Controller, PlantMatrices, close
from robustpolish.synthesis.state_feedback.riccati import cancel_feedthrough, h2_lower_bound


def test_a_feedthrough_is_cancelled_without_changing_what_can_be_reached():
    plant = PlantMatrices.of(random_plant(3, 0, singular=False)).without_d22()
    feedthrough = plant.D12 @ np.array([[1.0, -2.0], [0.5, 3.0]]) @ plant.D21
    plant = plant.replace(D11=feedthrough)
    rest, F = cancel_feedthrough(plant)
    assert not rest.D11.any()
    rng = np.random.default_rng(1)
    K = Controller(*(rng.standard_normal((2, 2)) for _ in range(4)))
    for inner, outer in zip(close(rest, K), close(plant, K._replace(D=K.D + F)), strict=True):
        np.testing.assert_allclose(inner, outer, atol=1e-10)


def test_the_singular_h2_infimum_is_the_limit_of_vanishing_price_and_noise():
    rng = np.random.default_rng(0)
    draw = rng.standard_normal
    parts = draw((3, 3)), draw((3, 2)), draw((3, 1)), draw((2, 3)), draw((1, 3))
    singular = PlantMatrices.of(rp.GeneralizedPlant.from_matrices(*parts))
    bound = h2_lower_bound(singular)
    assert bound is not None
    norms = []
    for size in (1e-2, 1e-3, 1e-4):
        plant = rp.GeneralizedPlant.from_matrices(*parts)
        design = rp.output_feedback(plant, "h2", control_weight=size, measurement_noise=size)
        norms.append(design.certificate.achieved)
    assert norms[0] > norms[1] > norms[2] > bound.value
    assert norms[2] == pytest.approx(bound.value, rel=0.05)
