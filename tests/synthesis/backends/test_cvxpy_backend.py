"""Conic forms through cvxpy: whatever the solver, no exception but for wrong names."""

import sys

import pytest

import robustpolish as rp
from robustpolish.synthesis.backends.cvxpy_backend import solve


@pytest.mark.parametrize("solver", [None, "scs", "CVXOPT"])
def test_every_solver_keeps_all_three_kinds_of_constraints(form, solver):
    x, status = solve(form, solver, 1e-7, None)
    assert x == pytest.approx([2.0, 2.0, -1.0], abs=1e-4)
    assert status == "optimal"


def test_the_tolerance_reaches_the_solver(form):
    (coarse, _), (fine, _) = (solve(form, None, tolerance, None) for tolerance in (0.1, 1e-9))
    assert fine == pytest.approx([2.0, 2.0, -1.0], abs=1e-7)
    assert coarse is not None
    assert abs(coarse[0] - 2.0) > 1e-4


def test_a_contradiction_is_told_by_the_status(contradiction):
    assert solve(contradiction, None, 1e-9, 5.0) == (None, "infeasible")
    # CVXOPT gives up with an exception of cvxpy.
    x, status = solve(contradiction, "cvxopt", 1e-9, None)
    assert x is None
    assert status.startswith("failed: ")


def test_a_solver_that_is_not_there_is_named(form):
    with pytest.raises(rp.InvalidInputError, match=r"^solver: got 'SEDUMI'.*CLARABEL"):
        solve(form, "sedumi", 1e-9, None)


def test_missing_cvxpy_says_what_to_install(form, monkeypatch):
    monkeypatch.setitem(sys.modules, "cvxpy", None)
    with pytest.raises(rp.errors.MissingDependencyError, match="pip install cvxpy clarabel"):
        solve(form, None, 1e-9, None)
