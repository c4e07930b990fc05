"""The rightmost characteristic roots of a system with delays, each with its residual.

What runs through a delay line is a transport along it; Chebyshev polynomials along each line turn
the system into a matrix whose eigenvalues tend to the roots, spectrally fast: Breda, Maset,
Vermiglio, "Pseudospectral differencing methods for characteristic roots of delay differential
equations", SIAM J. Scientific Computing 27 (2005) 482-495, here in the form of lines with ports,
so that delays may also feed each other directly. Newton steps on the characteristic matrix itself
then make each root exact, and its smallest singular value tells whether it is one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from robustpolish.arrays import AnyMatrix, AnyVector, Matrix, Vector

MOST_SIZE = 700
"""Largest matrix whose eigenvalues are computed; several seconds."""


@dataclass(frozen=True)
class RootPolicy:
    """Thresholds of the search for roots.

    Attributes
    ----------
    nodes : int
        Least number of Chebyshev nodes along a line: roots of a few rad per delay come out to
        twelve digits.
    nodes_per_radian : float
        More nodes per radian of delay at the highest frequency where a root can be unstable;
        polynomials need pi per wavelength.
    residual : float
        Smallest over largest singular value of the characteristic matrix at what counts as a root.
    steps : int
        Newton steps; from the eigenvalues three are enough.
    moved : float
        How far, relative to its size and the unit of rate, Newton may move a start.
    """

    nodes: int = 20
    nodes_per_radian: float = 1.5
    residual: float = 1e-9
    steps: int = 12
    moved: float = 0.1


POLICY = RootPolicy()


def rightmost_roots(
    ports: tuple[Matrix, Matrix, Matrix, Matrix],
    seconds: Vector,
    highest: float,
    count: int = 6,
    policy: RootPolicy = POLICY,
) -> AnyVector:
    """Return the rightmost roots that were confirmed, from right to left.

    Parameters
    ----------
    ports : tuple of ndarray
        A, B, C, D from delayed signals d to the signals v that enter the lines.
    seconds : ndarray, shape (lines,)
    highest : float
        Frequency in rad/s beyond which no root has to be found.
    count : int
        How many starts are followed; pairs count twice.

    Returns
    -------
    ndarray of complex
        In rad/s; empty where the system is too large or nothing was confirmed.
    """
    A, B, C, D, unit = _scaled(*ports)
    delays = seconds * unit
    nodes = policy.nodes + int(np.ceil(policy.nodes_per_radian * highest * seconds.max()))
    if len(A) + len(seconds) * nodes > MOST_SIZE:
        return np.zeros(0, complex)
    starts = np.linalg.eigvals(_transport(A, B, C, D, delays, nodes))
    starts = starts[np.argsort(-starts.real)][: 3 * count]
    found: list[complex] = []
    for start in starts:
        root = _root(A, B, C, D, delays, complex(start), policy)
        if root is not None and not any(abs(root - r) <= 1e-6 * (1 + abs(r)) for r in found):
            found.append(root)
    found.sort(key=lambda root: (-root.real, -root.imag))
    return np.array(found[:count], dtype=complex) * unit


def _scaled(
    A: Matrix, B: Matrix, C: Matrix, D: Matrix
) -> tuple[Matrix, Matrix, Matrix, Matrix, float]:
    """Balance states and lines by powers of two, and choose a unit of rate."""
    n = len(A)
    whole = np.block([[A, B], [C, D]])
    with np.errstate(invalid="ignore"):
        _, (scale, _) = linalg.matrix_balance(whole, permute=False, separate=True)
    whole = whole * scale / scale[:, None]
    rates = np.abs(np.linalg.eigvals(whole[:n, :n])) if n else np.zeros(0)
    through = float(np.linalg.norm(whole[:n, n:] @ whole[n:, :n]))  # gain per second, by the lines
    rates = np.append(rates, through)
    rates = rates[rates > 0]
    unit = float(np.exp2(np.round(np.log2(np.median(rates))))) if rates.size else 1.0
    return whole[:n, :n] / unit, whole[:n, n:] / unit, whole[n:, :n], whole[n:, n:], unit


def _transport(A: Matrix, B: Matrix, C: Matrix, D: Matrix, delays: Vector, nodes: int) -> Matrix:
    """Return the matrix of states and of what is under way along each line.

    Along line i the signal phi(theta) moves by phi' = d phi / d theta, theta from -delay to 0;
    it enters at 0, where phi = v = C x + D d, and leaves at -delay as d.
    """
    n, k = len(A), len(delays)
    points = np.cos(np.pi * np.arange(nodes + 1) / nodes)
    weight = np.ones(nodes + 1)
    weight[[0, -1]] = 2.0
    weight *= (-1.0) ** np.arange(nodes + 1)
    away = points[:, None] - points + np.eye(nodes + 1)
    slope = np.outer(weight, 1 / weight) / away
    slope -= np.diag(slope.sum(axis=1))
    whole = np.zeros((n + k * nodes, n + k * nodes))
    ends = [n + (i + 1) * nodes - 1 for i in range(k)]
    whole[:n, :n] = A
    whole[:n, ends] = B
    for i, delay in enumerate(delays):
        own = slice(n + i * nodes, n + (i + 1) * nodes)
        along = slope[1:] * (2 / delay)
        whole[own, own] += along[:, 1:]
        whole[own, :n] += np.outer(along[:, 0], C[i])
        whole[own, ends] += np.outer(along[:, 0], D[i])
    return whole


def _root(
    A: Matrix,
    B: Matrix,
    C: Matrix,
    D: Matrix,
    delays: Vector,
    start: complex,
    policy: RootPolicy,
) -> complex | None:
    """Follow Newton's steps on the characteristic matrix; None if they end at no root."""
    s = start
    for _ in range(policy.steps):
        T, slope = _characteristic(A, B, C, D, delays, s)
        if not np.isfinite(T).all():
            return None
        U, sizes, Vh = np.linalg.svd(T)
        u, v = U[:, -1].conj(), Vh[-1].conj()
        change = u @ slope @ v
        if change == 0:
            return None
        step = (u @ T @ v) / change
        s = complex(s - step)
        if abs(step) <= 1e-14 * (1 + abs(s)):
            break
    T, _ = _characteristic(A, B, C, D, delays, s)
    if not np.isfinite(T).all() or abs(s - start) > policy.moved * (1 + abs(start)):
        return None
    sizes = np.linalg.svd(T, compute_uv=False)
    return s if sizes[-1] <= policy.residual * sizes[0] else None


def _characteristic(
    A: Matrix, B: Matrix, C: Matrix, D: Matrix, delays: Vector, s: complex
) -> tuple[AnyMatrix, AnyMatrix]:
    """Return the matrix that is singular at a root, and its derivative.

    A line is scaled by 1 + |e^(-s delay)|, lest roots far to the left drown.
    """
    n, k = len(A), len(delays)
    with np.errstate(over="ignore", invalid="ignore"):
        E = np.exp(-s * delays)
        E = E[:, None] / (1 + np.abs(E))[:, None]
        one = np.diag(1 / (1 + np.abs(np.exp(-s * delays))))
    T = np.block([[s * np.eye(n) - A, -B.astype(complex)], [-E * C, one - E * D]])
    slope = np.block(
        [
            [np.eye(n), np.zeros((n, k))],
            [delays[:, None] * E * C, delays[:, None] * E * D],
        ]
    )
    return T, slope
