"""A controller from R and S of the projected inequalities, by formulas.

Gahinet, "Explicit controller formulas for LMI-based H-infinity synthesis", Automatica 32 (1996)
1007-1014: with R and S given, the inequality in the changed controller variables is solved by
least squares, one half after the other.
"""

from __future__ import annotations

import numpy as np

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.synthesis.lmi.output.inequalities import Variables
from robustpolish.synthesis.lmi.output.reconstruction import reconstruct
from robustpolish.synthesis.problem.matrices import Controller, PlantMatrices
from robustpolish.synthesis.riccati.two_riccati import normalise

# A feedthrough above this share of gamma has to be lowered by that of the controller.
_CLOSE = 0.999
# R S = I would need a controller with a state less; so close to it, it is moved away.
_LEAST = 1 + 1e-9


def explicit_controller(plant: PlantMatrices, gamma: float, sizes: Matrix) -> Controller | None:
    """Return a controller with a norm below gamma.

    Parameters
    ----------
    plant : PlantMatrices
        D12 and D21 of full rank, in states in which R = S = diag(sizes).
    gamma : float
    sizes : ndarray, shape (n,)

    Returns
    -------
    Controller or None
        None where the numbers do not allow it.
    """
    P, nw, nz = plant, plant.nw, plant.nz
    try:
        D = _direct(P, gamma)
        through = P.D11 + P.D12 @ D @ P.D21
        X = np.diag(np.maximum(sizes, _LEAST))
        W = np.linalg.inv(
            np.block([[gamma * np.eye(nw), -through.T], [-through, gamma * np.eye(nz)]])
        )
        price = np.hstack([np.zeros((P.nu, nw)), P.D12.T])
        noise = np.hstack([P.D21, np.zeros((P.ny, nz))])
        A = P.A + P.B2 @ D @ P.C2
        known = np.hstack([P.B1 + P.B2 @ D @ P.D21, (P.C1 @ X).T])
        seen = np.hstack([X @ P.B1, (P.C1 + P.D12 @ D @ P.C2).T])
        C = -np.linalg.solve(price @ W @ price.T, P.B2.T + price @ W @ known.T)
        B = -np.linalg.solve(noise @ W @ noise.T, P.C2 + noise @ W @ seen.T).T
        inner = -(A + (known + C.T @ price) @ W @ (seen + B @ noise).T).T
        return reconstruct(P, Variables(X, X, inner, B, C, D))
    except np.linalg.LinAlgError:
        return None


def _direct(plant: PlantMatrices, gamma: float) -> Matrix:
    """Return the controller's feedthrough: none, unless the norm of D11 asks for some."""
    P = plant
    if not P.D11.size or np.linalg.norm(P.D11, 2) < _CLOSE * gamma:
        return np.zeros((P.nu, P.ny))
    normal = normalise(P)
    D, free, seen = normal.plant.D11, P.nz - P.nu, P.nw - P.ny
    corner = D[:free, :seen]
    left = gamma**2 * np.eye(free) - corner @ corner.T
    centre = -D[free:, :seen] @ corner.T @ np.linalg.solve(left, D[:free, seen:]) - D[free:, seen:]
    return normal.control @ centre @ normal.measurement
