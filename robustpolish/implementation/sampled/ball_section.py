"""Stretches of a sampled loop in ball arithmetic: what doubles found, computed again with proof."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import flint
import numpy as np

from robustpolish.arrays import Vector
from robustpolish.exact import balls
from robustpolish.implementation.sampled.energy_section import SMALL_STEP, halvings, hamiltonian
from robustpolish.implementation.sampled.period_map import Phase
from robustpolish.implementation.sampled.scaled_map import ScaledMap

Ball = Any  # flint.arb_mat; python-flint ships no stubs for it

_SPARE_BITS = 140
"""Bits beyond those that doublings use up; loops of stiff machines lose 60 in inversions."""


class BallSection(NamedTuple):
    """A, G and Q of a stretch, enclosed; see `energy_section.Section`."""

    A: Ball
    G: Ball
    Q: Ball


def bits_needed(loop: ScaledMap, gamma: float) -> int:
    """Return the precision for a period: each doubling of a short step costs a bit or two."""
    most = 0
    for phase in loop.phases:
        H = hamiltonian(phase, gamma)
        most = max(most, 0 if H is None else halvings(H, phase.length))
    return _SPARE_BITS + 3 * most


def joined_balls(first: BallSection, second: BallSection) -> BallSection:
    """Join two stretches; whether their gain stays below one has to be proven beside it.

    Raises
    ------
    ZeroDivisionError
        If the join is singular as far as the balls can tell.
    """
    n = first.G.nrows()
    W = (balls.identity(n) - first.G * second.Q).inv()
    through = W * first.A
    return BallSection(
        second.A * through,
        balls.symmetric(second.G + second.A * W * first.G * second.A.transpose()),
        balls.symmetric(first.Q + first.A.transpose() * second.Q * through),
    )


def joins(first: BallSection, second: BallSection) -> bool:
    """Prove that two stretches in a row keep the gain below one.

    With S = G1 + e I for a small e > 0, S - S Q2 S > 0 says that all eigenvalues of S Q2,
    and so those of G1 Q2, lie below one.
    """
    n = first.G.nrows()
    size = float(np.linalg.norm(balls.magnitude(first.G)))
    heavy = float(np.linalg.norm(balls.magnitude(second.Q)))
    if size * heavy * (1 + 1e-12) < 1:
        return True
    S = first.G + balls.identity(n) * flint.arb(size * 2.0**-40)
    return balls.is_positive_definite(S) and balls.is_positive_definite(
        balls.symmetric(S - S * second.Q * S)
    )


def phase_balls(phase: Phase, flow: Vector, gamma: float, doublings: int | None = None) -> Any:
    """Enclose a phase at gamma in the coordinates that `flow` scales.

    Parameters
    ----------
    phase : Phase
        In its own coordinates.
    flow : ndarray
        Powers of two.
    gamma : float
    doublings : int, optional
        Stop after so many, for a witness in the midst of the phase.

    Returns
    -------
    (BallSection, bool)
        The section, and whether every join in it is proven to be sound.
    """
    n = phase.A.shape[0]
    root = flint.arb(gamma).sqrt()
    into, back = balls.ball(np.diag(1 / flow)), balls.ball(np.diag(flow))
    A, B = into * balls.ball(phase.A) * back, into * _over(phase.B, root)
    C, D = _over(phase.C, root) * back, _over(phase.D, flint.arb(gamma))
    R, S = (
        balls.identity(D.ncols()) - D.transpose() * D,
        balls.identity(D.nrows()) - D * D.transpose(),
    )
    if not (balls.is_positive_definite(R) and balls.is_positive_definite(S)):
        raise ZeroDivisionError
    weight = R.inv()
    A = A + B * weight * D.transpose() * C
    G, Q = B * weight * B.transpose(), C.transpose() * S.inv() * C
    H = balls.block([[A, G], [Q * flint.arb(-1), A.transpose() * flint.arb(-1)]])
    length = flint.arb(phase.length)
    size = float(balls.magnitude(H * length).sum(axis=0).max())
    times = max(0, math.ceil(math.log2(size / SMALL_STEP))) if size > SMALL_STEP else 0
    Phi = (H * (length * flint.arb(2) ** -times)).exp()
    table = Phi.tolist()
    F12, F21, F22 = (
        flint.arb_mat([row[c : c + n] for row in table[r : r + n]])
        for r, c in ((0, n), (n, 0), (n, n))
    )
    inverse = F22.inv()
    found = BallSection(
        inverse.transpose(),
        balls.symmetric(F12 * inverse),
        balls.symmetric(inverse * F21 * flint.arb(-1)),
    )
    sound = True
    for _ in range(times if doublings is None else doublings):
        sound = sound and joins(found, found)
        found = joined_balls(found, found)
    return found, sound


def _over(matrix: Any, by: Any) -> Ball:
    found = balls.ball(matrix) if matrix.size else balls.zeros(*matrix.shape)
    return found * (1 / by)


def period_balls(loop: ScaledMap, gamma: float) -> tuple[BallSection, bool]:
    """Enclose a whole period, in the loop's scaled states at the samples."""
    found: BallSection | None = None
    sound = True
    for phase in loop.map.phases:
        own, safe = phase_balls(phase, loop.flow, gamma)
        sound = sound and safe
        if found is not None:
            sound = sound and joins(found, own)
            own = joined_balls(found, own)
        found = own
    assert found is not None
    return at_samples(loop, found), sound


def at_samples(loop: ScaledMap, flow: BallSection) -> BallSection:
    """Return what the flow of a period means for the states at its samples."""
    L, N = loop.map.connected(_ball, lambda a, b: a * b)
    into, back = balls.ball(np.diag(1 / loop.sample)), balls.ball(np.diag(loop.sample))
    L = balls.ball(np.diag(1 / loop.flow)) * L * back
    M = into * balls.ball(loop.map.M) * balls.ball(np.diag(loop.flow))
    return BallSection(
        into * N * back + M * flow.A * L,
        balls.symmetric(M * flow.G * M.transpose()),
        balls.symmetric(L.transpose() * flow.Q * L),
    )


def _ball(matrix: Any) -> Ball:
    return balls.ball(matrix) if matrix.size else balls.zeros(*matrix.shape)
