"""Semidefinite programs through cvxpy: Clarabel by default, others by name."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robustpolish.base.checks import one_of
from robustpolish.errors import MissingDependencyError
from robustpolish.synthesis.lmi.program import ConicForm


def solve(
    form: ConicForm, solver: str | None, tolerance: float, time_limit: float
) -> tuple[NDArray[np.float64] | None, str]:
    """Solve a conic form; return the variables, or None, and the solver's status."""
    try:
        import cvxpy as cp
    except ImportError as error:
        raise MissingDependencyError(
            "backend: cvxpy is not installed. Install it with `pip install cvxpy clarabel`."
        ) from error

    name = (solver or "CLARABEL").upper()
    one_of("solver", name, cp.installed_solvers())
    x = cp.Variable(form.objective.size)
    constraints: list[Any] = [
        cp.PSD(cp.reshape(G @ x + h, (size, size), order="F")) for size, G, h in form.psd if size
    ]
    constraints += [G @ x + h >= 0 for G, h in form.nonnegative]
    constraints += [G @ x + h == 0 for G, h in form.zero]
    problem = cp.Problem(cp.Minimize(form.objective @ x), constraints)
    with warnings.catch_warnings():
        # "Solution may be inaccurate": the status says so, and callers verify.
        warnings.simplefilter("ignore")
        try:
            problem.solve(
                solver=name,
                ignore_dpp=True,
                **_options(name, tolerance, time_limit, form.prescaled),
            )
        except cp.SolverError as error:
            return None, f"failed: {error}"
    return (None if x.value is None else np.array(x.value)), str(problem.status)


def _options(name: str, tolerance: float, time_limit: float, prescaled: bool) -> dict[str, Any]:
    # SCS knows no infinite time.
    seconds = min(max(time_limit, 1e-3), 1e9)
    if name == "CLARABEL":
        return {
            **dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), tolerance),
            # Where progress ends, the last iterate is wanted, not an error: callers verify.
            "reduced_tol_gap_abs": 1e-2,
            "reduced_tol_gap_rel": 1e-2,
            "reduced_tol_feas": 1e-3,
            "max_iter": 200,
            "equilibrate_enable": not prescaled,
            # More threads would add up in another order, and give other bits.
            "max_threads": 1,
            "direct_solve_method": "qdldl",
            "time_limit": seconds,
        }
    if name == "SCS":
        accuracy = {"eps_abs": tolerance, "eps_rel": tolerance}
        return {**accuracy, "max_iters": 100_000, "time_limit_secs": seconds}
    known = ("abstol", "reltol", "feastol") if name == "CVXOPT" else ()
    return dict.fromkeys(known, tolerance)
