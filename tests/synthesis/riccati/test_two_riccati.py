"""Both equations decide a published optimum, and their controller keeps every bound above it."""

import control
import numpy as np
import pytest
from hard_plants import random_plant
from published_plants import scherer_1997
from small_plants import oscillator

from robustpolish.base.budget import Budget
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.synthesis.problem.matrices import (
    Controller,
    PlantMatrices,
    close,
    state_gain_norm,
)
from robustpolish.synthesis.riccati.gamma import (
    central_controller,
    has_full_rank,
    normalise,
    search_gamma,
)
from robustpolish.synthesis.state_feedback.riccati import lqr_gain


def norm_of(plant, K):
    return float(hinf_norm(control.StateSpace(*close(plant, K))))


def test_the_coupling_falls_and_crosses_gamma_at_the_published_optimum():
    halves = normalise(PlantMatrices.of(scherer_1997())).halves
    assert halves.states == 3
    attempts = {gamma: halves.attempt(gamma) for gamma in (9.4, 9.51, 20.0, 1e6)}
    assert [found.feasible for found in attempts.values()] == [False, True, True, True]
    couplings = [found.coupling for found in attempts.values() if found.coupling is not None]
    assert couplings == sorted(couplings, reverse=True)
    assert attempts[9.51].coupling == pytest.approx(9.51, rel=1e-3)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("share", [1.001, 1.5, 100.0])
def test_the_central_controller_keeps_its_bound_with_feedthrough(seed, share):
    plant = PlantMatrices.of(random_plant(4, seed, singular=False)).without_d22()
    normal = normalise(plant)
    bracket = search_gamma(normal.halves, 1.0, 1e-6, Budget())
    assert bracket is not None
    gamma = share * bracket.upper
    found = normal.halves.attempt(gamma)
    assert found.X is not None
    assert found.Y is not None
    K = central_controller(normal, gamma, found.X, found.Y)
    assert bracket.lower * (1 - 1e-6) <= norm_of(plant, K) < gamma


def test_next_to_the_floor_the_feedthrough_is_that_of_parrott():
    # Hardly any dynamics: D11 + [0, 0; 0, Dk] can be made as small as its first row or column.
    one, small = np.eye(1), 1e-6 * np.ones((1, 2))
    plant = PlantMatrices(
        A=-one,
        B1=small,
        B2=one,
        C1=small.T,
        C2=one,
        D11=np.array([[1.0, 2.0], [3.0, 4.0]]),
        D12=np.array([[0.0], [1.0]]),
        D21=np.array([[0.0, 1.0]]),
        D22=np.zeros((1, 1)),
    )
    normal, gamma = normalise(plant), 1.001 * np.sqrt(10)
    assert normal.halves.floor == pytest.approx(np.sqrt(10))
    found = normal.halves.attempt(gamma)
    assert found.X is not None
    assert found.Y is not None
    K = central_controller(normal, gamma, found.X, found.Y)
    assert np.sqrt(10) * (1 - 1e-9) < norm_of(plant, K) < gamma
    assert K.D.item() == pytest.approx(-4 - 3 * 2 / (gamma**2 - 1), rel=1e-6)


def test_the_normalised_plant_has_the_same_loops():
    plant = PlantMatrices.of(random_plant(3, 1, singular=False, unstable=0)).without_d22()
    plant = plant.replace(D12=plant.D12 @ np.diag([1e3, 1e-2]), B2=plant.B2 @ np.diag([1e3, 1e-2]))
    normal = normalise(plant)
    np.testing.assert_array_equal(normal.plant.D12, [[0, 0], [1, 0], [0, 1]])
    np.testing.assert_array_equal(normal.plant.D21, [[0, 1, 0], [0, 0, 1]])
    rng = np.random.default_rng(0)
    K = Controller(-5 * np.eye(2), *(0.1 * rng.standard_normal((2, 2)) for _ in range(3)))
    norm = norm_of(normal.plant, K)
    assert np.isfinite(norm)
    assert norm_of(plant, normal.controller(K)) == pytest.approx(norm, rel=1e-6)


def test_below_the_norm_of_the_feedthrough_nothing_is_tried():
    # z1 = 3 w1 is reached neither by u nor by y.
    plant = PlantMatrices.of(oscillator()).replace(D11=np.diag([3.0, 0.0]))
    halves = normalise(plant).halves
    assert halves.floor == pytest.approx(3.0)
    assert halves.attempt(2.9) == (False, None, None, None)
    assert halves.attempt(30.0).feasible


def test_without_a_bound_the_control_half_is_the_regulator():
    plant = PlantMatrices.of(oscillator())
    normal = normalise(plant)
    X, F = normal.halves.control.solve(np.inf), lqr_gain(plant)
    assert X is not None
    # tr(B1' X B1) is the square of the least H2 norm.
    square = np.trace(normal.plant.B1.T @ X @ normal.plant.B1)
    assert np.sqrt(square) == pytest.approx(state_gain_norm(plant, F, "h2"), rel=1e-6)


def test_ranks_do_not_depend_on_units():
    plant = PlantMatrices.of(random_plant(3, 0, singular=False))
    units = np.diag([1e9, 1e-9])
    assert has_full_rank(plant)
    assert has_full_rank(plant.replace(D12=plant.D12 @ units, D21=units @ plant.D21))
    assert not has_full_rank(PlantMatrices.of(random_plant(3, 0, singular=True)))
    assert not has_full_rank(plant.replace(D12=plant.D12[:, [0, 0]]))
    assert not has_full_rank(plant.replace(D12=plant.D12[:1]))
