"""Discrete time to continuous time and back by z = (1 + s)/(1 - s), which keeps the norm."""

from __future__ import annotations

import numpy as np

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.problem.matrices import Controller, shift

_WORST_CONDITION = 1e7
_TRIALS = 6


def to_continuous(
    plant: GeneralizedPlant, state: Matrix, gain: Matrix
) -> tuple[GeneralizedPlant, Matrix]:
    """Map a discrete-time plant to a continuous one with the same H-infinity problem.

    An eigenvalue at z = -1 has no image. A small random static controller moves it
    first; :func:`to_discrete` adds it to the controller that is found.

    Parameters
    ----------
    plant : GeneralizedPlant
        Discrete.
    state, gain : ndarray, shapes (nx,) and (nu, ny)
        Units of the states and of a static controller's entries.

    Returns
    -------
    plant : GeneralizedPlant
        Continuous; the static controller, if any, is closed around it, and its D22 is that
        of the loop.
    feedback : ndarray, shape (nu, ny)
        That static controller, zero as a rule; it acts on y - D22 u.
    """
    rng = np.random.default_rng(0)
    feedback = np.zeros((plant.nu, plant.ny))
    # The plant without D22 is mapped: the controller's way back accounts for it.
    A, B = plant.A, np.hstack([plant.B1, plant.B2])
    C = np.vstack([plant.C1, plant.C2])
    D = np.block([[plant.D11, plant.D12], [plant.D21, np.zeros_like(plant.D22)]])
    best = (np.inf, A, B, C, D, feedback)
    for trial in range(_TRIALS):
        F = 0.3 * gain * rng.standard_normal(gain.shape) if trial else feedback
        Af = A + plant.B2 @ F @ plant.C2
        moved = (np.eye(plant.nx) + Af) * state / state[:, None]
        condition = np.linalg.cond(moved) if plant.nx else 1.0
        if condition < best[0]:
            Bf, Cf, Df = B.copy(), C.copy(), D.copy()
            Bf[:, : plant.nw] += plant.B2 @ F @ plant.D21
            Cf[: plant.nz] += plant.D12 @ F @ plant.C2
            Df[: plant.nz, : plant.nw] += plant.D12 @ F @ plant.D21
            best = (condition, Af, Bf, Cf, Df, F)
        if best[0] < _WORST_CONDITION:
            break
    _, A, B, C, D, feedback = best
    n = plant.nx
    inverse = np.linalg.inv(A + np.eye(n))
    root = np.sqrt(2)
    Ac, Bc, Cc = inverse @ (A - np.eye(n)), root * inverse @ B, root * C @ inverse
    Dc = D - C @ inverse @ B
    nw, nz = plant.nw, plant.nz
    image = GeneralizedPlant.from_matrices(
        Ac,
        Bc[:, :nw],
        Bc[:, nw:],
        Cc[:nz],
        Cc[nz:],
        Dc[:nz, :nw],
        Dc[:nz, nw:],
        Dc[nz:, :nw],
        Dc[nz:, nw:],
    )
    return image, feedback


def to_discrete(K: Controller, feedback: Matrix, D22: Matrix) -> Controller | None:
    """Map a controller back, add the static one and account for the discrete plant's D22."""
    n = len(K.A)
    gap = np.eye(n) - K.A
    if n and np.linalg.cond(gap) > 1e12:
        return None
    inverse = np.linalg.inv(gap)
    root = np.sqrt(2)
    mapped = Controller(
        (np.eye(n) + K.A) @ inverse,
        root * inverse @ K.B,
        root * K.C @ inverse,
        K.D + K.C @ inverse @ K.B + feedback,
    )
    return shift(mapped, D22)
