"""Plants made regular: what singular problems need before a Riccati equation can be used."""

from __future__ import annotations

import numpy as np

from robustpolish.synthesis.problem.matrices import PlantMatrices


def regularise(plant: PlantMatrices, epsilon: float) -> PlantMatrices:
    """Price u and x, and disturb y and x, a little.

    Appends epsilon times u and x to z, and epsilon times noise on y and x to w. Then D12
    and D21 have full rank and no zeros lie on the imaginary axis, whatever the plant. The norm
    of a loop with the regularised plant bounds the norm with the true one from above.

    Parameters
    ----------
    plant : PlantMatrices
        Scaled, so that epsilon is small compared with the entries.
    epsilon : float
        Zero returns the plant itself.
    """
    if epsilon == 0:
        return plant
    P = plant
    n, nw, nu = P.A.shape[0], P.B1.shape[1], P.B2.shape[1]
    nz, ny = P.C1.shape[0], P.C2.shape[0]
    D11 = np.zeros((nz + n + nu, nw + n + ny))
    D11[:nz, :nw] = P.D11
    return P.replace(
        B1=np.hstack([P.B1, epsilon * np.eye(n), np.zeros((n, ny))]),
        C1=np.vstack([P.C1, epsilon * np.eye(n), np.zeros((nu, n))]),
        D11=D11,
        D12=np.vstack([P.D12, np.zeros((n, nu)), epsilon * np.eye(nu)]),
        D21=np.hstack([P.D21, np.zeros((ny, n)), epsilon * np.eye(ny)]),
    )
