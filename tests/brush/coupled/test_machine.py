"""The machine as contact sees it: rest, stiffness, and steps that are exact."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from robustpolish.errors import InvalidInputError
from robustpolish.polishing.coupled import LinearMachine

MASS, STIFF, DAMP = 0.2, np.array([1e5, 2e5, 4e6]), 30.0


def springs(steady=(0.0, 0.0, 0.0)):
    A, B, C = np.zeros((6, 6)), np.zeros((6, 3)), np.zeros((3, 6))
    for i, k in enumerate(STIFF):
        A[2 * i, 2 * i + 1] = 1.0
        A[2 * i + 1, 2 * i : 2 * i + 2] = -k / MASS, -DAMP / MASS
        B[2 * i + 1, i], C[i, 2 * i] = 1 / MASS, 1.0
    return LinearMachine(A, B, B @ steady, C)


def test_rest_and_stiffness():
    machine = springs((0.0, 0.0, -10.0))
    np.testing.assert_allclose(machine.stiffness, STIFF, rtol=1e-9)
    rest = machine.rest(np.array([3.0, 0.0, 10.0]))
    np.testing.assert_allclose(machine.C @ rest, [3.0 / STIFF[0], 0.0, 0.0], atol=1e-18)


def test_a_step_is_exact_for_forces_that_are_cubic_in_time():
    """Of order four: phi functions against an integration, at half a period per step."""
    machine, step = springs((0.0, 0.0, -10.0)), 2e-4
    half, whole, gains = machine.step_matrices(step)

    def force(t):
        s = t / step
        return np.array([1.0 + s, 2.0 - s, 5.0 * s])

    x0 = np.arange(1.0, 7.0) * 1e-6

    def slope(t, x):
        return machine.A @ x + machine.B @ force(t) + machine.g

    reference = solve_ivp(slope, (0, step), x0, rtol=1e-12, atol=1e-15, method="DOP853").y[:, -1]
    push = [np.append(force(t), 1.0) for t in (0.0, 0.5 * step, 0.5 * step, step)]
    found = whole @ x0 + gains[1] @ push[0] + gains[2] @ (2 * (push[1] + push[2]))
    found += gains[3] @ push[3]
    np.testing.assert_allclose(found, reference, rtol=1e-9, atol=1e-13)
    middle = solve_ivp(
        lambda t, x: machine.A @ x + machine.B @ force(0.0) + machine.g,
        (0, step / 2), x0, rtol=1e-12, atol=1e-15, method="DOP853",
    ).y[:, -1]  # fmt: skip
    np.testing.assert_allclose(half @ x0 + gains[0] @ push[0], middle, rtol=1e-9, atol=1e-13)


def test_what_drifts_or_has_no_mass_is_refused():
    loose = springs()
    A = loose.A.copy()
    A[1, 0] = 0.0
    with pytest.raises(InvalidInputError, match="pole at zero"):
        LinearMachine(A, loose.B, loose.g, loose.C).rest(np.ones(3))
    with pytest.raises(InvalidInputError, match="with a mass"):
        LinearMachine(-np.eye(3), np.eye(3), np.zeros(3), np.eye(3))
