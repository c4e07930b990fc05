"""A controller of fewer states, by balanced truncation of its normalised coprime factors."""

from __future__ import annotations

import control
import numpy as np

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.errors import SolverError
from robustpolish.synthesis.loop_shaping.coprime import cayley_back, coprime, loop_plant
from robustpolish.synthesis.problem.matrices import SystemMatrices
from robustpolish.synthesis.riccati.equations import solve_lyapunov


def reduced(K: control.StateSpace, order: int) -> SystemMatrices:
    """Return a controller near to another in the gap metric, with fewer states.

    Its right factors [N; M] are stable whatever the controller is; they are balanced and truncated,
    which moves them by at most twice the sum of the Hankel singular values that are left out.
    McFarlane, Glover, "Robust Controller Design Using Normalized Coprime Factor Plant
    Descriptions", 1990, chapter 5.

    Parameters
    ----------
    K : control.StateSpace
        Continuous or discrete.
    order : int
        At most that of the controller.

    Returns
    -------
    SystemMatrices
        What becomes of the loop has to be certified anew.

    Raises
    ------
    SolverError
        If the factors could not be computed or truncated.
    """
    A, B, C, D = coprime(loop_plant("controller", K)).right()
    reach, seen = solve_lyapunov(A.T, B @ B.T), solve_lyapunov(A, C.T @ C)
    if reach is None or seen is None:
        raise SolverError("The controller's coprime factors could not be balanced; reduce less.")
    into, out = _root(reach), _root(seen)
    U, sizes, Vh = np.linalg.svd(out.T @ into)
    if order and sizes[order - 1] <= np.finfo(float).eps * len(A) * sizes[0]:
        raise SolverError(f"The controller has fewer than {order} states that matter.")
    scale = 1 / np.sqrt(sizes[:order])
    left, right = (out @ U[:, :order] * scale).T, into @ Vh[:order].T * scale
    A, B, C = left @ A @ right, left @ B, C @ right
    p = K.noutputs or 0
    # u = N M^-1 y: M v = y gives v, which drives N.
    inner = np.linalg.inv(D[p:])
    found = SystemMatrices(
        A - B @ inner @ C[p:], B @ inner, C[:p] - D[:p] @ inner @ C[p:], D[:p] @ inner
    )
    return cayley_back(found) if K.isdtime(strict=True) else found


def _root(X: Matrix) -> Matrix:
    """Return R with R R' = X for a positive semidefinite X."""
    values, vectors = np.linalg.eigh(X)
    return vectors * np.sqrt(np.maximum(values, 0.0))
