"""H2 output feedback by Riccati equations, on regularised plants where need be."""

from __future__ import annotations

import numpy as np

from robustpolish.long_calls import Budget, step_cost
from robustpolish.synthesis.output_search.engine import Engine, Found, Task, examine
from robustpolish.synthesis.output_search.policy import POLICY
from robustpolish.synthesis.problem.matrices import regularise
from robustpolish.synthesis.riccati.lqg import lqg


class Lqg(Engine):
    """One pair of Riccati equations on a regular plant.

    A singular one is regularised less and less, as for the H-infinity norm, until the norm of the
    true loop settles.
    """

    def search(self, problem: Task, budget: Budget) -> Found:
        """Minimise the H2 norm of the loop."""
        found = Found("riccati", "scipy")
        if _try(problem, 0.0, found, budget):
            return found
        quiet = 0
        norms: list[float] = []
        for epsilon in POLICY.h2_epsilons:
            if budget.over:
                break
            before = found.best
            if not _try(problem, epsilon, found, budget):
                continue
            norms.append(found.best)
            quiet = quiet + 1 if found.best > before * (1 - POLICY.h2_settled) else 0
            if quiet >= 2:
                return found
        found.falling = len(norms) > 4 and norms[-1] < POLICY.falling * norms[-5]
        return found


def _try(problem: Task, epsilon: float, found: Found, budget: Budget) -> bool:
    budget.spend(step_cost(problem.plant.nx))
    K = lqg(regularise(problem.plant, epsilon))
    origin = f"riccati, {epsilon:.1e}"
    candidate = None if K is None else examine(problem, K, np.inf, origin, budget)
    if candidate is None:
        return False
    found.candidates.append(candidate)
    note = {"epsilon": epsilon, "achieved": candidate.achieved, "gain": candidate.gain}
    found.history.append(note)
    return True
