"""Riccati and Lyapunov equations: right where SciPy is, and None where there is no solution."""

import control
import numpy as np
import pytest
from hard_plants import random_plant
from published_plants import scherer_1997
from scipy import linalg

from robustpolish.base.budget import Budget
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.synthesis.problem.matrices import PlantMatrices, close
from robustpolish.synthesis.riccati.gamma import (
    central_controller,
    normalise,
    search_gamma,
    solve_riccati,
)


def drawn(n, seed):
    rng = np.random.default_rng(seed)
    B, C = rng.standard_normal((n, 2)), rng.standard_normal((2, n))
    return rng.standard_normal((n, n)), B, C.T @ C


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("decades", [0, 8])
def test_the_regulator_in_any_units(seed, decades):
    A, B, Q = drawn(5, seed)
    expected = linalg.solve_continuous_are(A, B, Q, np.eye(2))
    unit = 10.0 ** np.random.default_rng(seed).uniform(-decades, decades, 5)
    found = solve_riccati(
        A * unit / unit[:, None], -(B @ B.T) / unit / unit[:, None], Q * unit * unit[:, None]
    )
    back = found / unit / unit[:, None]
    np.testing.assert_allclose(back, expected, rtol=1e-7, atol=1e-7 * np.abs(expected).max())


def test_a_game_with_an_indefinite_quadratic_term():
    # q x^2 - 2 x + 1 = 0 has solutions as long as q <= 1; the smaller one stabilises.
    for quadratic in (0.75, -3.0):
        found = solve_riccati(-np.eye(1), np.array([[quadratic]]), np.eye(1))
        assert found.item() == pytest.approx((1 - np.sqrt(1 - quadratic)) / quadratic)
    assert solve_riccati(-np.eye(1), np.array([[1.25]]), np.eye(1)) is None


def test_no_solution_no_answer():
    one, none = np.eye(1), np.zeros((1, 1))
    assert solve_riccati(one, none, one) is None  # nothing moves the unstable mode
    rotor = np.array([[0.0, 1.0], [-1.0, 0.0]])
    B = np.diag([0.0, 1.0])
    assert solve_riccati(rotor, -B, np.zeros((2, 2))) is None  # nothing sees the undamped mode
    assert solve_riccati(rotor, -B, np.eye(2)) is not None
    assert solve_riccati(one, -one, np.array([[np.nan]])) is None
    nothing = np.zeros((0, 0))
    empty = solve_riccati(nothing, nothing, nothing)
    assert empty.shape == (0, 0)


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
