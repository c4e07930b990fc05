"""Conic forms through picos: CVXOPT, with a tolerance that it can reach."""

import sys

import pytest

import robustpolish as rp
from robustpolish.synthesis.lmi.program import SemidefiniteProgram

picos = pytest.importorskip("robustpolish.synthesis.backends.picos_backend")


# Below 1e-15 CVXOPT divides by zero, and the tolerance is eased.
@pytest.mark.parametrize("tolerance", [1e-9, 3e-17])
def test_it_keeps_all_three_kinds_of_constraints(form, tolerance):
    x, status = picos.solve(form, None, tolerance, None)
    assert x == pytest.approx([2.0, 2.0, -1.0], abs=1e-6)
    assert status == "optimal"


def test_a_contradiction_gives_no_optimum(contradiction):
    x, status = picos.solve(contradiction, "CVXOPT", 1e-9, 5.0)
    assert x is None
    assert status != "optimal"


def test_a_solver_that_is_not_there_is_named(form):
    with pytest.raises(rp.InvalidInputError, match=r"^solver: got 'mosek9'.*cvxopt"):
        picos.solve(form, "MOSEK9", 1e-9, None)


def test_missing_picos_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "picos", None)
    monkeypatch.delitem(sys.modules, "robustpolish.synthesis.backends.picos_backend", False)
    program = SemidefiniteProgram()
    t = program.scalar()
    program.positive(t)
    program.minimise(t)
    with pytest.raises(rp.errors.MissingDependencyError, match="pip install picos"):
        program.solve("picos")
