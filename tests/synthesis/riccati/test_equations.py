"""Riccati and Lyapunov equations: right where SciPy is, and None where there is no solution."""

import numpy as np
import pytest
from scipy import linalg

from robustpolish.synthesis.riccati.equations import (
    solve_lyapunov,
    solve_riccati,
    symplectic_scaling,
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
    assert found is not None
    back = found.X / unit / unit[:, None]
    np.testing.assert_allclose(back, expected, rtol=1e-7, atol=1e-7 * np.abs(expected).max())


def test_a_game_with_an_indefinite_quadratic_term():
    # q x^2 - 2 x + 1 = 0 has solutions as long as q <= 1; the smaller one stabilises.
    for quadratic in (0.75, -3.0):
        found = solve_riccati(-np.eye(1), np.array([[quadratic]]), np.eye(1))
        assert found is not None
        assert found.X.item() == pytest.approx((1 - np.sqrt(1 - quadratic)) / quadratic)
        assert found.separation == pytest.approx(1.0)
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
    assert empty is not None
    assert empty.X.shape == (0, 0)


def test_the_scaling_is_symplectic_and_evens_out():
    A, B, Q = drawn(4, 0)
    unit = 10.0 ** np.array([-6.0, 4.0, 0.0, 7.0])
    A, R = A * unit / unit[:, None], B @ B.T / unit / unit[:, None] * 1e9
    Q = Q * unit * unit[:, None] * 1e-5
    scale, weight = symplectic_scaling(A, R, Q)
    powers = np.append(scale, weight)
    np.testing.assert_array_equal(np.exp2(np.round(np.log2(powers))), powers)
    sizes = [
        np.abs(M).max()
        for M in (
            A * scale / scale[:, None],
            R / scale / scale[:, None] * weight,
            Q * scale * scale[:, None] / weight,
        )
    ]
    assert max(sizes) < 100 * min(sizes)


def test_gramians_of_stable_systems_in_any_units():
    rng = np.random.default_rng(3)
    A = rng.standard_normal((5, 5))
    A -= (np.linalg.eigvals(A).real.max() + 1e-3) * np.eye(5)
    Q = np.diag([1.0, 2.0, 3.0, 0.0, 0.0])
    expected = linalg.solve_continuous_lyapunov(A.T, -Q)
    for size in (1e-200, 1.0, 1e200):
        found = solve_lyapunov(A, size * Q)
        assert found is not None
        np.testing.assert_allclose(found / size, expected, rtol=1e-8)
        np.testing.assert_array_equal(found, found.T)
    damped = solve_lyapunov(np.diag([-1e-9, -1.0]), np.eye(2))
    assert damped is not None
    np.testing.assert_allclose(damped, np.diag([5e8, 0.5]))
    assert solve_lyapunov(A, np.full((5, 5), np.inf)) is None
