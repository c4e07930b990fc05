"""Descents on the largest norm of one controller with several machines."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.arrays import AnyVector as Vector
from robustpolish.long_calls import Budget
from robustpolish.synthesis.nonsmooth import (
    HinfMeasure,
    Measure,
    Problem,
    StabilityMeasure,
    WorstMeasure,
    bfgs,
    minimax,
)
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.static_loop import augmented
from robustpolish.synthesis.structured_search.multistart import descend_from, stabilise
from robustpolish.synthesis.structured_search.policy import POLICY as STRUCTURED
from robustpolish.synthesis.structured_search.policy import Effort
from robustpolish.synthesis.structured_search.structure import PartProblem

# Steps of a descent on a set that is still to grow, and on one that seems to be complete.
_QUICK = 50
_THOROUGH = 150
# Price of a violated requirement, of which there are none here.
_PRICE = 3.0


@dataclass(frozen=True, eq=False)
class Descent:
    """The largest norm over a set of machines, as a function of the controller's free numbers.

    Attributes
    ----------
    part : PartProblem
        The nominal plant in scaled units, with the free numbers and where to start.
    machines : tuple of PlantMatrices
        In the same units.
    """

    part: PartProblem
    machines: tuple[PlantMatrices, ...]

    @cached_property
    def problem(self) -> Problem:
        """What is minimised."""
        loops = (augmented(machine, self.part.order) for machine in self.machines)
        worst = WorstMeasure(tuple(HinfMeasure(loop) for loop in loops))
        return Problem(self.part.parametrisation, worst, (), STRUCTURED.ceilings[0])

    @cached_property
    def stability(self) -> Measure:
        """Negative where all loops are stable."""
        return WorstMeasure(tuple(self._stability(machine) for machine in self.machines))

    def _stability(self, machine: PlantMatrices) -> Measure:
        loop = augmented(machine, self.part.order)
        return StabilityMeasure.of(loop, float(np.linalg.norm(loop.A, 2)) or 1.0)

    def badness(self, K: Matrix, machine: PlantMatrices, budget: Budget) -> tuple[bool, float]:
        """Return whether a loop is unstable, and how much so, or its norm: larger is worse."""
        norm = HinfMeasure(augmented(machine, self.part.order))
        budget.spend(norm.work)
        pieces = norm.pieces(K, 0.0, ())
        if pieces:
            return False, pieces[0].value
        pieces = self._stability(machine).pieces(K, 0.0, ())
        return True, pieces[0].value if pieces else np.inf

    def lower(self, theta: Vector, budget: Budget, thorough: bool) -> tuple[Vector, float]:
        """Return better free numbers and their largest norm; infinite if some loop is unstable."""
        # Line searches try gains so wild that numbers overflow; such gains count as infinite.
        with np.errstate(over="ignore", invalid="ignore"):
            if self.problem.model(theta) is None:
                theta, _ = stabilise(self.problem, self.stability, theta, budget)
                if self.problem.model(theta) is None:
                    return theta, np.inf
            ended = minimax(self.problem, theta, budget, _QUICK)
            if thorough and ended.reason != "stationary":
                steps = STRUCTURED.iterations(theta.size)
                smooth = bfgs(
                    lambda x: self.problem.penalised(x, _PRICE),
                    ended.point, budget, self.problem.work, steps,
                )  # fmt: skip
                ended = minimax(self.problem, smooth.point, budget, _THOROUGH)
        return ended.point, float(np.exp(ended.value))

    def search(
        self, starts: Iterable[Vector], effort: Effort, budget: Budget
    ) -> tuple[Vector, float] | None:
        """Return the best of several descents; None if none made all loops stable."""
        with np.errstate(over="ignore", invalid="ignore"):
            found = descend_from(
                starts, self.problem, self.stability, effort, budget, np.random.default_rng(0)
            )
        if found.point is None or not np.isfinite(found.value):
            return None
        return found.point, float(np.exp(found.value))
