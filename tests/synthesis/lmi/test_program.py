"""Semidefinite programs, the same through every backend, and what is put together for them."""

import numpy as np
import pytest
import scipy.linalg
from small_plants import static_plant

import robustpolish as rp
from robustpolish.base.budget import Budget
from robustpolish.synthesis.lmi.program import (
    BACKENDS,
    ProgramSolver,
    SemidefiniteProgram,
    block_matrix,
    stabilising_gain,
    symmetric_block,
)
from robustpolish.synthesis.problem.matrices import close_static_loop

RNG = np.random.default_rng(0)


def solved(program, backend="cvxpy", solver=None):
    return ProgramSolver(backend, solver, Budget()).solve(program)


def test_affine_arithmetic_follows_numpy():
    program = SemidefiniteProgram()
    Y, M = program.symmetric(3), program.matrix(2, 3)
    x = RNG.normal(size=6 + 6)
    y, m = Y.at(x), M.at(x)
    np.testing.assert_allclose(y, y.T)
    A, B = RNG.normal(size=(3, 3)), RNG.normal(size=(3, 2))
    expression = A @ Y + B @ M - 2 * Y.T @ A / 4 + A
    np.testing.assert_allclose(expression.at(x), A @ y + B @ m - 2 * y @ A / 4 + A)
    np.testing.assert_allclose((1.0 * A - Y).at(x), A - y)
    np.testing.assert_allclose(M.T.at(x), m.T)
    np.testing.assert_allclose(Y.trace.at(x), [[np.trace(y)]])
    stacked = block_matrix([[Y, None], [M, np.eye(2)]]).at(x)
    np.testing.assert_allclose(stacked, np.block([[y, np.zeros((3, 2))], [m, np.eye(2)]]))


def test_symmetric_blocks_and_those_left_out():
    program = SemidefiniteProgram()
    t, M = program.scalar(), program.matrix(2, 1)
    x = RNG.normal(size=3)
    block = symmetric_block([[t.times(np.eye(2)), M], [np.eye(1)]]).at(x)
    expected = np.block([[x[0] * np.eye(2), M.at(x)], [M.at(x).T, np.eye(1)]])
    np.testing.assert_allclose(block, expected)
    whole = symmetric_block([[np.eye(1), None, [[2.0, 3.0]]], [[[4.0]], None], [np.eye(2)]])
    upper = [[1, 0, 2, 3], [0, 4, 0, 0], [2, 0, 1, 0], [3, 0, 0, 1]]
    np.testing.assert_array_equal(whole.at(np.zeros(0)), upper)
    with pytest.raises(ValueError, match="a diagonal block is missing"):
        symmetric_block([[None, np.eye(1)], [np.eye(1)]])


@pytest.mark.parametrize("backend", BACKENDS)
def test_programs_with_known_answers(backend):
    # A'P + PA + Q <= 0 with the smallest trace is the Lyapunov equation.
    A = RNG.normal(size=(4, 4)) - 4 * np.eye(4)
    program = SemidefiniteProgram()
    P = program.symmetric(4)
    program.positive(-(A.T @ P + P @ A + np.eye(4)))
    program.minimise(P.trace)
    expected = scipy.linalg.solve_continuous_lyapunov(A.T, -np.eye(4))
    np.testing.assert_allclose(solved(program, backend).value(P), expected, atol=1e-6)
    program = SemidefiniteProgram()
    x = program.matrix(2, 1)
    program.nonnegative(x - [[1.0], [2.0]])
    program.zero(np.array([[1.0, -1.0]]) @ x + [[3.0]])
    program.positive(symmetric_block([[np.eye(1)]]) + 0.0 * x.T @ [[1.0], [0.0]])
    program.minimise(np.array([[1.0, 1.0]]) @ x)
    np.testing.assert_allclose(solved(program, backend).value(x), [[1.0], [4.0]], atol=1e-6)


def least_positive():
    program = SemidefiniteProgram()
    t = program.scalar()
    program.positive(symmetric_block([[t]]))
    program.minimise(t)
    return program, t


@pytest.mark.parametrize("backend", BACKENDS)
def test_infeasible_programs_and_spent_work_give_no_exception(backend):
    program, t = least_positive()
    program.nonnegative(-1.0 * t - [[1.0]])
    assert "optimal" not in solved(program, backend).status.replace("inaccurate", "")
    spent = ProgramSolver(backend, None, Budget(0.0)).solve(program)
    assert (spent.x, spent.status) == (None, "no work left")
    assert np.isnan(spent.value(t)).all()


def test_unknown_backend_and_solver():
    program, _ = least_positive()
    with pytest.raises(rp.InvalidInputError, match=r"^backend: got 'matlab'"):
        solved(program, "matlab")
    with pytest.raises(rp.InvalidInputError, match=r"^solver: got"):
        solved(program, solver="NONE")


SOLVER = ProgramSolver("cvxpy", None, Budget(), accuracy=1e-7)


@pytest.mark.parametrize("discrete", [False, True])
def test_cone_complementarity_finds_a_stabilising_gain(discrete):
    rng = np.random.default_rng(5)
    for _ in range(3):
        A = rng.normal(size=(4, 4))
        if discrete:
            A /= 0.8 * np.abs(np.linalg.eigvals(A)).max()
        plant = static_plant(A, rng.normal(size=(4, 2)), rng.normal(size=(3, 4)), discrete)
        K = stabilising_gain(plant, np.ones((2, 3), bool), SOLVER)
        assert close_static_loop(plant, K).stable


def test_it_respects_a_pattern():
    plant = static_plant(np.diag([0.5, 0.3]), np.eye(2), [[1.0, 0.2], [0.1, 1.0]])
    mask = np.eye(2, dtype=bool)
    K = stabilising_gain(plant, mask, SOLVER)
    assert (K[~mask] == 0).all()
    assert close_static_loop(plant, K).stable
