"""State feedback by linear matrix inequalities, solved again in better coordinates."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from robustpolish.synthesis.full_state.frames import Frame
from robustpolish.synthesis.full_state.problem import StateFeedbackProblem
from robustpolish.synthesis.full_state.programs import (
    EASED_TOLERANCE,
    SOLVER_TOLERANCE,
    Demand,
    LmiAnswer,
    LmiOptions,
    solve_once,
)

Matrix = NDArray[np.float64]

# Rounds of solving, and the noise on all states that each adds for the H2 norm, as a share of
# the disturbance. Without it Y is singular where w excites little, and with no pole region
# the optimal gain does not depend on it.
_NOISE = (1e-1, 1e-2, 1e-3, 1e-4, 1e-4)
# With more slack than this the gain of least effort is taken as it is.
_COARSE = 1e-2
# Steps along the line from the best gain to one of less effort.
_HALVINGS = 14


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
    frame = older = Frame.plain(p, first if 0 < first < math.inf else 1.0)
    best: LmiAnswer | None = None
    history: list[dict[str, Any]] = []
    for number, noise in enumerate(_NOISE, start=1):
        if options.remaining() <= 0:
            break
        solved = _solve_somehow(p, options, frame, older, noise, history)
        history[-1]["step"] = f"inequalities, round {number}"
        if solved is None:
            break
        answer, older, frame = solved[0], frame, solved[1]
        settled = best is not None and _settled(answer, best, options)
        if best is None or answer.achieved < best.achieved:
            best = answer
        if settled:
            break
    if best is None or not math.isfinite(best.achieved):
        return None, history
    if options.norm == "h2":
        # The smallest bound of (10.28) for this gain, without noise, is the Gramian's.
        return replace(best, claimed=best.achieved), history
    return _tamed(p, options, frame, best, history), history


def _solve_somehow(
    p: StateFeedbackProblem,
    options: LmiOptions,
    frame: Frame,
    older: Frame,
    noise: float,
    history: list[dict[str, Any]],
) -> tuple[LmiAnswer, Frame] | None:
    """Solve in the new frame; where the solver breaks down, more plainly, then in the old."""
    plain = frame.without_congruence()
    attempts = (
        (frame, SOLVER_TOLERANCE),
        (plain, EASED_TOLERANCE),
        (replace(plain, T=older.T), SOLVER_TOLERANCE),
    )
    result = None
    for attempt, tolerance in attempts:
        result = solve_once(p, options, attempt, Demand(noise=noise), history, tolerance)
        if result is not None or options.remaining() <= 0:
            break
    return result


def _settled(answer: LmiAnswer, best: LmiAnswer, options: LmiOptions) -> bool:
    """Whether the answer agrees with the best so far, and its claim with its achievement."""
    near = 0.1 * options.slack
    if not abs(answer.achieved / best.achieved - 1) < near:
        return False
    # With noise the claim is for a larger norm.
    return options.norm == "h2" or abs(answer.claimed / answer.achieved - 1) < near


def _tamed(
    p: StateFeedbackProblem,
    options: LmiOptions,
    frame: Frame,
    best: LmiAnswer,
    history: list[dict[str, Any]],
) -> LmiAnswer:
    """Give `slack` of the norm away for a smaller effort.

    The gain often grows without limit towards the optimum. A gain of small effort under
    twice the slack is joined to the best one by a line in (Y, M), along which the
    inequalities hold, and the last point of that line within the slack is taken.
    """
    if p.nu == 0 or options.remaining() <= 0:
        return best
    # Far from the optimum the gain itself can be minimised, near it only the effort.
    gain = (float(np.linalg.norm(best.F, 2)) or None) if options.slack > _COARSE else None
    plain = frame.without_congruence()
    attempts = (
        (frame, 2, SOLVER_TOLERANCE),
        (plain, 2, EASED_TOLERANCE),
        (plain, 0, max(10 * options.slack, EASED_TOLERANCE)),
    )
    solved, limit = None, best.achieved
    for attempt, share, tolerance in attempts:
        limit = best.achieved * (1 + share * options.slack)
        # The last resort is an inner point: the norm minimised with a loose tolerance.
        demand = Demand(limit=limit, gain=gain) if share else Demand()
        solved = solve_once(p, options, attempt, demand, history, tolerance)
        history[-1]["step"] = "smallest effort near the optimum"
        if solved is not None and math.isfinite(solved[0].achieved):
            break
    if solved is None:
        return best
    claim = best.achieved * (1 + options.slack)
    end = solved[0]
    if options.slack > _COARSE and end.achieved <= limit * (1 + options.slack):
        return replace(end, claimed=max(limit, end.achieved))
    chosen, low, high = best, 0.0, 1.0
    share = 1.0
    for _ in range(_HALVINGS):
        Y = (1 - share) * best.Y + share * end.Y
        M = (1 - share) * best.F @ best.Y + share * end.F @ end.Y
        try:
            F: Matrix = np.linalg.solve(Y, M.T).T.astype(float)
        except linalg.LinAlgError:
            break
        achieved = options.judged(p, F)
        if achieved <= claim:
            chosen, low = LmiAnswer(F, claim, achieved, Y), share
        else:
            high = share
        share = (low + high) / 2
        if low == high:
            break
    return chosen
