"""The peak of the gain in double precision."""

import control
import numpy as np
import pytest

from robustpolish.linear.arithmetic.realisation import realisation
from robustpolish.linear.norms.peak import (
    bounds_gain,
    cayley,
    gains,
    hamiltonian,
    largest_response,
    peak,
)

ZETA = 0.05
OSCILLATOR = realisation("s", control.ss([[0, 1], [-1, -2 * ZETA]], [[0], [1]], [[1, 0]], 0))
PEAK = 1 / (2 * ZETA * np.sqrt(1 - ZETA**2))


def test_gains_at_frequencies_and_at_infinity():
    found = gains(OSCILLATOR, np.array([0.0, 1.0, np.inf]))
    np.testing.assert_allclose(found, [1.0, 1 / (2 * ZETA), 0.0], rtol=1e-12)
    constant = realisation("s", control.StateSpace([], [], [], [[3.0, 4.0]]))
    np.testing.assert_allclose(gains(constant, np.array([0.0, 2.0])), 5.0)


def test_many_frequencies_are_taken_in_parts():
    many = np.linspace(0, 3, 200)
    each = [gains(OSCILLATOR, many[i : i + 1])[0] for i in range(200)]
    np.testing.assert_array_equal(gains(OSCILLATOR, many), each)


def test_the_peak_is_climbed():
    frequency, gain = peak(OSCILLATOR, np.linalg.eigvals(OSCILLATOR.A).astype(complex), 1e-9)
    assert gain == pytest.approx(PEAK, rel=1e-9)
    assert frequency == pytest.approx(np.sqrt(1 - 2 * ZETA**2), rel=1e-6)
    assert largest_response(OSCILLATOR) == pytest.approx(PEAK, rel=1e-9)


def test_only_gains_above_the_peak_are_bounds():
    assert bounds_gain(OSCILLATOR, 1.001 * PEAK)
    assert not bounds_gain(OSCILLATOR, 0.999 * PEAK)


def test_the_hamiltonian_has_imaginary_eigenvalues_where_the_gain_is_reached():
    gamma = 5.0
    values = np.linalg.eigvals(hamiltonian(OSCILLATOR, gamma))
    crossings = np.abs(values.imag[np.abs(values.real) < 1e-9])
    np.testing.assert_allclose(gains(OSCILLATOR, crossings), gamma, rtol=1e-9)
    assert crossings.size == 4
    unit = realisation("s", control.ss(-1, 1, -1, 1))
    assert hamiltonian(unit, 1.0) is None  # the gain of D itself


def test_the_bilinear_map_keeps_the_gains():
    system = control.ss([[0.5, 0.2], [0.0, -0.3]], [[1], [2]], [[1, 1]], 0.5, True)
    mapped = cayley(realisation("s", system))
    for angle in (0.1, 1.0, 3.0):
        expected = abs(system(np.exp(1j * angle)))
        assert gains(mapped, np.array([np.tan(angle / 2)]))[0] == pytest.approx(expected)
    assert cayley(OSCILLATOR) is OSCILLATOR
