"""Brackets of the induced norm."""

import numpy as np
import pytest

from robustpolish.implementation.sampled.induced_norm import (
    bracket,
    check_gain,
    peak_frequency,
    period_section,
)
from robustpolish.implementation.sampled.lifting import period_map, scaled
from tests.implementation.designs import sampled_servo, servo


def loop():
    return scaled(period_map(servo(), sampled_servo().controller, 0.05, 0.02))


@pytest.mark.parametrize("start", [1e-9, 1.0, 1e9])
def test_the_bracket_does_not_depend_on_the_first_guess(start):
    low, high = bracket(loop(), start)
    expected = sampled_servo().certificate
    assert low.gamma < high.gamma <= low.gamma * (1 + 1e-6)
    assert not low.below
    assert high.below
    assert high.gamma == pytest.approx(expected.achieved, rel=1e-5)


def test_the_storage_function_solves_its_riccati_equation():
    own = loop()
    gamma = sampled_servo().certificate.achieved * 1.1
    P = check_gain(own, gamma).storage
    section = period_section(own, gamma)
    through = np.linalg.solve(np.eye(len(P)) - section.G @ P, section.A)
    expected = section.Q + section.A.T @ P @ through
    np.testing.assert_allclose(P, expected, atol=1e-9 * np.abs(P).max())
    assert np.abs(np.linalg.eigvals(through)).max() < 1


def test_the_peak_is_where_the_gain_is_reached():
    own = loop()
    gamma = sampled_servo().certificate.achieved
    omega = peak_frequency(own, gamma)
    assert 0 <= omega <= np.pi / 0.05
    section = period_section(own, gamma)
    z = np.exp(1j * omega * 0.05)
    states = np.linalg.solve(z * np.eye(len(section.A)) - section.A, section.G)
    back = np.linalg.solve((z * np.eye(len(section.A)) - section.A).conj().T, section.Q)
    assert np.abs(np.linalg.eigvals(states @ back)).max() == pytest.approx(1, abs=1e-3)
    assert peak_frequency(own, gamma * 1e-13) is None
