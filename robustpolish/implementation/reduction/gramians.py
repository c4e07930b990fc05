"""Gramians of a controller by itself, of its coprime factors, and inside its closed loop."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy import linalg

from robustpolish.arrays import Matrix
from robustpolish.models import GeneralizedPlant


class Weighted(NamedTuple):
    """A system to be reduced, with the Gramians that say which of its states matter.

    ``matrices`` : A, B, C, D; ``reach``, ``see`` : Gramians; ``back`` : how a reduced one becomes a
    controller, "" for as it is, "left" or "right" for a coprime factor.
    """

    name: str
    matrices: tuple[Matrix, Matrix, Matrix, Matrix]
    reach: Matrix
    see: Matrix
    back: str = ""


def stable(A: Matrix, discrete: bool) -> bool:
    """Tell whether all eigenvalues, as doubles see them, are stable."""
    if not A.size:
        return True
    values: Any = np.linalg.eigvals(A)
    return bool(np.abs(values).max() < 1 if discrete else values.real.max() < 0)


def gramian(A: Matrix, B: Matrix, discrete: bool) -> Matrix:
    """Return the controllability Gramian of a stable system."""
    source = B @ B.T
    if discrete:
        found: Any = linalg.solve_discrete_lyapunov(A, source)
    else:
        found = linalg.solve_continuous_lyapunov(A, -source)
    return np.asarray((found + found.T) / 2, dtype=float)


def alone(K: tuple[Matrix, Matrix, Matrix, Matrix], discrete: bool) -> list[Weighted]:
    """Weigh the states of a stable controller by what they pass on from y to u."""
    A, B, C, _ = K
    if not stable(A, discrete):
        return []
    return [Weighted("balanced", K, gramian(A, B, discrete), gramian(A.T, C.T, discrete))]


def in_loop(
    plant: GeneralizedPlant, K: tuple[Matrix, Matrix, Matrix, Matrix], loop: Matrix
) -> list[Weighted]:
    """Weigh the states of a controller by what they do inside its loop.

    Parameters
    ----------
    plant : GeneralizedPlant
    K : tuple of ndarray
        A, B, C, D of the controller.
    loop : ndarray
        State matrix of the closed loop, the plant's states first.

    Returns
    -------
    list of Weighted
        From w to z, and from disturbances of y and u to y and u: the first keeps the norm, the
        second stability and robustness.

    Notes
    -----
    P. M. R. Wortelboer, M. Steinbuch, O. H. Bosgra, "Iterative model and controller reduction
    using closed-loop balancing", Int. J. Robust and Nonlinear Control 9 (1999) 123-142.
    """
    _, B, C, D = K
    n, discrete = plant.nx, plant.is_discrete
    turn = np.linalg.inv(np.eye(plant.nu) - D @ plant.D22)
    back = np.linalg.inv(np.eye(plant.ny) - plant.D22 @ D)
    on_u = np.hstack([turn @ D @ plant.C2, turn @ C])
    on_y = np.hstack([back @ plant.C2, back @ plant.D22 @ C])

    def driven(y: Matrix, u: Matrix) -> Matrix:
        """Return how what is added to y and to u reaches the states."""
        of_u = turn @ (u + D @ y)
        of_y = back @ (y + plant.D22 @ u)
        return np.vstack([plant.B2 @ of_u, B @ of_y])

    zero_u, zero_y = np.zeros((plant.nu, plant.ny)), np.zeros((plant.ny, plant.nu))
    w = driven(plant.D21, np.zeros((plant.nu, plant.nw)))
    w[:n] += plant.B1
    noise = np.hstack([driven(np.eye(plant.ny), zero_u), driven(zero_y, np.eye(plant.nu))])
    z = plant.D12 @ on_u
    z[:, :n] += plant.C1
    pairs = {"closed-loop": (w, z), "robustness": (noise, np.vstack([on_y, on_u]))}
    found = []
    for name, (into, out) in pairs.items():
        reach = gramian(loop, into, discrete)[n:, n:]
        see = gramian(loop.T, out.T, discrete)[n:, n:]
        found.append(Weighted(name, K, reach, see))
    return found


def coprime(K: tuple[Matrix, Matrix, Matrix, Matrix], discrete: bool) -> list[Weighted]:
    """Weigh the states of normalised coprime factors, which are stable whatever the controller.

    Notes
    -----
    D. C. McFarlane, K. Glover, Robust Controller Design Using Normalized Coprime Factor Plant
    Descriptions, Springer 1990, chapter 5.
    """
    if discrete:
        return []
    A, B, C, D = K
    found = []
    left = _left_factor(A, B, C, D)
    if left is not None:
        found.append(_factor("left coprime", left, "left"))
    right = _left_factor(A.T, C.T, B.T, D.T)
    if right is not None:
        turned = (right[0].T, right[2].T, right[1].T, right[3].T)
        found.append(_factor("right coprime", turned, "right"))
    return [weighted for weighted in found if weighted is not None]


def _left_factor(
    A: Matrix, B: Matrix, C: Matrix, D: Matrix
) -> tuple[Matrix, Matrix, Matrix, Matrix] | None:
    """Return [N M] with K = inv(M) N and N N~ + M M~ = 1."""
    R = np.eye(len(D)) + D @ D.T
    try:
        X = linalg.solve_continuous_are(A.T, C.T, B @ B.T, R, s=B @ D.T)
    except (np.linalg.LinAlgError, ValueError):
        return None
    L = -np.linalg.solve(R, (X @ C.T + B @ D.T).T).T
    values, vectors = np.linalg.eigh(R)
    root = vectors / np.sqrt(values) @ vectors.T
    return (
        A + L @ C,
        np.hstack([B + L @ D, L]),
        root @ C,
        root @ np.hstack([D, np.eye(len(D))]),
    )


def _factor(
    name: str, matrices: tuple[Matrix, Matrix, Matrix, Matrix], back: str
) -> Weighted | None:
    A, B, C, _ = matrices
    if not stable(A, False):
        return None
    return Weighted(name, matrices, gramian(A, B, False), gramian(A.T, C.T, False), back)


def from_factor(
    matrices: tuple[Matrix, Matrix, Matrix, Matrix], back: str, inputs: int, outputs: int
) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    """Return the controller that coprime factors stand for."""
    A, B, C, D = matrices
    if back == "left":
        over = np.linalg.inv(D[:, inputs:])
        own = B[:, inputs:] @ over
        return (
            A - own @ C,
            B[:, :inputs] - own @ D[:, :inputs],
            over @ C,
            over @ D[:, :inputs],
        )
    over = np.linalg.inv(D[outputs:])
    own = over @ C[outputs:]
    return (
        A - B @ own,
        B @ over,
        C[:outputs] - D[:outputs] @ own,
        D[:outputs] @ over,
    )
