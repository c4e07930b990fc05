"""State feedback by linear matrix inequalities, solved again in better coordinates."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from robustpolish.synthesis.affine import Affine, symmetric_block
from robustpolish.synthesis.full_state.frames import Frame
from robustpolish.synthesis.full_state.inequalities import (
    gain_inequality,
    h2_inequality,
    hinf_inequality,
    region_inequalities,
)
from robustpolish.synthesis.full_state.problem import StateFeedbackProblem
from robustpolish.synthesis.pole_regions import PoleRegion
from robustpolish.synthesis.semidefinite import SemidefiniteProgram

Matrix = NDArray[np.float64]

_SOLVER_TOLERANCE = 1e-9
_EASED_TOLERANCE = 1e-7
# Rounds of solving, and the noise on all states that each adds for the H2 norm, as a share of
# the disturbance. Without it Y is singular where w excites little, and with no pole region
# the optimal gain does not depend on it.
_NOISE = (1e-1, 1e-2, 1e-3, 1e-4, 1e-4)
# With more slack than this the gain of least effort is taken as it is.
_COARSE = 1e-2
# Steps along the line from the best gain to one of less effort.
_HALVINGS = 14


@dataclass(frozen=True, eq=False)
class LmiOptions:
    """How inequalities are solved.

    Attributes
    ----------
    norm : {"hinf", "h2"}
    backend : str
    solver : str or None
    regions : sequence of PoleRegion
        In the problem's unit of time.
    slack : float
        Relative distance from the optimum that is given away for a smaller effort.
    remaining : callable
        Seconds that are left.
    """

    norm: str
    backend: str = "cvxpy"
    solver: str | None = None
    regions: Sequence[PoleRegion] = ()
    slack: float = 2e-5
    remaining: Callable[[], float] = field(default=lambda: math.inf)

    def judged(self, p: StateFeedbackProblem, F: Matrix) -> float:
        """Return the norm that a gain achieves; infinite outside the regions."""
        achieved = p.achieved(F, self.norm)
        if math.isfinite(achieved) and self.regions:
            poles = np.linalg.eigvals(p.A + p.B2 @ F)
            if not all(region.contains(poles) for region in self.regions):
                return math.inf
        return achieved


@dataclass(frozen=True, eq=False)
class LmiAnswer:
    """A gain, what was claimed for it and what it achieves.

    Attributes
    ----------
    F : ndarray
    claimed, achieved : float
    Y : ndarray
        The inverse of the Lyapunov matrix, in the problem's states.
    """

    F: Matrix
    claimed: float
    achieved: float
    Y: Matrix


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
        (frame, _SOLVER_TOLERANCE),
        (plain, _EASED_TOLERANCE),
        (replace(plain, T=older.T), _SOLVER_TOLERANCE),
    )
    result = None
    for attempt, tolerance in attempts:
        result = _solve(p, options, attempt, history, noise=noise, tolerance=tolerance)
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
    limit = best.achieved * (1 + 2 * options.slack)
    # Far from the optimum the gain itself can be minimised, near it only the effort.
    gain = (float(np.linalg.norm(best.F, 2)) or None) if options.slack > _COARSE else None
    solved = _solve(p, options, frame, history, limit=limit, gain=gain)
    if solved is None:
        eased = frame.without_congruence()
        solved = _solve(
            p, options, eased, history, limit=limit, gain=gain, tolerance=_EASED_TOLERANCE
        )
    history[-1]["step"] = "smallest effort near the optimum"
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
            F = np.linalg.solve(Y, M.T).T
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


def _solve(
    p: StateFeedbackProblem,
    options: LmiOptions,
    frame: Frame,
    history: list[dict[str, Any]],
    *,
    limit: float | None = None,
    gain: float | None = None,
    noise: float = 0.0,
    tolerance: float = _SOLVER_TOLERANCE,
) -> tuple[LmiAnswer, Frame] | None:
    """Minimise the norm, or the effort under a limit of the norm, in one frame."""
    hinf = options.norm == "hinf"
    q = frame.apply(p if hinf else p.with_noise(noise))
    program = SemidefiniteProgram()
    Y, M = program.symmetric(p.nx), program.matrix(p.nu, p.nx)
    if hinf:
        square = program.scalar() if limit is None else Affine.of((limit / frame.unit) ** 2)
        hinf_inequality(program, q, Y, M, square, frame.E)
    else:
        square = h2_inequality(program, q, Y, M, frame.E)
    region_inequalities(program, q, Y, M, options.regions)
    program.positive(Y)
    if limit is None:
        program.minimise(square)
    else:
        program.minimise(_smallness(program, Y, M, frame, gain))
    remaining = options.remaining()
    solution = program.solve(
        options.backend,
        solver=options.solver,
        tolerance=tolerance,
        time_limit=remaining if math.isfinite(remaining) else None,
    )
    history.append({"solver_status": solution.status, "seconds": solution.elapsed})
    if solution.x is None:
        return None
    y, m = solution.value(Y), solution.value(M)
    claimed = frame.unit * math.sqrt(max(solution.value(square).item(), 0.0))
    try:
        F = frame.gain(y, m)
        new = frame.next(q, y, m, even_out=hinf)
    except linalg.LinAlgError:
        return None
    achieved = options.judged(p, F)
    history[-1] |= {"claimed": claimed, "achieved": achieved}
    if 0 < achieved < math.inf:
        new = replace(new, unit=achieved)
    return LmiAnswer(F, claimed, achieved, frame.T @ y @ frame.T.T), new


def _smallness(
    program: SemidefiniteProgram, Y: Affine, M: Affine, frame: Frame, gain: float | None
) -> Affine:
    """Return what is to be small: the squared gain over `gain`, or the effort F Y F'."""
    if gain is None:
        W = program.symmetric(M.shape[0])
        program.positive(symmetric_block([[W, M], [Y]]))
        return W.trace
    size = program.scalar()
    right = np.linalg.inv(frame.T)
    gain_inequality(program, Y, M, size, frame.V / gain, right, np.eye(Y.shape[0]))
    return size
