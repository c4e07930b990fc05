"""The two ways to minimise a norm over state feedbacks, behind one call."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robustpolish.synthesis.lmi.state.engine import minimise_norm
from robustpolish.synthesis.lmi.state.programs import LmiOptions
from robustpolish.synthesis.problem.pole_regions import PoleRegion
from robustpolish.synthesis.problem.state_feedback_problem import StateFeedbackProblem
from robustpolish.synthesis.riccati.state import game_gain, lqr_gain, minimise_hinf

Matrix = NDArray[np.float64]

# Width of the Riccati bracket as a share of the slack that is given away afterwards.
_BRACKET = 1e-2


@dataclass(frozen=True, eq=False)
class Engine:
    """How norms are minimised.

    Attributes
    ----------
    norm : {"hinf", "h2"}
    method : {"lmi", "riccati"}
    backend, solver : str, str or None
        For method "lmi".
    tolerance : float
        Relative; a fifth of it is given away for a smaller gain.
    remaining : callable
        Seconds that are left.
    """

    norm: str
    method: str
    backend: str = "cvxpy"
    solver: str | None = None
    tolerance: float = 1e-4
    remaining: Callable[[], float] = field(default=lambda: math.inf)

    def relaxed(self, factor: float) -> Engine:
        """Return the engine with a tolerance larger by `factor`."""
        return replace(self, tolerance=self.tolerance * factor)


@dataclass(frozen=True, eq=False)
class Answer:
    """A gain with a norm that was computed from its loop, and how it was found.

    Attributes
    ----------
    F : ndarray, shape (nu, nx)
    claimed, achieved : float
    history : tuple of dict
    sharp : bool
        Whether it is within the tolerance of the optimum, as far as the method can tell.
    """

    F: Matrix
    claimed: float
    achieved: float
    history: tuple[dict[str, Any], ...] = ()
    sharp: bool = True


def minimise(
    engine: Engine, problem: StateFeedbackProblem, regions: Sequence[PoleRegion] = ()
) -> Answer | None:
    """Minimise the norm of a scaled problem whose D12 has full column rank.

    Parameters
    ----------
    engine : Engine
    problem : StateFeedbackProblem
    regions : sequence of PoleRegion, optional
        In the problem's unit of time; for method "lmi" only.

    Returns
    -------
    Answer or None
        None if no stabilising gain was found.
    """
    if engine.method == "riccati":
        return _by_riccati(engine, problem)
    options = LmiOptions(
        engine.norm,
        engine.backend,
        engine.solver,
        regions,
        slack=0.2 * engine.tolerance,
        remaining=engine.remaining,
    )
    answer, history = minimise_norm(problem, options, lqr_gain(problem))
    if answer is None:
        return None
    claimed = max(answer.claimed, answer.achieved)
    return Answer(answer.F, claimed, answer.achieved, tuple(history), answer.sharp)


def _by_riccati(engine: Engine, problem: StateFeedbackProblem) -> Answer | None:
    if engine.norm == "h2":
        F = lqr_gain(problem)
        achieved = problem.achieved(F, "h2")
        if F is None or not math.isfinite(achieved):
            return None
        step = {"step": "linear-quadratic regulator", "achieved": achieved}
        return Answer(F, achieved, achieved, (step,))
    slack = 0.2 * engine.tolerance
    best, upper, lower = minimise_hinf(problem, _BRACKET * slack, lambda: engine.remaining() <= 0)
    if best is None:
        return None
    step = {"step": "bisection on gamma", "achieved": upper, "no_gain_found_at": lower}
    # The gain often grows without limit towards the optimum, so a little is given away.
    for share in (slack, 2.5 * slack, 5 * slack):
        claim = upper * (1 + share)
        tamed = game_gain(problem, claim)
        achieved = problem.achieved(tamed, "hinf")
        if tamed is not None and achieved <= claim * (1 + 1e-9):
            return Answer(tamed, max(claim, achieved), achieved, (step,))
    return Answer(best, upper, problem.achieved(best, "hinf"), (step,))
