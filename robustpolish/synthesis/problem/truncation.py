"""Leave out the states of a large plant that nothing sees or reaches, before a search."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy import linalg

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.synthesis.problem.matrices import PlantMatrices


@dataclass(frozen=True)
class TruncationPolicy:
    """When it is worth it.

    Attributes
    ----------
    share : float
        The Hankel bound that is allowed, over the largest singular value. Gains multiply it: with
        1e-6 and gains of 3e3 a chain of 150 masses has a norm of 110, where 96 was seen.
    worth : float
        Share of the states that may be left at most: half of them take an eighth of the time, so
        that little is lost where the whole plant has to be searched after all.
    slowest : float
        What decays less, over the largest entry of A, is kept as what is unstable: rounding makes
        poles of this size of double ones at zero, on both sides of the axis.
    """

    share: float = 1e-8
    worth: float = 0.5
    slowest: float = 1e-6


_POLICY = TruncationPolicy()


class Truncated(NamedTuple):
    """A plant of fewer states, and how far its response from w, u to z, y is from the whole's."""

    plant: PlantMatrices
    error: float


def truncated(plant: PlantMatrices) -> Truncated | None:
    """Truncate the stable part of a plant in balanced states.

    Parameters
    ----------
    plant : PlantMatrices
        Continuous, scaled, with states.

    Returns
    -------
    Truncated or None
        None where most states count, or doubles cannot tell. The error is twice the sum of the
        Hankel singular values that are left out, which bounds the H-infinity norm of the
        difference.

    Notes
    -----
    K. Glover, "All optimal Hankel-norm approximations of linear multivariable systems and their
    L-infinity error bounds", Int. J. Control 39 (1984) 1115-1193.
    """
    try:
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of equations that are nearly singular
            into, back, stable = _split(plant.A)
            P = plant.in_states(into, back)
            A, B = P.A[:stable, :stable], np.hstack([P.B1, P.B2])[:stable]
            T, Ti, values = _balancing(A, B, np.vstack([P.C1, P.C2])[:, :stable])
    except (linalg.LinAlgError, ValueError):
        return None
    left_out = 2 * np.cumsum(values[::-1])[::-1]
    rest = plant.nx - stable
    kept = int(np.count_nonzero(~(left_out <= _POLICY.share * values.max(initial=0.0))))
    if kept + rest > _POLICY.worth * plant.nx or not 0 < kept < stable:
        return None
    others: Any = np.eye(rest)
    into, back = linalg.block_diag(Ti[:kept], others), linalg.block_diag(T[:, :kept], others)
    return Truncated(P.in_states(np.asarray(into), np.asarray(back)), float(left_out[kept]))


def _split(A: Matrix) -> tuple[Matrix, Matrix, int]:
    """Return coordinates, and back, in which the stable states stand first, alone."""
    least = _POLICY.slowest * float(np.abs(A).max())
    T, Z, count = linalg.schur(A, output="real", sort=lambda re, im: re < -least)  # type: ignore[misc]
    n, turn = len(A), np.eye(len(A))
    if 0 < count < n:
        turn[:count, count:] = linalg.solve_sylvester(
            T[:count, :count], -T[count:, count:], -T[:count, count:]
        )
    back = Z @ turn
    turn[:count, count:] *= -1
    return turn @ Z.T, back, count


def _balancing(A: Matrix, B: Matrix, C: Matrix) -> tuple[Matrix, Matrix, Matrix]:
    """Return balanced states of a stable system, and its Hankel singular values."""
    reach = _root(linalg.solve_continuous_lyapunov(A, -B @ B.T))
    see = _root(linalg.solve_continuous_lyapunov(A.T, -C.T @ C))
    U, values, Vt = np.linalg.svd(see.T @ reach)
    size = np.sqrt(values)  # where it is zero, states are left out
    return reach @ Vt.T / size, (see @ U / size).T, values


def _root(gramian: Any) -> Matrix:
    values, vectors = np.linalg.eigh((gramian + gramian.T) / 2)
    return vectors * np.sqrt(np.maximum(values, 0.0))
