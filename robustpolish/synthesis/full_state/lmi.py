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
from robustpolish.synthesis.full_state.inequalities import (
    h2_inequality,
    hinf_inequality,
    region_inequalities,
)
from robustpolish.synthesis.full_state.problem import StateFeedbackProblem
from robustpolish.synthesis.pole_regions import PoleRegion
from robustpolish.synthesis.semidefinite import SemidefiniteProgram

Matrix = NDArray[np.float64]

_ROUNDS = 5
_SOLVER_TOLERANCE = 1e-9
_EASED_TOLERANCE = 1e-7
# Eigenvalues of Y below this share of the largest are rounding errors of the solver.
_SMALLEST_SHARE = 1e-13


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


@dataclass(frozen=True, eq=False)
class _Frame:
    """Coordinates of one solve: x = T x_new, u = V u_new, rows times E, norms over `unit`."""

    T: Matrix
    V: Matrix
    E: Matrix
    unit: float


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
    frame = _Frame(np.eye(p.nx), np.eye(p.nu), np.eye(p.nx), first if 0 < first < math.inf else 1.0)
    older = frame
    best: LmiAnswer | None = None
    history: list[dict[str, Any]] = []
    for number in range(1, _ROUNDS + 1):
        if options.remaining() <= 0:
            break
        answer, new_frame, entry = _solve_somehow(p, options, frame, older)
        older = frame
        history.append({"step": f"inequalities, round {number}", **entry})
        if answer is None or new_frame is None:
            break
        settled = best is not None and _settled(answer, best, options.slack)
        if best is None or answer.achieved < best.achieved:
            best = answer
        frame = new_frame
        if settled:
            break
    if best is None or not math.isfinite(best.achieved):
        return None, history
    tamed = _tamed(p, options, frame, best, history)
    return tamed or best, history


def _solve_somehow(
    p: StateFeedbackProblem, options: LmiOptions, frame: _Frame, older: _Frame
) -> tuple[LmiAnswer | None, _Frame | None, dict[str, Any]]:
    """Solve in the new frame; where the solver breaks down, more plainly, then half way back."""
    plain = replace(frame, E=np.eye(p.nx))
    halfway = replace(plain, T=linalg.polar(frame.T)[1] if frame is older else older.T)
    result = _solve(p, options, frame)
    for other, tolerance in ((plain, _EASED_TOLERANCE), (halfway, _SOLVER_TOLERANCE)):
        if result[0] is not None or options.remaining() <= 0:
            break
        result = _solve(p, options, other, tolerance=tolerance)
    return result


def _settled(answer: LmiAnswer, best: LmiAnswer, slack: float) -> bool:
    """Whether claim and achievement agree, and with the best so far."""
    near = 0.1 * slack
    return (
        abs(answer.claimed / answer.achieved - 1) < near
        and abs(answer.achieved / best.achieved - 1) < near
    )


def _tamed(
    p: StateFeedbackProblem,
    options: LmiOptions,
    frame: _Frame,
    best: LmiAnswer,
    history: list[dict[str, Any]],
) -> LmiAnswer | None:
    """Give `slack` of the norm away for the smallest effort; None if nothing is gained."""
    if options.norm == "h2" or p.nu == 0 or options.remaining() <= 0:
        return None
    claim = max(best.claimed, best.achieved) * (1 + options.slack)
    answer, _, entry = _solve(p, options, frame, limit=claim)
    if answer is None:
        frame = replace(frame, E=np.eye(p.nx))
        answer, _, entry = _solve(p, options, frame, limit=claim, tolerance=_EASED_TOLERANCE)
    history.append({"step": "smallest effort near the optimum", **entry})
    # The solver keeps the limit only to its tolerance; a little more is given away then.
    if answer is None or not answer.achieved <= claim * (1 + options.slack):
        return None
    return replace(answer, claimed=max(claim, answer.achieved))


def _solve(
    p: StateFeedbackProblem,
    options: LmiOptions,
    frame: _Frame,
    limit: float | None = None,
    tolerance: float = _SOLVER_TOLERANCE,
) -> tuple[LmiAnswer | None, _Frame | None, dict[str, Any]]:
    """Minimise the norm, or the effort under a limit of the norm, in one frame."""
    q = _in_frame(p, frame)
    program = SemidefiniteProgram()
    Y, M = program.symmetric(p.nx), program.matrix(p.nu, p.nx)
    if options.norm == "hinf":
        square = program.scalar() if limit is None else Affine.of((limit / frame.unit) ** 2)
        hinf_inequality(program, q, Y, M, square, frame.E)
    else:
        square = h2_inequality(program, q, Y, M, frame.E)
    region_inequalities(program, q, Y, M, options.regions)
    program.positive(Y)
    if limit is None:
        program.minimise(square)
    else:
        W = program.symmetric(p.nu)
        program.positive(symmetric_block([[W, M], [Y]]))
        program.minimise(W.trace)
    remaining = options.remaining()
    solution = program.solve(
        options.backend,
        solver=options.solver,
        tolerance=tolerance,
        time_limit=remaining if math.isfinite(remaining) else None,
    )
    entry: dict[str, Any] = {"solver_status": solution.status, "seconds": solution.elapsed}
    if solution.x is None:
        return None, None, entry
    y, m = solution.value(Y), solution.value(M)
    claimed = frame.unit * math.sqrt(max(solution.value(square).item(), 0.0))
    try:
        F = frame.V @ np.linalg.solve(y, m.T).T @ np.linalg.inv(frame.T)
        new = _next_frame(q, frame, y, m, options.norm)
    except linalg.LinAlgError:
        return None, None, entry
    achieved = p.achieved(F, options.norm)
    entry |= {"claimed": claimed, "achieved": achieved}
    if math.isfinite(achieved) and achieved > 0:
        new = replace(new, unit=achieved)
    return LmiAnswer(F, claimed, achieved, frame.T @ y @ frame.T.T), new, entry


def _in_frame(p: StateFeedbackProblem, frame: _Frame) -> StateFeedbackProblem:
    """Return the problem in a frame, where the norm of its loop is about one."""
    q = p.in_states(frame.T)
    root = math.sqrt(frame.unit)
    return replace(
        q,
        B1=q.B1 / root,
        B2=q.B2 @ frame.V,
        C=q.C / root,
        D11=q.D11 / frame.unit,
        D12=q.D12 @ frame.V / root,
    )


def _next_frame(q: StateFeedbackProblem, frame: _Frame, Y: Matrix, M: Matrix, norm: str) -> _Frame:
    """Return the frame in which Y is the identity and the inequality evened out."""
    values, vectors = np.linalg.eigh((Y + Y.T) / 2)
    values = np.maximum(values, values[-1] * _SMALLEST_SHARE)
    if not values[-1] > 0:
        raise linalg.LinAlgError("Y is not positive")
    step = vectors * np.sqrt(values)
    back = (vectors / np.sqrt(values)).T
    gains = np.linalg.norm(M @ back.T, axis=1)
    S = back @ (q.A @ Y + q.B2 @ M) @ back.T
    if q.discrete or norm == "h2":
        # For the H2 norm the inequality is tight at the optimum: nothing to even out.
        E = np.eye(q.nx)
    else:
        rates, directions = np.linalg.eigh(-(S + S.T))
        rates = np.maximum(rates, np.abs(rates).max() * _SMALLEST_SHARE)
        E = directions / np.sqrt(rates)
    size = np.where(gains > 0, gains, 1.0)
    return _Frame(frame.T @ step, frame.V * size, E, frame.unit)
