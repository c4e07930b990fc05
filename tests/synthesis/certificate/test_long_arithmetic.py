"""Peaks too narrow for doubles, and the matrix that proves a norm below one."""

import control
import numpy as np
import pytest

from robustpolish.linear.arithmetic import balls
from robustpolish.synthesis.proofs.bounded_real import (
    BITS,
    enclose_system,
    precise_peak,
    precise_riccati_solution,
)


def loop_of(A, B, C, D=None):
    C, B = np.atleast_2d(C), np.atleast_2d(B)
    D = np.zeros((len(C), B.shape[1])) if D is None else D
    return enclose_system(control.StateSpace(A, B, C, D))


@pytest.mark.parametrize("damping", [0.3, 1e-6, 1e-13])
def test_the_peak_of_a_resonance_far_from_the_start(damping):
    loop = loop_of([[0.0, 1.0], [-1.0, -2 * damping]], [[0.0], [1.0]], [[1.0, 0.0]])
    gain, frequency = precise_peak(loop, 0.9)
    assert gain == pytest.approx(1 / (2 * damping * np.sqrt(1 - damping**2)), rel=2e-5)
    assert frequency == pytest.approx(np.sqrt(1 - 2 * damping**2), rel=1e-2)


def test_a_peak_at_infinite_frequency():
    # (3 s + 1)/(s + 1)
    loop = loop_of([[-1.0]], [[1.0]], [[-2.0]], [[3.0]])
    assert precise_peak(loop, 1.0) == (pytest.approx(3.0), np.inf)


def test_the_candidate_is_the_stabilising_solution():
    rng = np.random.default_rng(2)
    A = rng.standard_normal((4, 4)) - 4 * np.eye(4)
    B, C = rng.standard_normal((4, 2)), rng.standard_normal((3, 4))
    C /= 1.25 * np.linalg.norm(control.StateSpace(A, B, C, 0)(0j), 2)
    with balls.precision(BITS):
        found = precise_riccati_solution(loop_of(A, B, C))
        assert found is not None
        X = balls.midpoint(found)
    assert pytest.approx(np.zeros((4, 4)), abs=1e-12) == A.T @ X + X @ A + X @ B @ B.T @ X + C.T @ C
    assert np.linalg.eigvals(A + B @ B.T @ X).real.max() < 0
    assert np.linalg.eigvalsh(X)[0] > 0


@pytest.mark.parametrize(("pole", "gain"), [(-1.0, 1.5), (0.0, 0.1)])
def test_nothing_proves_a_norm_above_one_or_an_integrator(pole, gain):
    with balls.precision(BITS):
        assert precise_riccati_solution(loop_of([[pole]], [[1.0]], [[gain]])) is None
