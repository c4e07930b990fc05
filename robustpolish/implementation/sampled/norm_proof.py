"""Proofs, in ball arithmetic, of a bound on a sampled loop's norm and of a gain that it reaches."""

from __future__ import annotations

import flint
import numpy as np

from robustpolish.arrays import Matrix
from robustpolish.exact import balls
from robustpolish.implementation.sampled.ball_section import (
    Ball,
    BallSection,
    at_samples,
    bits_needed,
    joined_balls,
    period_balls,
    phase_balls,
)
from robustpolish.implementation.sampled.induced_norm import GainTest, judge_gain
from robustpolish.implementation.sampled.scaled_map import ScaledMap

SLACKS = (2e-6, 1e-5, 1e-4, 1e-3)
"""How far above the norm a bound may be claimed: the first that can be proven is."""

_MARGINS = (1e-13, 1e-11, 1e-9, 1e-7)
"""Energy of the states, beside that of z in a period, by which the inequality is kept strict."""

_REFINEMENTS = 5
_DOUBLINGS = 60
_BITS_PER_STAGE = (24, 120)
"""Bits that a doubling over periods may cost where the gain comes near to gamma; tried in turn.

NN7 of COMPleib, nine states of the controller, needs the second.
"""


def prove_below(loop: ScaledMap, gamma: float) -> tuple[float, Matrix] | None:
    """Prove that a loop is stable and its norm at most a little above gamma.

    Parameters
    ----------
    loop : ScaledMap
    gamma : float
        The norm as doubles found it, positive.

    Returns
    -------
    (bound, storage) or None
        With x'Px, which falls by more in every period than z gained over bound^2 w.
    """
    for slack in SLACKS:
        bound = gamma * (1 + slack)
        try:
            with balls.precision(bits_needed(loop, bound)):
                section, sound = period_balls(loop, bound)
                if not sound:
                    continue
                for margin in _MARGINS:
                    test = judge_gain(loop, bound, margin)
                    if test.storage is None:
                        continue
                    proven = _dissipating(section, test.storage, margin)
                    if proven is not None:
                        return bound, proven
        except ZeroDivisionError:
            continue
    return None


def _dissipating(section: BallSection, storage: Matrix, margin: float) -> Matrix | None:
    """Return a storage function that is proven, refined from one that doubles found."""
    if not np.isfinite(storage).all():
        return None
    n = len(storage)
    P = balls.symmetric(balls.ball(storage))
    level = margin * float(np.linalg.norm(balls.midpoint(section.Q), 2))
    extra = balls.identity(n) * flint.arb(level)
    for _ in range(_REFINEMENTS):
        through = (balls.identity(n) - section.G * P).inv() * section.A
        after = balls.symmetric(section.A.transpose() * P * through)
        if _dissipates(section, P, after):
            return balls.midpoint(P)
        rest = balls.midpoint(section.Q + extra + after - P)
        step = _flow_sum(balls.midpoint(through), rest)
        if step is None:
            return None
        P = balls.symmetric((P + balls.ball(step)).mid())
    return None


def _flow_sum(through: Matrix, rest: Matrix) -> Matrix | None:
    """Return the sum of T'^k R T^k: Newton's step on the Riccati equation."""
    total, power = rest, through
    for _ in range(_DOUBLINGS):
        added = power.T @ total @ power
        total, power = total + added, power @ power
        if not np.isfinite(total).all():
            return None
        if np.linalg.norm(added) <= 1e-16 * np.linalg.norm(total):
            return (total + total.T) / 2
    return None


def _dissipates(section: BallSection, P: Ball, after: Ball) -> bool:
    """Prove P > 0, P^-1 > G and P > Q + A'(P^-1 - G)^-1 A."""
    return (
        balls.is_positive_definite(balls.symmetric(P - section.Q - after))
        and balls.is_positive_definite(P)
        and balls.is_positive_definite(balls.symmetric(P - P * section.G * P))
    )


def prove_above(loop: ScaledMap, test: GainTest) -> bool:
    """Prove that the gain which a failed test saw is really reached, by an input that ends.

    The costate l names an input that costs l'G1 l and brings the energy l'G1 Q2 G1 l afterwards.

    Parameters
    ----------
    loop : ScaledMap
    test : GainTest
        One that failed.

    Returns
    -------
    bool
        False where the balls leave it open.
    """
    if test.stage < 0 and test.phase >= 0:
        return all(_direct(loop, test.gamma))
    if test.costate is None or not test.costate.any():
        return False
    return any(_witnessed(loop, test, bits) for bits in _BITS_PER_STAGE)


def _witnessed(loop: ScaledMap, test: GainTest, bits_per_stage: int) -> bool:
    """Compare cost and energy of the input that a costate names."""
    bits = bits_needed(loop, test.gamma) + bits_per_stage * max(0, test.stage)
    costate = np.zeros(0) if test.costate is None else test.costate
    try:
        with balls.precision(bits):
            first, second = _pair(loop, test)
            direction = first.G * balls.ball(costate[:, None])
            cost = (balls.ball(costate[None, :]) * direction)[0, 0]
            gain = (direction.transpose() * second.Q * direction)[0, 0]
            return bool(cost > 0 and gain >= cost)
    except ZeroDivisionError:
        return False


def _direct(loop: ScaledMap, gamma: float) -> list[bool]:
    """Tell of each phase whether D alone reaches gamma, for inputs that change quickly enough."""
    gains = [np.linalg.norm(p.D, 2) if p.D.size else 0.0 for p in loop.phases]
    return [bool(gain * (1 - 1e-13) >= gamma) for gain in gains]


def _pair(loop: ScaledMap, test: GainTest) -> tuple[BallSection, BallSection]:
    """Return the two stretches between which the gain is reached."""
    phases = loop.map.phases
    if test.phase < len(phases):
        found, _ = phase_balls(phases[test.phase], loop.flow, test.gamma, test.stage)
        return found, found
    parts = [phase_balls(phase, loop.flow, test.gamma)[0] for phase in phases]
    if test.phase == len(phases):
        return parts[0], parts[1]
    whole = parts[0] if len(parts) == 1 else joined_balls(parts[0], parts[1])
    section = at_samples(loop, whole)
    for _ in range(test.stage):
        section = joined_balls(section, section)
    return section, section
