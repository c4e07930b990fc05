"""The thesis's analysis inequalities, handed to a solver in a basis that suits it."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from robustpolish.analysis.norms.modal_basis import ModalModel

Equation = Literal["10.15", "10.17", "10.44", "10.45"]


@dataclass(frozen=True, eq=False)
class Answer:
    """What the solver says: K in the coordinates of the system, gamma and the status."""

    K: NDArray[np.float64] | None
    gamma: float
    status: str


def minimise(model: ModalModel, equation: Equation) -> Answer:
    """Find the smallest gamma for which the inequality has a solution."""
    import cvxpy as cp  # late: importing takes a second, and only these checks need it

    bound: Any = cp.Variable(nonneg=True)
    K, constraints = _constraints(model, equation, bound, cp.Constant(0.0))
    answer, status = _solved(cp.Problem(cp.Minimize(bound), constraints), K, model)
    gamma = math.nan if answer is None else _gamma(equation, float(bound.value))
    return Answer(answer, gamma, status)


def well_inside(model: ModalModel, equation: Equation, gamma: float) -> Answer:
    """Find K that satisfies the inequality for a given gamma with the largest margin."""
    import cvxpy as cp  # late, as above

    bound = cp.Constant(gamma**2 if equation in ("10.17", "10.44") else gamma)
    margin: Any = cp.Variable()
    K, constraints = _constraints(model, equation, bound, margin)
    constraints.append(margin <= 1)
    answer, status = _solved(cp.Problem(cp.Maximize(margin), constraints), K, model)
    return Answer(answer, gamma, status)


def _gamma(equation: Equation, bound: float) -> float:
    return math.sqrt(max(bound, 0.0)) if equation in ("10.17", "10.44") else bound


def _constraints(
    model: ModalModel, equation: Equation, bound: Any, margin: Any
) -> tuple[Any, list]:
    """Return K and the constraints, the state rows weighted so that all modes count alike."""
    import cvxpy as cp  # late, as above

    A, B, C, D = model.A, model.B, model.C, model.D
    n, m, p = A.shape[0], B.shape[1], C.shape[0]
    E = np.diag(model.weights)
    K: Any = cp.Variable((n, n), symmetric=True)
    rows, KB, Ct = E @ (A.T @ K + K @ A) @ E, E @ K @ B, E @ C.T
    constraints: list[Any] = []
    if equation == "10.15":
        inequality = rows
        constraints.append(K << np.eye(n))
    elif equation == "10.17":
        inequality = cp.bmat(
            [[rows, KB, Ct], [KB.T, -bound * np.eye(m), D.T], [Ct.T, D, -np.eye(p)]]
        )
    elif equation == "10.44":
        corner = KB + Ct @ D
        inequality = cp.bmat([[rows + Ct @ Ct.T, corner], [corner.T, D.T @ D - bound * np.eye(m)]])
    else:
        Z: Any = cp.Variable((p, p), symmetric=True)
        inequality = cp.bmat([[rows, KB], [KB.T, -bound * np.eye(m)]])
        constraints += [cp.bmat([[K, C.T], [C, Z]]) >> 0, cp.trace(Z) <= bound - margin * 1e-3]
    size = inequality.shape[0]
    constraints += [(inequality + inequality.T) / 2 + margin * np.eye(size) << 0, K >> 0]
    return K, constraints


def _solved(problem: Any, K: Any, model: ModalModel) -> tuple[NDArray[np.float64] | None, str]:
    import cvxpy as cp  # late, as above

    status = ""
    for decompose in (False, True):  # another path to the optimum, where one breaks off
        try:
            with warnings.catch_warnings():  # an inaccurate answer is checked like any other
                warnings.simplefilter("ignore")
                problem.solve(solver=cp.CLARABEL, chordal_decomposition_enable=decompose)
        except cp.SolverError as error:
            status = f"solver failed: {error}"
            continue
        if K.value is not None and np.isfinite(K.value).all():
            return model.back(np.asarray(K.value)), str(problem.status)
        status = str(problem.status)
    return None, status
