"""State feedback under a bound on the largest singular value of the gain.

No convex condition is both necessary and sufficient for it. Priced designs that keep the bound
are the starts. From there inequalities with a condition on the gain that is exact at the last
Lyapunov matrix are solved again and again, each answer no worse than the one before; a descent on
the true norm, with the bound as a requirement, ends the search.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from robustpolish.budget import Budget
from robustpolish.synthesis.lmi.state.frames import Frame
from robustpolish.synthesis.lmi.state.programs import (
    EASED_TOLERANCE,
    Demand,
    LmiOptions,
    solve_once,
)
from robustpolish.synthesis.nonsmooth import (
    GainMeasure,
    H2Measure,
    HinfMeasure,
    MaskedGain,
    Problem,
    Requirement,
    minimax,
)
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.state_feedback_problem import StateFeedbackProblem
from robustpolish.synthesis.riccati.equations import solve_lyapunov
from robustpolish.synthesis.state_search.engines import Answer, Engine, minimise

Matrix = NDArray[np.float64]

_PRICES = tuple(10.0**k for k in range(4, -10, -1))
# Tolerance of the designs that only serve as starts.
_COARSE = 0.5
_STARTS = 2
_ROUNDS = 15
_DESCENTS = 3
# Iterations, not seconds, end a descent, so that a design can be repeated; seconds only bound it.
_ITERATIONS = 150
_SECONDS = 15.0
# Starts below this share of the bound count as small.
_SMALL = 0.5
# Share by which a descent from a small gain has to be better to be preferred.
_WORTHWHILE = 1e-3
# A step that gains less than this share ends a search.
_GAINED = 1e-5
# The bound is kept by this share, so that rounding does not break it.
_MARGIN = 1e-9
# States that w hardly reaches are still given this share of the disturbance.
_NOISE = 1e-3


@dataclass(frozen=True, eq=False)
class GainBound:
    """sigma_max(left F right) <= bound, where left F right is the gain in the plant's units.

    Attributes
    ----------
    left, right : ndarray
    bound : float
    """

    left: Matrix
    right: Matrix
    bound: float

    def size(self, F: Matrix) -> float:
        """Return the largest singular value in the plant's units."""
        return float(np.linalg.norm(self.left @ F @ self.right, 2)) if F.size else 0.0

    def inside(self, F: Matrix) -> Matrix:
        """Return F, shrunk to the bound if it is larger."""
        size, limit = self.size(F), self.bound * (1 - _MARGIN)
        return F * (limit / size) if size > limit else F


def minimise_bounded(
    engine: Engine, problem: StateFeedbackProblem, gain: GainBound, regular: bool
) -> tuple[Answer | None, bool]:
    """Minimise the norm over the gains within a bound.

    Parameters
    ----------
    engine : Engine
    problem : StateFeedbackProblem
        Scaled.
    gain : GainBound
    regular : bool
        Whether the problem has an optimum without the bound.

    Returns
    -------
    answer : Answer or None
        None if no gain within the bound was found that stabilises.
    free : bool
        Whether the bound does not matter, so that the answer is the optimum.
    """
    if regular:
        answer = minimise(engine, problem)
        if answer is not None and gain.size(answer.F) <= gain.bound:
            return answer, True
    history: list[dict[str, Any]] = []
    starts = _starts(engine, problem, gain, history)
    best: Matrix | None = None
    value = math.inf
    for start in starts[:_STARTS]:
        F = _by_inequalities(engine, problem, start, gain, history)
        achieved = problem.achieved(F, engine.norm)
        if achieved < value:
            best, value = F, achieved
    # Small gains that cancel a disturbance are found from small gains only.
    small = [F for F in starts if 0 < gain.size(F) < _SMALL * gain.bound]
    for start in small[:_STARTS]:
        F = _descended(engine, problem, start, gain, history, balanced=False)
        achieved = problem.achieved(F, engine.norm)
        if achieved < value * (1 - _WORTHWHILE):
            best, value = F, achieved
    if best is None or not math.isfinite(value):
        return None, False
    best = _descended(engine, problem, best, gain, history)
    value = problem.achieved(best, engine.norm)
    return Answer(best, value, value, tuple(history)), False


def _starts(
    engine: Engine, problem: StateFeedbackProblem, gain: GainBound, history: list[dict[str, Any]]
) -> list[Matrix]:
    """Return stabilising gains within the bound, the best first.

    They come from Riccati equations whatever the method: they are quick, and only starts.
    """
    quick = replace(engine, method="riccati", tolerance=max(engine.tolerance, _COARSE))
    idle = np.zeros((problem.nu, problem.nx))
    found: list[tuple[float, Matrix]] = [(problem.achieved(idle, engine.norm), idle)]
    for price in _PRICES:
        if engine.remaining() <= 0:
            break
        answer = minimise(quick, problem.with_price(price))
        if answer is None:
            continue
        F = gain.inside(answer.F)
        achieved = problem.achieved(F, engine.norm)
        history.append(
            {"step": "price", "price": price, "achieved": achieved, "gain": gain.size(answer.F)}
        )
        found.append((achieved, F))
    return [F for value, F in sorted(found, key=lambda pair: pair[0]) if math.isfinite(value)]


