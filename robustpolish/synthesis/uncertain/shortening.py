"""Controllers of few states that come near one of many."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robustpolish.errors import InfeasibleError, SolverError
from robustpolish.implementation.reduction.candidates import Reducer
from robustpolish.long_calls import Budget
from robustpolish.models.plant.blocks import matrices_of, named_system
from robustpolish.synthesis.methods.output_feedback import output_feedback
from robustpolish.synthesis.problem.matrices import Controller
from robustpolish.synthesis.uncertain.levels import Levels
from robustpolish.synthesis.uncertain.problem import RobustProblem
from robustpolish.synthesis.uncertain.responses import LoopResponses
from robustpolish.synthesis.uncertain.scaled_gain import ScaledGain, Scalings

# The share of its usual work that a search for fixed order gets, and its safety net in seconds.
_EFFORT = 0.1
_SECONDS = 300.0


def shorter(problem: RobustProblem, K: Controller, order: int) -> Iterator[Controller]:
    """Yield stabilising controllers of an order that stand for a longer one, in scaled units."""
    if len(K.A) <= order:
        yield K
        return
    plant = problem.scaled
    states = [f"xk{i}" for i in range(len(K.A))]
    named = named_system(tuple(K), 0, plant.measurement_names, plant.control_names, states)
    for candidate in Reducer(plant, named).of_order(order):
        found = Controller(*matrices_of(candidate.controller))
        loop = problem.loop(found)
        if loop is not None and loop.stable:
            yield found


def of_order(problem: RobustProblem, order: int, budget: Budget) -> Controller | None:
    """Return a controller of few states by the search for fixed order; None if it finds none."""
    share = min(max(budget.seconds_left, 1.0), _SECONDS)
    try:
        design = output_feedback(problem.scaled, order=order, effort=_EFFORT, time_limit=share)
    except (InfeasibleError, SolverError):
        return None
    return Controller(*matrices_of(design.controller))


def level_with(problem: RobustProblem, K: Controller, known: Levels) -> float:
    """Return the largest level of a controller at frequencies, by the scalings of another one."""
    loop = problem.loop(K)
    if loop is None or not loop.stable:
        return float(np.inf)
    M = LoopResponses.of(loop, known.omega).M
    scalings = Scalings(known.space.structure)
    weights = np.array([scalings.of_weights(f.x, known.space, 1.0) for f in known.found])
    squares = np.linalg.eigvalsh(ScaledGain(scalings, weights, M).H)[:, -1]
    return float(np.sqrt(max(squares.max(), 0.0)))
