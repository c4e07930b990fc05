"""Fixed modes are named, and no others; prices and noises, and the channels they join."""

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.synthesis.problem.preflight import (
    check_solvability,
)


def integrator_behind_a_lag(seed=17):
    """Some dynamics, an actuator with a lag, and an integrator of the error, in mixed states."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 4))
    lag = 10 ** rng.uniform(3, 8)
    inner = rng.standard_normal((n, n))
    inner -= (np.linalg.eigvals(inner).real.max() + 0.1) * np.eye(n)
    inner *= 10 ** rng.uniform(0, 2)
    N = n + 2
    A, B2, C = np.zeros((N, N)), np.zeros((N, 1)), np.zeros((1, N))
    A[:n, :n], A[:n, n], A[n, n] = inner, rng.standard_normal(n), -lag
    A[-1, :n], B2[n], C[0, -1] = rng.standard_normal(n), lag, 1
    T = rng.standard_normal((N, N)) + 2 * np.eye(N)
    back = np.linalg.inv(T)
    B1 = np.hstack([rng.standard_normal((N, 1)), np.zeros((N, 1))])
    return rp.GeneralizedPlant.from_matrices(
        T @ A @ back,
        T @ B1,
        T @ B2,
        np.vstack([C, 0 * C]) @ back,
        C @ back,
        D12=[[0], [0.1]],
        D21=[[0, 0.1]],
    )


@pytest.mark.parametrize("seed", [17, 21, 23, 39])
def test_an_integrator_behind_a_fast_lag_is_not_fixed(seed):
    assert check_solvability(integrator_behind_a_lag(seed)).fixed_modes == ()


def test_a_method_that_fails_does_not_blame_the_integrator():
    plant = integrator_behind_a_lag()
    assert rp.output_feedback(plant).certificate.valid
    try:
        design = rp.output_feedback(plant, method="slycot")
    except rp.SolverError as error:
        assert "No controller stabilises" not in str(error)  # noqa: PT017 it may succeed as well
    else:
        assert design.certificate.valid


def test_a_slow_stable_mode_out_of_reach_is_no_obstacle():
    # Beside rates of 1e8 rounding could make it unstable, but it is stable as it stands.
    A = np.diag([-1e8, -0.15, 0.0])
    A[2, 0] = 1.0
    plant = rp.GeneralizedPlant.from_matrices(
        A, [[0], [1], [1]], [[1e8], [1e-14], [0]], [[0, 1, 1]], [[0, 0, 1]]
    )
    assert check_solvability(plant).fixed_modes == ()


@pytest.mark.parametrize("dt", [0, 0.1])
def test_modes_that_are_fixed_are_named_with_their_state(dt):
    A = np.diag([1.2, 0.5, -0.5])
    plant = rp.GeneralizedPlant.from_matrices(
        A,
        np.ones((3, 1)),
        [[0], [1], [1]],
        np.ones((1, 3)),
        [[1, 0, 1]],
        dt=dt,
        states=["drift", "lag", "other"],
    )
    modes = check_solvability(plant).fixed_modes
    told = {(mode.lack, mode.state) for mode in modes}
    expected = {("uncontrollable", "drift")} | ({("unobservable", "lag")} if not dt else set())
    assert told == expected
    assert all(mode.exact for mode in modes)
    with pytest.raises(rp.InfeasibleError, match=r"uncontrollable mode \+1\.2 \(state drift\)"):
        rp.output_feedback(plant)


def test_a_mode_fixed_to_rounding_in_mixed_states_is_named():
    T = np.random.default_rng(5).standard_normal((3, 3)) + 2 * np.eye(3)
    back = np.linalg.inv(T)
    plant = rp.GeneralizedPlant.from_matrices(
        T @ np.diag([1.2, -0.5, -0.7]) @ back,
        T @ np.ones((3, 1)),
        T @ [[0], [1], [1]],
        np.ones((1, 3)) @ back,
        np.ones((1, 3)) @ back,
    )
    (mode,) = check_solvability(plant).fixed_modes
    assert mode.eigenvalue == pytest.approx(1.2)
    assert mode.lack == "uncontrollable"