def _by_inequalities(
    engine: Engine,
    problem: StateFeedbackProblem,
    start: Matrix,
    gain: GainBound,
    history: list[dict[str, Any]],
) -> Matrix:
    """Solve the bounded inequalities around the Lyapunov matrix of the last gain, repeatedly."""
    p = problem.compressed()
    options = LmiOptions(engine.norm, engine.backend, engine.solver, remaining=engine.remaining)
    held = (gain.left / gain.bound, gain.right)
    F, value = start, p.achieved(start, engine.norm)
    for _ in range(_ROUNDS):
        if engine.remaining() <= 0 or not value > 0:
            break
        frame = Frame.plain(p, value)
        for _ in range(2):
            solved = _solve_either(p, options, frame, Demand(noise=_NOISE, fixed=F), history)
            if solved is None:
                return F
            frame = replace(solved[1], unit=value)
        solved = _solve_either(p, options, frame, Demand(noise=_NOISE, held=held), history)
        if solved is None:
            break
        new = gain.inside(solved[0].F)
        achieved = p.achieved(new, engine.norm)
        history[-1]["step"] = "inequalities with the bound"
        if not achieved < value:
            break
        gained = 1 - achieved / value
        F, value = new, achieved
        if gained < _GAINED:
            break
    return F


def _solve_either(
    p: StateFeedbackProblem,
    options: LmiOptions,
    frame: Frame,
    demand: Demand,
    history: list[dict[str, Any]],
) -> tuple[Any, Frame] | None:
    solved = solve_once(p, options, frame, demand, history)
    if solved is None:
        plain = frame.without_congruence()
        solved = solve_once(p, options, plain, demand, history, EASED_TOLERANCE)
    return solved


def _descended(
    engine: Engine,
    problem: StateFeedbackProblem,
    start: Matrix,
    gain: GainBound,
    history: list[dict[str, Any]],
    balanced: bool = True,
) -> Matrix:
    """Descend on the true norm, if asked in states in which the last loop is balanced."""
    F, value = start, problem.achieved(start, engine.norm)
    budget = Budget(seconds=min(_SECONDS, max(engine.remaining(), 0.0)))
    for _ in range(_DESCENTS):
        T, V = _coordinates(problem, F) if balanced else (np.eye(problem.nx), np.eye(problem.nu))
        q = problem.in_states(T)
        loop = PlantMatrices(
            A=q.A,
            B1=q.B1,
            B2=q.B2 @ V,
            C1=q.C,
            C2=np.eye(q.nx),
            D11=q.D11,
            D12=q.D12 @ V,
            D21=np.zeros((q.nx, q.B1.shape[1])),
            D22=np.zeros((q.nx, q.nu)),
            discrete=q.discrete,
        )
        measure = HinfMeasure(loop) if engine.norm == "hinf" else H2Measure(loop)
        back = np.linalg.inv(T)
        held = Requirement(GainMeasure(gain.left @ V, back @ gain.right), gain.bound)
        gains = MaskedGain(np.ones(F.shape, dtype=bool))
        theta = gains.coordinates(np.linalg.solve(V, F @ T))
        descent = minimax(Problem(gains, measure, (held,)), theta, budget, _ITERATIONS)
        new = gain.inside(V @ gains.gain(descent.point) @ back)
        achieved = problem.achieved(new, engine.norm)
        history.append(
            {"step": "descent on the true norm", "achieved": achieved, "ended": descent.reason}
        )
        if not achieved < value:
            break
        gained = 1 - achieved / value
        F, value = new, achieved
        if gained < _GAINED or budget.late:
            break
    return F


def _coordinates(p: StateFeedbackProblem, F: Matrix) -> tuple[Matrix, Matrix]:
    """Return states of equal variance under white noise, and controls of order one."""
    noisy = p.with_noise(_NOISE)
    W, closed = noisy.B1 @ noisy.B1.T, p.A + p.B2 @ F
    X = linalg.solve_discrete_lyapunov(closed, W) if p.discrete else solve_lyapunov(closed.T, W)
    if X is None:
        return np.eye(p.nx), np.eye(p.nu)
    values, vectors = np.linalg.eigh((X + X.T) / 2)
    T = vectors * np.sqrt(np.maximum(values, values[-1] * 1e-14))
    size = np.linalg.norm(F @ T, axis=1)
    largest = float(size.max(initial=0.0)) or 1.0
    return T, np.diag(np.maximum(size, 1e-3 * largest))
