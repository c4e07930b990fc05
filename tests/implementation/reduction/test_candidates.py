"""Balanced truncation with its known bounds, and factors that give back the controller."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.implementation.reduction import Reducer, coprime_gramians, from_factor
from robustpolish.plants.blocks import matrices_of


def filter_loop(seed=0, n=6):
    """A stable plant and a stable controller that hardly act on each other."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, n))
    A -= (np.linalg.eigvals(A).real.max() + 0.3) * np.eye(n)
    K = control.ss(A, rng.normal(size=(n, 2)), rng.normal(size=(2, n)), 0)
    plant = rp.GeneralizedPlant.from_matrices(
        -np.eye(2), np.eye(2), 1e-3 * np.eye(2), np.eye(2), 1e-3 * np.eye(2)
    )
    return plant, K


def test_the_error_of_balanced_truncation_is_at_most_twice_the_tail():
    plant, K = filter_loop()
    reducer = Reducer(plant, K)
    hankel = reducer.hankel["balanced"]
    for order in range(6):
        found = {c.name: c.controller for c in reducer.of_order(order)}
        for how in ("truncated", "residualised"):
            error = K - found[f"balanced, {how}"]
            assert rp.hinf_norm(control.ss(error)).value <= 2 * hankel[order:].sum() * (1 + 1e-6)
        kept = found["balanced, residualised"]
        np.testing.assert_allclose(kept.dcgain(), K.dcgain(), rtol=1e-6)


def test_hankel_values_are_those_of_python_control():
    plant, K = filter_loop(3)
    expected = control.hankel_singular_values(K)
    np.testing.assert_allclose(Reducer(plant, K).hankel["balanced"], expected, rtol=1e-6)


@pytest.mark.parametrize("shift", [0.0, 2.0])
def test_whole_coprime_factors_give_back_the_controller(shift):
    _, K = filter_loop(5, 4)
    A, B, C, D = matrices_of(K)
    K = (A + shift * np.eye(4), B, C, D + 0.3)
    ways = coprime_gramians(K, False)
    assert [way.name for way in ways] == ["left coprime", "right coprime"]
    s = 0.7j
    expected = K[2] @ np.linalg.solve(s * np.eye(4) - K[0], K[1]) + K[3]
    for way in ways:
        a, b, c, d = from_factor(way.matrices, way.back, 2, 2)
        np.testing.assert_allclose(c @ np.linalg.solve(s * np.eye(4) - a, b) + d, expected)
        # normalised: the factors together are all-pass, so their Hankel values are below one
        assert np.linalg.eigvals(way.reach @ way.see).real.max() < 1
