"""Semidefinite programs, the same through every backend."""

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.synthesis.lmi.program import BACKENDS, SemidefiniteProgram, symmetric_block

RNG = np.random.default_rng(0)


def test_pattern_leaves_entries_out():
    program = SemidefiniteProgram()
    M = program.matrix(2, 2, pattern=[[True, False], [False, True]])
    np.testing.assert_allclose(M.at(np.array([3.0, 4.0])), np.diag([3.0, 4.0]))


@pytest.mark.parametrize("backend", BACKENDS)
def test_lyapunov_matrix_of_least_trace(backend):
    # A'P + PA + Q <= 0 with the smallest trace is the Lyapunov equation.
    import scipy.linalg

    A = RNG.normal(size=(4, 4)) - 4 * np.eye(4)
    program = SemidefiniteProgram()
    P = program.symmetric(4)
    program.positive(-(A.T @ P + P @ A + np.eye(4)))
    program.minimise(P.trace)
    solution = program.solve(backend)
    expected = scipy.linalg.solve_continuous_lyapunov(A.T, -np.eye(4))
    np.testing.assert_allclose(solution.value(P), expected, atol=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
def test_linear_constraints(backend):
    program = SemidefiniteProgram()
    x = program.matrix(2, 1)
    program.nonnegative(x - [[1.0], [2.0]])
    program.zero(np.array([[1.0, -1.0]]) @ x + [[3.0]])
    program.positive(symmetric_block([[np.eye(1)]]) + 0.0 * x.T @ [[1.0], [0.0]])
    program.minimise(np.array([[1.0, 1.0]]) @ x)
    np.testing.assert_allclose(program.solve(backend).value(x), [[1.0], [4.0]], atol=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
def test_infeasible_program_gives_no_exception(backend):
    program = SemidefiniteProgram()
    t = program.scalar()
    program.positive(symmetric_block([[t]]))
    program.nonnegative(-1.0 * t - [[1.0]])
    program.minimise(t)
    solution = program.solve(backend)
    assert "optimal" not in solution.status.replace("inaccurate", "")


def test_unknown_backend_and_solver():
    program = SemidefiniteProgram()
    t = program.scalar()
    program.positive(t)
    program.minimise(t)
    with pytest.raises(rp.InvalidInputError, match=r"^backend: got 'matlab'"):
        program.solve("matlab")
    with pytest.raises(rp.InvalidInputError, match=r"^solver: got"):
        program.solve("cvxpy", solver="NONE")
