"""States in which the inequalities of output feedback have solutions of order one.

Interior-point methods answer wrongly where R and S span many decades, as they do for weights with
slow and fast poles. The two Riccati equations bound them: R <= gamma inv(X) and S <= gamma inv(Y),
so that states in which X and Y are balanced suit R and S too. What the inequalities say is the
same in all states.
"""

from __future__ import annotations

import numpy as np

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.synthesis.problem.matrices import PlantMatrices


def balanced_states(
    plant: PlantMatrices, X: Matrix, Y: Matrix, gamma: float, least: tuple[float, float]
) -> PlantMatrices | None:
    """Return the plant in states in which X and Y are equal and diagonal, but for small ones.

    Parameters
    ----------
    plant : PlantMatrices
    X, Y : ndarray, shape (n, n)
        Semidefinite solutions of the Riccati equations at `gamma`.
    gamma : float
    least : (float, float)
        Smallest eigenvalue of X with a diagonal of ones that counts, relative, and the smallest one
        of XY over gamma squared: directions that no control moves or no disturbance reaches
        leave X and Y singular.

    Returns
    -------
    PlantMatrices or None
        None where the numbers do not allow it.
    """
    largest = float(np.diag(X).max(initial=0.0))
    if largest <= 0:
        return None
    unit = np.sqrt(np.maximum(np.diag(X), 1e-16 * largest))
    try:
        values, vectors = np.linalg.eigh(X / unit[:, None] / unit)
        values = np.maximum(values, 0) + least[0] * values.max()
        L = unit[:, None] * (vectors * np.sqrt(values))
        M = L.T @ Y @ L
        values, vectors = np.linalg.eigh((M + M.T) / 2)
        root = (np.maximum(values, 0) + least[1] * gamma**2) ** 0.25
        into, back = (vectors / root).T @ L.T, np.linalg.solve(L.T, vectors * root)
    except np.linalg.LinAlgError:
        return None
    return plant.in_states(into, back) if np.isfinite(into).all() else None
