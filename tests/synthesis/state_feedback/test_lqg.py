"""The H2 optimum: textbook values, optimality conditions, and what singular problems approach."""

import control
import numpy as np
import pytest
from hard_plants import random_plant
from published_plants import zhou_h2
from small_plants import regular_plant

import robustpolish as rp
from robustpolish.linear.norms.h2 import h2_norm
from robustpolish.synthesis.problem.matrices import Controller, PlantMatrices, close
from robustpolish.synthesis.state_feedback.riccati import cancel_feedthrough, h2_lower_bound, lqg


def norm_of(plant, K):
    return float(h2_norm(control.StateSpace(*close(plant, K), True if plant.discrete else 0)))


def test_the_published_optimum_is_also_the_lower_bound():
    plant = PlantMatrices.of(zhou_h2())
    K, bound = lqg(plant), h2_lower_bound(plant)
    assert K is not None
    assert bound is not None
    assert norm_of(plant, K) == pytest.approx(8.9582, rel=1e-5)
    assert bound.value == pytest.approx(norm_of(plant, K), rel=1e-8)


@pytest.mark.parametrize("discrete", [False, True])
def test_no_neighbour_is_better(discrete):
    plant = PlantMatrices.of(regular_plant(2, 1)).replace(discrete=discrete)
    K = lqg(plant)
    assert K is not None
    best = norm_of(plant, K)
    assert np.isfinite(best)
    bound = h2_lower_bound(plant)
    assert bound is not None
    assert bound.value == pytest.approx(best, rel=1e-6)
    rng = np.random.default_rng(0)
    for _ in range(10):
        # In continuous time a feedthrough would make the norm infinite.
        moves = [3e-4 * rng.standard_normal(M.shape) * (i < 3 or discrete) for i, M in enumerate(K)]
        there, back = (
            norm_of(plant, Controller(*(M + sign * move for M, move in zip(K, moves, strict=True))))
            for sign in (1, -1)
        )
        # A minimum: worse on both sides, and by the same amount.
        assert min(there, back) > best
        assert abs(there - back) < 0.2 * (there + back - 2 * best)


def test_singular_or_unstabilisable_plants_have_no_regulator():
    plant = PlantMatrices.of(regular_plant(2, 0))
    assert lqg(plant) is not None
    assert lqg(plant.replace(D12=0 * plant.D12)) is None
    assert lqg(plant.replace(D21=0 * plant.D21)) is None
    stuck = plant.replace(A=np.diag([1.0, -1.0]), B2=np.array([[0.0], [1.0]]))
    assert lqg(stuck) is None
    assert lqg(stuck.replace(A=np.diag([2.0, 0.5]), discrete=True)) is None


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


def test_a_feedthrough_that_stays_is_refused_in_continuous_time_only():
    plant = PlantMatrices.of(random_plant(3, 0, singular=False)).without_d22()
    stays = plant.replace(D11=np.eye(3))
    with pytest.raises(rp.InfeasibleError, match="no controller cancels the feedthrough D11"):
        cancel_feedthrough(stays)
    sampled = stays.replace(discrete=True)
    assert cancel_feedthrough(sampled)[0] is sampled
    without = plant.replace(D11=np.zeros((3, 3)))
    assert cancel_feedthrough(without)[0] is without


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
