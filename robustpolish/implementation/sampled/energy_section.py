"""Stretches of a loop as maps of state and energy, joined by doubling, in doubles.

A stretch with gain below one from w to z obeys xi(end) = A xi + G lambda(end) and
lambda = A' lambda(end) + Q xi, where xi is its state and lambda the slope of the most that the
energy of z can exceed that of w by. Two such stretches in a row have a gain below one exactly if
the largest eigenvalue of G1 Q2 lies below one (no conjugate point). So no exponential of a long
stretch is ever formed.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robustpolish.arrays import Matrix
from robustpolish.exact.exponents import BeyondDoublesError
from robustpolish.implementation.sampled.period_map import Phase

SMALL_STEP = 0.25
"""Largest norm of the Hamiltonian times the first step.

Below log 2 no conjugate point lies in the step, because its exponential minus the identity has
a norm below one; a quarter leaves the series its quick convergence.
"""

_TERMS = 16


class Section(NamedTuple):
    """State map A, reach G of inputs and output energy Q of a stretch; G and Q are symmetric."""

    A: Matrix
    G: Matrix
    Q: Matrix

    @property
    def size(self) -> float:
        """A bound on what the stretch still passes on."""
        return float(np.linalg.norm(self.A))


class Conflict(NamedTuple):
    """Where a gain of one is reached: after how many doublings, and along which costate."""

    stage: int
    costate: Matrix


def joined(first: Section, second: Section) -> Section | Matrix:
    """Return two stretches as one, or the costate along which their gain reaches one."""
    clash = _clash(first.G, second.Q)
    if clash is not None:
        return clash
    n = first.G.shape[0]
    W = np.linalg.inv(np.eye(n) - first.G @ second.Q)
    through = W @ first.A
    G = second.G + second.A @ W @ first.G @ second.A.T
    Q = first.Q + first.A.T @ second.Q @ through
    return Section(second.A @ through, (G + G.T) / 2, (Q + Q.T) / 2)


def _clash(G: Matrix, Q: Matrix) -> Matrix | None:
    """Return Q v for the eigenvector v of G Q whose eigenvalue reaches one, if there is any."""
    if np.linalg.norm(G) * np.linalg.norm(Q) < 1:
        return None
    if not (np.isfinite(G).all() and np.isfinite(Q).all()):
        return np.zeros(G.shape[0])
    values, vectors = np.linalg.eigh(G)
    root = vectors * np.sqrt(np.maximum(values, 0))
    gains, modes = np.linalg.eigh(root.T @ Q @ root)
    return Q @ root @ modes[:, -1] if gains[-1] >= 1 else None


def hamiltonian(phase: Phase, gamma: float) -> Matrix | None:
    """Return the Hamiltonian matrix at gamma, with gain one to be tested; None if D reaches it."""
    A, B, C, D = phase.A, phase.B / math.sqrt(gamma), phase.C / math.sqrt(gamma), phase.D / gamma
    if D.size and np.linalg.norm(D, 2) >= 1:
        return None
    if D.any():
        into = np.linalg.solve(np.eye(D.shape[1]) - D.T @ D, np.hstack([B.T, D.T @ C]))
        n = A.shape[0]
        G, A = B @ into[:, :n], A + B @ into[:, n:]
        Q = C.T @ np.linalg.solve(np.eye(D.shape[0]) - D @ D.T, C)
    else:
        G, Q = B @ B.T, C.T @ C
    return np.block([[A, G], [-Q, -A.T]])


def halvings(H: Matrix, length: float) -> int:
    """Return how often to halve a stretch until its first step is small."""
    size = float(np.linalg.norm(H, 1)) * length / SMALL_STEP
    if not math.isfinite(size):
        raise BeyondDoublesError
    return max(0, math.ceil(math.log2(size))) if size > 1 else 0


def phase_section(phase: Phase, gamma: float) -> Section | Conflict:
    """Return a phase as a section at gamma, or where in it the gain reaches gamma."""
    H = hamiltonian(phase, gamma)
    n = phase.A.shape[0]
    if H is None:
        return Conflict(-1, np.zeros(n))
    times = halvings(H, phase.length)
    E, G, Q = _first_step(H * (phase.length / 2**times))
    eye = np.eye(n)
    for stage in range(times):
        clash = _clash(G, Q)
        if clash is not None:
            return Conflict(stage, clash)
        # A = I + E; keeping E saves what would be lost in a sum with the identity.
        W = np.linalg.inv(eye - G @ Q)
        A = eye + E
        Q, G, E = (
            Q + A.T @ Q @ W @ A,
            G + A @ W @ G @ A.T,
            2 * E + E @ E + A @ (G @ Q @ W) @ A,
        )
        Q, G = (Q + Q.T) / 2, (G + G.T) / 2
    return Section(eye + E, G, Q)


def _first_step(H: Matrix) -> tuple[Matrix, Matrix, Matrix]:
    n = H.shape[0] // 2
    term, total = H, H.copy()
    for k in range(2, _TERMS):
        term = term @ H / k
        total += term
    F22 = total[n:, n:]
    inverse = np.linalg.inv(np.eye(n) + F22)
    G, Q = total[:n, n:] @ inverse, -inverse @ total[n:, :n]
    return -inverse.T @ F22.T, (G + G.T) / 2, (Q + Q.T) / 2
