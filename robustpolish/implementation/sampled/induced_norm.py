"""The induced L2 norm of a sampled loop from w to z, what happens between samples included.

A gain gamma is tested by joining stretches of the loop: within a period from a first step so short
that nothing can go wrong, then period by period, doubling each time. If no join fails, the
gain of every finite time lies below gamma, and with it the norm of the stable loop.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from robustpolish.base.arrays import NOTHING, ROUNDING, Matrix
from robustpolish.implementation.sampled.lifting import DOUBLINGS, Phase, ScaledMap
from robustpolish.linear.arithmetic.exact import FloatRangeError
from robustpolish.linear.stability import square_root

# Stretches of a loop as maps of state and energy, joined by doubling, in doubles.
#
# A stretch with gain below one from w to z obeys xi(end) = A xi + G lambda(end) and
# lambda = A' lambda(end) + Q xi, where xi is its state and lambda the slope of the most that the
# energy of z can exceed that of w by. Two such stretches in a row have a gain below one exactly if
# the largest eigenvalue of G1 Q2 lies below one (no conjugate point). So no exponential of a long
# stretch is ever formed.

SMALL_STEP = 0.25
"""Largest norm of the Hamiltonian times the first step.

Below log 2 no conjugate point lies in the step, because its exponential minus the identity has
a norm below one; a quarter leaves the series its quick convergence.
"""

_TERMS = 16


class EnergySection(NamedTuple):
    """State map A, reach G of inputs and output energy Q of a stretch; G and Q are symmetric."""

    A: Matrix
    G: Matrix
    Q: Matrix

    @property
    def size(self) -> float:
        """A bound on what the stretch still passes on."""
        return float(np.linalg.norm(self.A))


class GainReached(NamedTuple):
    """Where a gain of one is reached: after how many doublings, and along which costate."""

    stage: int
    costate: Matrix


def joined(first: EnergySection, second: EnergySection) -> EnergySection | Matrix:
    """Return two stretches as one, or the costate along which their gain reaches one."""
    clash = _clash(first.G, second.Q)
    if clash is not None:
        return clash
    n = first.G.shape[0]
    W = np.linalg.inv(np.eye(n) - first.G @ second.Q)
    through = W @ first.A
    G = second.G + second.A @ W @ first.G @ second.A.T
    Q = first.Q + first.A.T @ second.Q @ through
    return EnergySection(second.A @ through, (G + G.T) / 2, (Q + Q.T) / 2)


def _clash(G: Matrix, Q: Matrix) -> Matrix | None:
    """Return Q v for the eigenvector v of G Q whose eigenvalue reaches one, if there is any."""
    if np.linalg.norm(G) * np.linalg.norm(Q) < 1:
        return None
    if not (np.isfinite(G).all() and np.isfinite(Q).all()):
        return np.zeros(G.shape[0])
    root = square_root(G)
    gains, modes = np.linalg.eigh(root.T @ Q @ root)
    return Q @ root @ modes[:, -1] if gains[-1] >= 1 else None


def hamiltonian(phase: Phase, gamma: float) -> Matrix | None:
    """Return the Hamiltonian matrix at gamma, with gain one to be tested; None if D reaches it."""
    A, B, C, D = phase.A, phase.B / math.sqrt(gamma), phase.C / math.sqrt(gamma), phase.D / gamma
    if D.size and np.linalg.norm(D, 2) >= 1:
        return None
    G, Q = B @ B.T, C.T @ C
    if D.any():
        into = np.linalg.solve(np.eye(D.shape[1]) - D.T @ D, np.hstack([B.T, D.T @ C]))
        n = A.shape[0]
        G, A = B @ into[:, :n], A + B @ into[:, n:]
        Q = C.T @ np.linalg.solve(np.eye(D.shape[0]) - D @ D.T, C)
    return np.block([[A, G], [-Q, -A.T]])


def halvings(H: Matrix, length: float) -> int:
    """Return how often to halve a stretch until its first step is small."""
    size = float(np.linalg.norm(H, 1)) * length / SMALL_STEP
    if not math.isfinite(size):
        raise FloatRangeError
    return max(0, math.ceil(math.log2(size))) if size > 1 else 0


def phase_section(phase: Phase, gamma: float) -> EnergySection | GainReached:
    """Return a phase as a section at gamma, or where in it the gain reaches gamma."""
    H = hamiltonian(phase, gamma)
    n = phase.A.shape[0]
    if H is None:
        return GainReached(-1, np.zeros(n))
    times = halvings(H, phase.length)
    E, G, Q = _first_step(H * (phase.length / 2**times))
    eye = np.eye(n)
    for stage in range(times):
        clash = _clash(G, Q)
        if clash is not None:
            return GainReached(stage, clash)
        E, G, Q = _doubled(E, G, Q)
    return EnergySection(eye + E, G, Q)


def _doubled(E: Matrix, G: Matrix, Q: Matrix) -> tuple[Matrix, Matrix, Matrix]:
    # A = I + E; keeping E saves what would be lost in a sum with the identity.
    eye = np.eye(len(E))
    W = np.linalg.inv(eye - G @ Q)
    A = eye + E
    Q, G, E = (Q + A.T @ Q @ W @ A, G + A @ W @ G @ A.T, 2 * E + E @ E + A @ (G @ Q @ W) @ A)
    return E, (G + G.T) / 2, (Q + Q.T) / 2


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


@dataclass(frozen=True)
class GainTest:
    """Whether the gain of a loop lies below gamma, and what shows it.

    Attributes
    ----------
    gamma : float
    below : bool
    storage : ndarray or None
        If below: s'P s is the largest energy that may still come, of z less gamma^2 times w.
    phase, stage : int
        If not: the phase in which a gain of gamma is reached (number of phases: where phases are
        joined; one more: over periods), and after how many doublings.
    costate : ndarray or None
        If not: the direction in which it is reached.
    """

    gamma: float
    below: bool
    storage: Matrix | None = None
    phase: int = -1
    stage: int = -1
    costate: Matrix | None = None


def period_section(loop: ScaledMap, gamma: float) -> EnergySection | GainTest:
    """Return a period at gamma in the states at the samples, or a test if gamma is reached in it.

    Parameters
    ----------
    loop : ScaledMap
    gamma : float

    Returns
    -------
    Section or GainTest
    """
    flow: Any = None
    for i, phase in enumerate(loop.phases):
        found = phase_section(phase, gamma)
        if isinstance(found, GainReached):
            return GainTest(gamma, False, None, i, found.stage, found.costate)
        flow = found if flow is None else joined(flow, found)
        if not isinstance(flow, EnergySection):
            return GainTest(gamma, False, None, len(loop.phases), 0, flow)
    onward = loop.N + loop.M @ flow.A @ loop.L
    return EnergySection(onward, loop.M @ flow.G @ loop.M.T, loop.L.T @ flow.Q @ loop.L)


def check_gain(loop: ScaledMap, gamma: float, margin: float = 0.0) -> GainTest:
    """Test whether the gain of a stable loop lies below gamma.

    Parameters
    ----------
    loop : ScaledMap
    gamma : float
    margin : float, optional
        Energy of s added to that of z in every period, relative to what z has; what is left of it
        makes the inequality of the storage function strict.

    Returns
    -------
    GainTest
    """
    section = period_section(loop, gamma)
    if isinstance(section, GainTest):
        return section
    if margin:
        level = margin * max(float(np.linalg.norm(section.Q, 2)), 1e-300)
        section = section._replace(Q=section.Q + level * np.eye(len(section.Q)))
    for stage in range(DOUBLINGS):
        twice = joined(section, section)
        if not isinstance(twice, EnergySection):
            return GainTest(gamma, False, None, len(loop.phases) + 1, stage, twice)
        change = np.linalg.norm(twice.Q - section.Q)
        section = twice
        settled = change <= ROUNDING * np.linalg.norm(section.Q)
        if settled and section.size < math.sqrt(ROUNDING):
            return GainTest(gamma, True, section.Q)
    # Neither settled nor refuted: gamma is nearer to the norm than doubles can tell.
    return GainTest(gamma, False)


def bracket(
    loop: ScaledMap, start: float, tolerance: float = 1e-6
) -> tuple[GainTest, GainTest] | None:
    """Enclose the norm of a stable loop between two tests.

    Parameters
    ----------
    loop : ScaledMap
    start : float
        A first guess, positive.
    tolerance : float, optional
        Relative width.

    Returns
    -------
    (GainTest, GainTest) or None
        The last that failed and the last that passed; None if none passed. A norm of zero has a
        first one with gamma = 0.
    """
    low, high = GainTest(0.0, False), check_gain(loop, start)
    factor = 2.0
    while not high.below:
        low, factor = high, factor**2
        if low.gamma * factor > start * 1e30:
            return None
        high = check_gain(loop, low.gamma * factor)
    factor = 2.0
    while low.gamma == 0.0:
        factor **= 2
        # Below this part of what the matrices suggest a norm counts as zero.
        test = check_gain(loop, max(high.gamma / factor, start * NOTHING))
        if test.below and test.gamma <= start * NOTHING:
            return low, test
        low, high = (low, test) if test.below else (test, high)
    while high.gamma > low.gamma * (1 + tolerance):
        middle = check_gain(loop, math.sqrt(low.gamma * high.gamma))
        low, high = (low, middle) if middle.below else (middle, high)
    return low, high


# Where a sampled loop has its largest gain.

_GRID = 200
_REFINED = 3


def peak_frequency(loop: ScaledMap, gamma: float) -> float | None:
    """Return where the discrete loop that stands for the sampled one at gamma has gain one.

    Parameters
    ----------
    loop : ScaledMap
    gamma : float
        A little above the norm.

    Returns
    -------
    float or None
        rad/s, from 0 to half the sample rate.
    """
    section = period_section(loop, gamma)
    if not isinstance(section, EnergySection):
        return None
    poles = np.abs(np.angle(np.linalg.eigvals(section.A)))
    grids = np.logspace(-6, 0, _GRID) * np.pi, np.linspace(0, np.pi, _GRID), poles
    angles = np.unique(np.concatenate(grids))
    for _ in range(_REFINED):
        best = int(np.argmax(_gains(section, angles)))
        low, high = angles[max(best - 1, 0)], angles[min(best + 1, angles.size - 1)]
        angles = np.linspace(low, high, 41)
    return float(angles[int(np.argmax(_gains(section, angles)))]) / loop.map.period


def _gains(section: EnergySection, angles: np.ndarray) -> np.ndarray:
    reach, see = square_root(section.G), square_root(section.Q).T
    shifted = np.exp(1j * angles)[:, None, None] * np.eye(len(section.A)) - section.A
    states = np.linalg.solve(shifted, np.broadcast_to(reach, (angles.size, *reach.shape)))
    return np.linalg.svd(see @ states, compute_uv=False)[:, 0]
