"""A smaller gain for a little of the norm."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from robustpolish.synthesis.lmi.state.frames import Frame
from robustpolish.synthesis.lmi.state.programs import (
    EASED_TOLERANCE,
    Demand,
    LmiAnswer,
    LmiOptions,
    solve_once,
)
from robustpolish.synthesis.problem.state_feedback_problem import StateFeedbackProblem

Matrix = NDArray[np.float64]

# With more slack than this the gain of least effort is taken as it is.
_COARSE = 1e-2
# Steps along the line from the best gain to one of less effort.
_HALVINGS = 14


def tamed(
    p: StateFeedbackProblem,
    options: LmiOptions,
    frame: Frame,
    best: LmiAnswer,
    estimate: float,
    history: list[dict[str, Any]],
) -> LmiAnswer:
    """Give the slack away for a smaller effort.

    The gain often grows without limit towards the optimum, until it is too large for its
    loop to be computed. A gain of small effort under twice the slack is joined to the best one by a
    line in (Y, M), along which the inequalities hold, and the last point of that line within the
    slack is taken.

    Parameters
    ----------
    p : StateFeedbackProblem
    options : LmiOptions
    frame : Frame
        Of the next solve.
    best : LmiAnswer
        The smallest norm achieved so far.
    estimate : float
        Where the solver sees the optimum: at most the norm of `best`.
    history : list of dict

    Returns
    -------
    LmiAnswer
        `best` itself if nothing better is found.
    """
    for base in dict.fromkeys((estimate, best.achieved)):
        if p.nu == 0 or options.remaining() <= 0:
            break
        end, limit = _least_effort(p, options, frame, best, base, history)
        if end is None:
            continue
        if options.slack > _COARSE and end.achieved <= limit * (1 + options.slack):
            return replace(end, claimed=max(limit, end.achieved))
        found = _along_the_line(p, options, best, end, base)
        if found is not best:
            return found
    return best


def _least_effort(
    p: StateFeedbackProblem,
    options: LmiOptions,
    frame: Frame,
    best: LmiAnswer,
    base: float,
    history: list[dict[str, Any]],
) -> tuple[LmiAnswer | None, float]:
    # Far from the optimum the gain itself can be minimised, near it only the effort.
    gain = (float(np.linalg.norm(best.F, 2)) or None) if options.slack > _COARSE else None
    plain = frame.without_congruence()
    attempts = (
        (frame, 2, EASED_TOLERANCE),
        (plain, 2, 10 * EASED_TOLERANCE),
        (plain, 0, max(10 * options.slack, EASED_TOLERANCE)),
    )
    limit = base
    for attempt, share, tolerance in attempts:
        limit = base * (1 + share * options.slack)
        # The last resort is an inner point: the norm minimised with a loose tolerance.
        demand = Demand(limit=limit, gain=gain) if share else Demand()
        solved = solve_once(p, options, attempt, demand, history, tolerance)
        history[-1]["step"] = "smallest effort near the optimum"
        if solved is not None and math.isfinite(solved[0].achieved):
            return solved[0], limit
    return None, limit


def _along_the_line(
    p: StateFeedbackProblem, options: LmiOptions, best: LmiAnswer, end: LmiAnswer, base: float
) -> LmiAnswer:
    """Return the last point within the slack; without one, the point of the smallest norm."""
    claim = base * (1 + options.slack)
    # A norm below the optimum is a rounding error of a loop with too large a gain.
    floor = base * (1 - options.slack)
    chosen, low, high, share = best, 0.0, 1.0, 1.0
    for _ in range(_HALVINGS):
        Y = (1 - share) * best.Y + share * end.Y
        M = (1 - share) * best.F @ best.Y + share * end.F @ end.Y
        try:
            F: Matrix = np.linalg.solve(Y, M.T).T.astype(float)
        except linalg.LinAlgError:
            break
        achieved = options.judged(p, F)
        if achieved < floor:
            achieved = math.inf
        if achieved <= claim:
            chosen, low = LmiAnswer(F, claim, achieved, Y), share
        else:
            high = share
            if achieved < chosen.achieved and chosen.achieved > claim:
                chosen = LmiAnswer(F, achieved, achieved, Y)
        share = (low + high) / 2
        if low == high:
            break
    return chosen
