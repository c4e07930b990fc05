"""Stretches joined by doubling, against the Hamiltonian's exponential and a gain known by hand."""

import numpy as np
import pytest
from scipy.linalg import expm

from robustpolish.implementation.sampled.induced_norm import (
    EnergySection,
    GainReached,
    hamiltonian,
    joined,
    phase_section,
)
from robustpolish.implementation.sampled.lifting import Phase


def phase(length=1.0, D=0.0):
    rng = np.random.default_rng(4)
    A = rng.normal(size=(3, 3))
    return Phase(length, A, rng.normal(size=(3, 2)), rng.normal(size=(2, 3)), np.full((2, 2), D))


@pytest.mark.parametrize("D", [0.0, 0.2])
def test_doubling_gives_what_the_exponential_gives(D):
    own, gamma = phase(0.4, D), 5.0
    found = phase_section(own, gamma)
    F = expm(hamiltonian(own, gamma) * own.length)
    inverse = np.linalg.inv(F[3:, 3:])
    np.testing.assert_allclose(found.A, inverse.T, rtol=1e-10)
    np.testing.assert_allclose(found.G, F[:3, 3:] @ inverse, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.Q, -inverse @ F[3:, :3], rtol=1e-9, atol=1e-12)


def test_two_halves_are_the_whole():
    gamma = 4.0
    half, whole = phase_section(phase(0.2), gamma), phase_section(phase(0.4), gamma)
    both = joined(half, half)
    for mine, theirs in zip(both, whole, strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=1e-9, atol=1e-12)


def test_the_gain_of_an_integrator_over_a_stretch():
    # z = integral of w over [0, T]: the largest gain is 2 T / pi.
    T = 3.0
    one = np.ones((1, 1))
    integrator = Phase(T, 0 * one, one, one, 0 * one)
    edge = 2 * T / np.pi
    assert isinstance(phase_section(integrator, edge * (1 + 1e-9)), EnergySection)
    assert isinstance(phase_section(integrator, edge * (1 - 1e-9)), GainReached)


def test_a_direct_path_alone_may_reach_gamma():
    found = phase_section(phase(1e-9, 1.0), 1.9)
    assert isinstance(found, GainReached)
    assert found.stage == -1


def test_a_stiff_stretch_does_not_overflow():
    stiff = Phase(1.0, np.array([[-1e8, 0], [0, -1.0]]), np.ones((2, 1)), np.ones((1, 2)), [[0.0]])
    stiff = stiff._replace(D=np.zeros((1, 1)))
    found = phase_section(stiff, 2.0)
    assert isinstance(found, EnergySection)
    assert all(np.isfinite(part).all() for part in found)
