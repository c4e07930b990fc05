"""State feedback by linear matrix inequalities, solved again in better coordinates."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robustpolish.synthesis.lmi.state.frames import Frame
from robustpolish.synthesis.lmi.state.programs import (
    EASED_TOLERANCE,
    SOLVER_TOLERANCE,
    Demand,
    LmiAnswer,
    LmiOptions,
    solve_once,
)
from robustpolish.synthesis.lmi.state.smaller_gain import tamed
from robustpolish.synthesis.problem.state_feedback_problem import StateFeedbackProblem
from robustpolish.synthesis.riccati.state import game_gain

Matrix = NDArray[np.float64]

# Rounds of solving, and the noise on all states that each adds for the H2 norm, as a share of
# the disturbance. Without it Y is singular where w excites little, and with no pole region
# the optimal gain does not depend on it.
_HIGHER_PRICES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
_NOISE = (1e-1, 1e-2, 1e-3, 1e-4, 1e-4)


def minimise_norm(
    problem: StateFeedbackProblem, options: LmiOptions, start: Matrix | None = None
) -> tuple[LmiAnswer | None, list[dict[str, Any]]]:
    """Minimise the norm by inequalities and verify every answer from its loop.

    The first solve is made in the given states. Each further one uses states in which the
    last Y is the identity, controls in which the last gain is of order one, and a congruence
    that evens out the Lyapunov inequality, so that nothing near the optimum is small.

    Parameters
    ----------
    problem : StateFeedbackProblem
        Scaled.
    options : LmiOptions
    start : ndarray, optional
        A stabilising gain, whose norm serves as the first unit.

    Returns
    -------
    answer : LmiAnswer or None
        The best verified one; None if no gain stabilises.
    history : list of dict
        One entry per solve.
    """
    p = problem.compressed()
    first = p.achieved(start, options.norm)
    frame = Frame.plain(p, first if 0 < first < math.inf else 1.0)
    history: list[dict[str, Any]] = []
    result = _rounds(p, options, frame, history)
    if (result is None or not result.agreed) and options.remaining() > 0:
        approached = _approached(p, options, frame, history)
        other = _rounds(p, options, approached, history)
        if result is None or (other is not None and other.better_than(result)):
            result = other
    if result is None:
        return None, history
    best = result.best
    if options.norm == "h2":
        # The smallest bound of (10.28) for this gain, without noise, is the Gramian's.
        return replace(best, claimed=best.achieved, sharp=result.agreed), history
    claimed = result.claimed
    estimate = claimed if 0.5 * best.achieved < claimed < best.achieved else best.achieved
    answer = tamed(p, options, result.frame, best, estimate, history)
    near = answer.achieved <= estimate * (1 + 5 * options.slack)
    return replace(answer, sharp=near and result.agreed), history


@dataclass(frozen=True, eq=False)
class _Result:
    """The best answer of several rounds, the next frame, the last claim, and whether to trust."""

    best: LmiAnswer
    frame: Frame
    claimed: float
    agreed: bool

    def better_than(self, other: _Result) -> bool:
        return self.best.achieved < other.best.achieved or (self.agreed and not other.agreed)


def _rounds(
    p: StateFeedbackProblem, options: LmiOptions, frame: Frame, history: list[dict[str, Any]]
) -> _Result | None:
    """Solve again and again, each time in the coordinates that the last answer suggests."""
    older = frame
    best: LmiAnswer | None = None
    agreed = False
    claimed, tolerance = math.inf, SOLVER_TOLERANCE
    for number, noise in enumerate(_NOISE, start=1):
        if options.remaining() <= 0:
            break
        solved = _solve_somehow(p, options, frame, older, noise, tolerance, history)
        history[-1]["step"] = f"inequalities, round {number}"
        if solved is None:
            break
        answer, older, frame = solved[0], frame, solved[1]
        settled = best is not None and _settled(answer, best, options)
        claimed = answer.claimed
        if answer.achieved > claimed * (1 + options.slack):
            # The solver went so near the edge that its gain is wrong: stay further inside.
            tolerance = min(30 * tolerance, 0.1 * options.slack)
        near = best.achieved if best is not None and options.norm == "h2" else claimed
        agreed = agreed or settled or abs(near / answer.achieved - 1) < 5 * options.slack
        if best is None or answer.achieved < best.achieved:
            best = answer
        if settled:
            break
    if best is None or not math.isfinite(best.achieved):
        return None
    return _Result(best, frame, claimed, agreed)


def _solve_somehow(
    p: StateFeedbackProblem,
    options: LmiOptions,
    frame: Frame,
    older: Frame,
    noise: float,
    tolerance: float,
    history: list[dict[str, Any]],
) -> tuple[LmiAnswer, Frame] | None:
    """Solve in the new frame; where the solver breaks down, more plainly, then in the old."""
    plain = frame.without_congruence()
    attempts = (
        (frame, tolerance),
        (plain, max(tolerance, EASED_TOLERANCE)),
        (replace(plain, T=older.T), SOLVER_TOLERANCE),
    )
    result = None
    for attempt, eased in attempts:
        result = solve_once(p, options, attempt, Demand(noise=noise), history, eased)
        if result is not None or options.remaining() <= 0:
            break
    return result


def _approached(
    p: StateFeedbackProblem, options: LmiOptions, frame: Frame, history: list[dict[str, Any]]
) -> Frame:
    """Return coordinates for a hard problem from easier ones, in which u has a higher price."""
    for price in _HIGHER_PRICES:
        easier = p.with_price(price).compressed()
        unit = easier.achieved(game_gain(easier, math.inf), options.norm)
        if not 0 < unit < math.inf or options.remaining() <= 0:
            continue
        solved = solve_once(
            easier, options, replace(frame, unit=unit), Demand(noise=_NOISE[0]), history
        )
        if solved is not None:
            history[-1]["step"] = f"inequalities with a price of {price:.0e}"
            frame = solved[1]
    return frame


def _settled(answer: LmiAnswer, best: LmiAnswer, options: LmiOptions) -> bool:
    """Whether the answer agrees with the best so far, and its claim with its achievement."""
    near = 0.1 * options.slack
    if not abs(answer.achieved / best.achieved - 1) < near:
        return False
    # With noise the claim is for a larger norm.
    return options.norm == "h2" or abs(answer.claimed / answer.achieved - 1) < near
