"""Semidefinite programs through picos: CVXOPT by default. Both are GPL, hence optional."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix

from robustpolish.base.budget import Budget
from robustpolish.base.checks import one_of
from robustpolish.errors import MissingDependencyError
from robustpolish.synthesis.lmi.program import ConicForm

try:
    import picos
except ImportError as error:
    raise MissingDependencyError(
        "backend: picos is not installed. Install it with `pip install picos cvxopt`, "
        "or choose backend='cvxpy'."
    ) from error


def solve(
    form: ConicForm, solver: str | None, tolerance: float, time_limit: float
) -> tuple[NDArray[np.float64] | None, str]:
    """Solve a conic form; return the variables, or None, and the solver's status."""
    name = (solver or "cvxopt").lower()
    one_of("solver", name, picos.available_solvers())
    x = picos.RealVariable("x", form.objective.size)
    problem = picos.Problem(primals=None, verbosity=0, max_iterations=100)
    for size, G, h in form.psd:
        if not size:
            continue  # nothing is semidefinite
        entries: Any = picos.Constant(csc_matrix(G)) * x + picos.Constant(h)
        problem.add_constraint(entries.reshaped((size, size)) >> 0)
    for G, h in form.nonnegative:
        problem.add_constraint(picos.Constant(csc_matrix(G)) * x + picos.Constant(h) >= 0)
    for G, h in form.zero:
        problem.add_constraint(picos.Constant(csc_matrix(G)) * x + picos.Constant(h) == 0)
    problem.set_objective("min", picos.Constant(form.objective.reshape(1, -1)) * x)
    if math.isfinite(time_limit) and name != "cvxopt":
        problem.options.timelimit = max(1, round(time_limit))
    budget = Budget(seconds=time_limit)
    status = "failed"
    # CVXOPT breaks down, and loses its iterate, where it cannot reach the tolerance; how near to
    # rounding that is differs between processors.
    for eased in (10.0**power * tolerance for power in range(6)):
        for kind in ("abs_prim_fsb", "abs_dual_fsb", "abs_ipm_opt"):
            problem.options[f"{kind}_tol"] = problem.options[f"rel{kind[3:]}_tol"] = eased
        try:
            solution = problem.solve(solver=name)
        except (picos.SolutionFailure, ArithmeticError, ValueError) as error:
            status = f"failed: {error}"
        else:
            if x.value is not None:
                values = np.array(x.value, dtype=float).ravel()
                return values, str(solution.claimedStatus)
            status = str(solution.claimedStatus)
        if budget.late:
            break
    return None, status
