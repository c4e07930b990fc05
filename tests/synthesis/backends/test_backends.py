"""Conic forms through cvxpy and picos: whatever the solver, no exception but for wrong names."""

import sys

import numpy as np
import pytest
from scipy.sparse import csr_array

import robustpolish as rp
from robustpolish.base.budget import Budget
from robustpolish.synthesis.backends import cvxpy_backend
from robustpolish.synthesis.lmi.program import ConicForm, ProgramSolver, SemidefiniteProgram

picos_backend = pytest.importorskip("robustpolish.synthesis.backends.picos_backend")

# The stacked columns of [[x0, x1], [x1, x0]].
PSD = ((2, csr_array(np.array([[1.0, 0, 0], [0, 1, 0], [0, 1, 0], [1, 0, 0]])), np.zeros(4)),)
LEAST = np.array([1.0, 0.0, 0.0])
# Least x0 with [[x0, x1], [x1, x0]] >= 0, x1 >= 2 and x1 + x2 = 1: x = (2, 2, -1).
FORM = ConicForm(
    LEAST,
    PSD,
    nonnegative=((csr_array([[0.0, 1.0, 0.0]]), np.array([-2.0])),),
    zero=((csr_array([[0.0, 1.0, 1.0]]), np.array([-1.0])),),
)
# The same matrix is to be positive, and x0 at most -1.
CONTRADICTION = ConicForm(LEAST, PSD, ((csr_array([[-1.0, 0.0, 0.0]]), np.array([-1.0])),))


@pytest.mark.parametrize(
    ("backend", "solver", "tolerance"),
    [
        (cvxpy_backend, None, 1e-7),
        (cvxpy_backend, "scs", 1e-7),
        (cvxpy_backend, "CVXOPT", 1e-7),
        (picos_backend, None, 1e-9),
        # Below 1e-15 CVXOPT divides by zero, and the tolerance is eased.
        (picos_backend, None, 3e-17),
    ],
)
def test_every_solver_keeps_all_three_kinds_of_constraints(backend, solver, tolerance):
    x, status = backend.solve(FORM, solver, tolerance, np.inf)
    assert x == pytest.approx([2.0, 2.0, -1.0], abs=1e-4)
    assert status == "optimal"


def test_the_tolerance_reaches_the_solver():
    coarse, fine = (cvxpy_backend.solve(FORM, None, tol, np.inf)[0] for tol in (0.1, 1e-9))
    assert fine == pytest.approx([2.0, 2.0, -1.0], abs=1e-7)
    assert abs(coarse[0] - 2.0) > 1e-4


def test_a_contradiction_is_told_by_the_status():
    assert cvxpy_backend.solve(CONTRADICTION, None, 1e-9, 5.0) == (None, "infeasible")
    # CVXOPT gives up with an exception of cvxpy.
    x, status = cvxpy_backend.solve(CONTRADICTION, "cvxopt", 1e-9, np.inf)
    assert x is None
    assert status.startswith("failed: ")
    x, status = picos_backend.solve(CONTRADICTION, "CVXOPT", 1e-9, 5.0)
    assert x is None
    assert status != "optimal"


@pytest.mark.parametrize(
    ("backend", "solver", "told"),
    [
        (cvxpy_backend, "sedumi", r"^solver: got 'SEDUMI'.*CLARABEL"),
        (picos_backend, "MOSEK9", r"^solver: got 'mosek9'.*cvxopt"),
    ],
)
def test_a_solver_that_is_not_there_is_named(backend, solver, told):
    with pytest.raises(rp.InvalidInputError, match=told):
        backend.solve(FORM, solver, 1e-9, np.inf)


@pytest.mark.parametrize(("name", "packages"), [("cvxpy", "cvxpy clarabel"), ("picos", "picos")])
def test_a_missing_backend_says_what_to_install(name, packages, monkeypatch):
    monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.delitem(sys.modules, f"robustpolish.synthesis.backends.{name}_backend", False)
    program = SemidefiniteProgram()
    t = program.scalar()
    program.positive(t)
    program.minimise(t)
    with pytest.raises(rp.errors.MissingDependencyError, match=f"pip install {packages}"):
        ProgramSolver(name, None, Budget()).solve(program)
