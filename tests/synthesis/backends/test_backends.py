"""Conic forms through cvxpy and picos: whatever the solver, no exception but for wrong names."""

import importlib.util
import pickle
import subprocess
import sys
import time
from pathlib import Path

import control
import numpy as np
import pytest
from published_plants import scherer_1997, zhou_h2
from scipy.sparse import csr_array

import robustpolish as rp
from robustpolish.base.budget import Budget
from robustpolish.synthesis.backends import slycot_backend, slycot_worker
from robustpolish.synthesis.backends.slycot_backend import synthesise
from robustpolish.synthesis.lmi.program import (
    ConicForm,
    ProgramSolver,
    SemidefiniteProgram,
    solve_by_cvxpy,
    solve_by_picos,
)

pytest.importorskip("picos")

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
        (solve_by_cvxpy, None, 1e-7),
        (solve_by_cvxpy, "scs", 1e-7),
        (solve_by_cvxpy, "CVXOPT", 1e-7),
        (solve_by_picos, None, 1e-9),
        # Below 1e-15 CVXOPT divides by zero, and the tolerance is eased.
        (solve_by_picos, None, 3e-17),
    ],
)
def test_every_solver_keeps_all_three_kinds_of_constraints(backend, solver, tolerance):
    x, status = backend(FORM, solver, tolerance, np.inf)
    assert x == pytest.approx([2.0, 2.0, -1.0], abs=1e-4)
    assert status == "optimal"


def test_the_tolerance_reaches_the_solver():
    coarse, fine = (solve_by_cvxpy(FORM, None, tol, np.inf)[0] for tol in (0.1, 1e-9))
    assert fine == pytest.approx([2.0, 2.0, -1.0], abs=1e-7)
    assert abs(coarse[0] - 2.0) > 1e-4


def test_a_contradiction_is_told_by_the_status():
    assert solve_by_cvxpy(CONTRADICTION, None, 1e-9, 5.0) == (None, "infeasible")
    # CVXOPT gives up with an exception of cvxpy.
    x, status = solve_by_cvxpy(CONTRADICTION, "cvxopt", 1e-9, np.inf)
    assert x is None
    assert status.startswith("failed: ")
    x, status = solve_by_picos(CONTRADICTION, "CVXOPT", 1e-9, 5.0)
    assert x is None
    assert status != "optimal"


@pytest.mark.parametrize(
    ("backend", "solver", "told"),
    [
        (solve_by_cvxpy, "sedumi", r"^solver: got 'SEDUMI'.*CLARABEL"),
        (solve_by_picos, "MOSEK9", r"^solver: got 'mosek9'.*cvxopt"),
    ],
)
def test_a_solver_that_is_not_there_is_named(backend, solver, told):
    with pytest.raises(rp.InvalidInputError, match=told):
        backend(FORM, solver, 1e-9, np.inf)


@pytest.mark.parametrize(("name", "packages"), [("cvxpy", "cvxpy clarabel"), ("picos", "picos")])
def test_a_missing_backend_says_what_to_install(name, packages, monkeypatch):
    monkeypatch.setitem(sys.modules, name, None)
    program = SemidefiniteProgram()
    t = program.scalar()
    program.positive(t)
    program.minimise(t)
    with pytest.raises(rp.errors.MissingDependencyError, match=f"pip install {packages}"):
        ProgramSolver(name, None, Budget()).solve(program)


# SLICOT's routines in a process of their own: published optima, and ends in time.


def answer(routine, plant, time_limit=30.0):
    whole = (
        plant.A,
        np.hstack([plant.B1, plant.B2]),
        np.vstack([plant.C1, plant.C2]),
        np.block([[plant.D11, plant.D12], [plant.D21, plant.D22]]),
    )
    return synthesise(routine, (plant.nx, plant.nu, plant.ny), whole, time_limit)


@pytest.mark.parametrize(
    ("routine", "plant", "norm", "optimum"),
    [("SB10AD", scherer_1997(), "hinf", 9.51), ("SB10HD", zhou_h2(), "h2", 8.9582)],
)
def test_published_optima(routine, plant, norm, optimum):
    pytest.importorskip("slycot")
    found = answer(routine, plant)
    assert found.message == ""
    assert found.controller is not None
    assert found.gamma is None if norm == "h2" else found.gamma == pytest.approx(optimum, rel=5e-4)
    loop = rp.certify(plant, control.StateSpace(*found.controller), norm)
    assert loop.achieved == pytest.approx(optimum, rel=5e-4)


def test_a_refusal_and_the_end_of_the_time_are_told():
    pytest.importorskip("slycot")
    quiet = scherer_1997().replace(D21=np.zeros((1, 1)))  # a measurement without noise
    for routine, limit, told in (
        ("SB10HD", 30.0, "SB10HD refused: "),
        ("SB10AD", 1e-3, "SB10AD was ended after 0.001 s"),
        ("SB10AD", 0.0, "no time was left for SB10AD"),
    ):
        start = time.monotonic()
        found = answer(routine, quiet, limit)
        assert time.monotonic() - start < 20  # SB10AD would not end by itself
        assert found.controller is None
        assert found.message.startswith(told)


def test_missing_slycot_says_what_to_install(monkeypatch):
    def found(name, *rest):
        return None if name == "slycot" else importlib.util.find_spec(name, *rest)

    monkeypatch.setattr(slycot_backend, "find_spec", found)
    with pytest.raises(rp.errors.MissingDependencyError, match="pip install slycot"):
        answer("SB10AD", scherer_1997())


# The program that runs one routine: dictionary in, dictionary out, nothing of the package.


def lag(routine):
    """Return x' = -x + w1 + u, z = (x, u), y = x + w2 as a task."""
    return {
        "routine": routine,
        "sizes": (1, 3, 3, 1, 1),
        "matrices": (
            np.array([[-1.0]]),
            np.array([[1.0, 0.0, 1.0]]),
            np.array([[1.0], [0.0], [1.0]]),
            np.array([[0.0, 0, 0], [0, 0, 1], [0, 1, 0]]),
        ),
        "gamma": 1e10,
    }


def test_it_runs_without_the_package(tmp_path):
    pytest.importorskip("slycot")
    # -I leaves out the folder and PYTHONPATH; a copy shows that nothing beside it is needed.
    copy = tmp_path / "worker.py"
    copy.write_text(Path(slycot_worker.__file__).read_text(encoding="utf-8"), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-I", copy],
        input=pickle.dumps(lag("SB10AD")),
        capture_output=True,
        cwd=tmp_path,
        check=True,
    )
    told = pickle.loads(done.stdout)
    # Without control the norm is 1; if y were x, 2 X = 1 + (1/gamma^2 - 1) X^2 would have to
    # have a solution, which ends at 1/sqrt(2).
    assert 1 / np.sqrt(2) < told["gamma"] < 1
