"""The transition matrices of a step, against their series and against quadrature."""

import numpy as np
from scipy.linalg import expm

from robustpolish.machines.simulation.stepper import step_matrices

A = np.array([[0.0, 1.0], [-1e4, -2.0]])
B, G = np.array([[0.0], [3.0]]), np.array([[0.0, 1.0], [1.0, 0.5]])
STEP = 1e-3


def integral(columns, weight, length):
    """Integrate exp(A (length - s)) columns weight(s / length) over s by Gauss's rule."""
    nodes, weights = np.polynomial.legendre.leggauss(20)
    x = (nodes + 1) / 2
    return sum(
        0.5 * length * w * weight(s) * expm(A * length * (1 - s)) @ columns
        for s, w in zip(x, weights, strict=True)
    )


def test_states_go_on_exactly():
    m = step_matrices(A, B, G, STEP)
    np.testing.assert_allclose(m.full, expm(A * STEP), rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(m.half @ m.half, m.full, rtol=1e-12, atol=1e-15)


def test_inputs_are_linear_between_the_ends():
    m = step_matrices(A, B, G, STEP)
    np.testing.assert_allclose(m.full_now, integral(B, lambda x: 1 - x, STEP), rtol=1e-11)
    np.testing.assert_allclose(m.full_later, integral(B, lambda x: x, STEP), rtol=1e-11)
    np.testing.assert_allclose(m.half_later, integral(B, lambda x: x, STEP / 2), rtol=1e-11)
    np.testing.assert_allclose(m.half_force, integral(G, lambda x: 1.0, STEP / 2), rtol=1e-11)


def test_forces_are_weighted_by_the_parabola_through_start_middle_and_end():
    """The three weights are those of Simpson's rule with the exact transition between."""
    m = step_matrices(A, B, G, STEP)
    first = integral(G, lambda x: (1 - x) * (1 - 2 * x), STEP)
    middle = integral(G, lambda x: 2 * x * (1 - x), STEP)  # two evaluations share the middle
    last = integral(G, lambda x: x * (2 * x - 1), STEP)
    size = abs(middle).max()
    for found, expected in ((m.first, first), (m.middle, middle), (m.last, last)):
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-10 * size)


def test_a_test_rig_has_no_states():
    m = step_matrices(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((0, 1)), STEP)
    assert (m.full.shape, m.full_now.shape, m.first.shape) == ((0, 0), (0, 2), (0, 1))
