"""Loops of u = F x on a plant of one state, whose norms are known, and related plants."""

import math

import numpy as np
import pytest
from hard_plants import random_plant

from robustpolish.synthesis.problem.matrices import (
    PlantMatrices,
    is_regular,
    minimum_effort_problem,
    stabilises,
    state_gain_norm,
    with_noise,
    with_small_penalty,
)

# x' = x + w + u, z = (x, u), y = x; with u = -3 x it is 1/(s + 2) times (1, -3).
SCALAR = PlantMatrices(
    A=np.array([[1.0]]),
    B1=np.array([[1.0]]),
    B2=np.array([[1.0]]),
    C1=np.array([[1.0], [0.0]]),
    C2=np.array([[1.0]]),
    D11=np.zeros((2, 1)),
    D12=np.array([[0.0], [1.0]]),
    D21=np.zeros((1, 1)),
    D22=np.zeros((1, 1)),
)
DEAF = SCALAR.replace(B1=np.zeros((1, 0)), D11=np.zeros((2, 0)))
F = np.array([[-3.0]])


def test_stability_and_norms_of_known_loops():
    assert stabilises(SCALAR, F)
    assert not stabilises(SCALAR, np.array([[-1.0]]))
    assert state_gain_norm(SCALAR, F, "hinf") == pytest.approx(math.sqrt(10) / 2)
    assert state_gain_norm(SCALAR, F, "h2") == pytest.approx(math.sqrt(10 / 4))
    # Sampled, the pole of the same gain is -2; with u = -x/2 it is 1/2.
    sampled, half = SCALAR.replace(discrete=True), np.array([[-0.5]])
    assert not stabilises(sampled, F)
    assert stabilises(sampled, half)
    assert state_gain_norm(sampled, half, "hinf") == pytest.approx(math.sqrt(1.25) / 0.5)
    assert state_gain_norm(sampled, half, "h2") == pytest.approx(math.sqrt(1.25 / 0.75))


def test_no_gain_no_norm_and_no_signal_no_norm_either():
    for bad in (None, np.array([[np.nan]]), np.array([[1.0]])):
        assert state_gain_norm(SCALAR, bad, "hinf") == math.inf
    assert state_gain_norm(DEAF, F, "h2") == 0.0


@pytest.mark.parametrize(
    ("change", "size"),
    [
        (lambda p: with_small_penalty(p, 2.0), math.sqrt(10 + 36 + 4e-6)),
        (lambda p: with_noise(p, 0.5), math.sqrt(10 * 1.25)),
        (lambda _: with_noise(DEAF, 0.5), math.sqrt(2.5)),
        (lambda p: minimum_effort_problem(p, 4.0), 5.0),
    ],
)
def test_prices_and_noises_enter_the_norm(change, size):
    changed = change(SCALAR)
    assert state_gain_norm(changed, F, "hinf") == pytest.approx(size / 2)
    assert is_regular(changed)


def test_every_control_needs_a_price():
    assert is_regular(SCALAR)
    assert not is_regular(SCALAR.replace(D12=np.zeros((2, 1))))
    assert not is_regular(SCALAR.replace(D12=np.array([[0.0], [1e-13]])))
    two = PlantMatrices.of(random_plant(3, 0, singular=False))
    assert is_regular(two)
    assert not is_regular(two.replace(D12=two.D12[:, [0, 0]]))
    # One performance output cannot price two controls.
    assert not is_regular(two.replace(C1=two.C1[:1], D11=two.D11[:1], D12=two.D12[:1]))
    assert is_regular(two.replace(B2=np.zeros((3, 0)), D12=np.zeros((3, 0))))
