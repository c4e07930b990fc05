"""A norm that doubles find stands only where a gain below and a proof above enclose it."""

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.synthesis.proofs.bounded_real import (
    enclose_loop,
    enclose_system,
    prove_computed_norm,
    rounding_level,
)


def drawn(n, dt, seed):
    """A stable plant, more or less damped."""
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((n, n))
    poles = np.linalg.eigvals(A)
    margin = 10 ** rng.uniform(-3, -0.5)
    A = (
        A / np.abs(poles).max() * (1 - margin)
        if dt
        else A - (poles.real.max() + margin) * np.eye(n)
    )
    sizes = (n, 2), (n, 1), (2, n), (1, n)
    return rp.GeneralizedPlant.from_matrices(A, *map(rng.standard_normal, sizes), dt=dt)


def computed(plant, gain=0.0, rounded=None):
    K = plant.static_controller([[gain]])
    loop = enclose_loop(plant, K)
    rounded = enclose_system(plant.closed_loop(K) if rounded is None else rounded)
    return prove_computed_norm(loop, rounded, rounding_level(loop), plant.dt or None)


@pytest.mark.parametrize("dt", [0, 0.1])
@pytest.mark.parametrize("n", [1, 3, 8])
def test_it_encloses_the_exact_norm(n, dt):
    plant = drawn(n, dt, n)
    found, norm = computed(plant), rp.hinf_norm(plant.open_loop)
    assert found is not None
    assert found.achieved == pytest.approx(norm.value, rel=1e-9)
    assert found.frequency == pytest.approx(norm.frequency, rel=1e-3, abs=1e-9)
    assert norm.upper <= found.proof.bound <= 1.0002 * norm.value


@pytest.mark.parametrize("dt", [0, 0.1])
def test_an_unstable_loop_is_never_proven(dt):
    A = np.diag([1.1 if dt else 0.1, 0.5 if dt else -1.0])
    one = np.ones((2, 1))
    plant = rp.GeneralizedPlant.from_matrices(A, one, one, one.T, one.T, dt=dt)
    assert computed(plant) is None


def test_a_loop_that_rounding_changes_is_left_to_care():
    plant = drawn(3, 0, 1)
    other = drawn(3, 0, 2)
    assert computed(plant) is not None
    assert computed(plant, rounded=1.01 * plant.open_loop) is None
    assert computed(plant, rounded=other.open_loop) is None


def test_a_norm_of_zero_and_a_missing_signal_are_left_to_care():
    zero = np.zeros((1, 1))
    plant = rp.GeneralizedPlant.from_matrices(-np.eye(1), zero, np.eye(1), np.eye(1), np.eye(1))
    assert computed(plant) is None
    assert rp.certify(plant, [[0.0]]).valid
