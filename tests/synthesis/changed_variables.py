"""The change of variables of output feedback, in the direction that the package never goes."""

import numpy as np

from robustpolish.synthesis.lmi.output_feedback import LmiValues
from robustpolish.synthesis.problem.matrices import Controller


def drawn(plant, seed):
    """Return a random controller of full order, and X and Y with X > inv(Y) > 0."""
    rng = np.random.default_rng(seed)
    n, nu, ny = plant.nx, plant.nu, plant.ny
    shapes = (n, n), (n, ny), (nu, n), (nu, ny)
    Q = rng.standard_normal((n, n))
    Y = Q @ Q.T + np.eye(n)
    return Controller(*map(rng.standard_normal, shapes)), np.linalg.inv(Y) + np.eye(n), Y


def changed(plant, K, X, Y):
    """Return the changed variables of Scherer, Gahinet and Chilali, and M and N."""
    M = np.eye(len(X)) - X @ Y
    N = np.eye(len(X))
    B, C = plant.B2, plant.C2
    variables = LmiValues(
        X,
        Y,
        N @ K.A @ M.T + N @ K.B @ C @ X + Y @ B @ K.C @ M.T + Y @ (plant.A + B @ K.D @ C) @ X,
        N @ K.B + Y @ B @ K.D,
        K.C @ M.T + K.D @ C @ X,
        K.D,
    )
    return variables, M, N
