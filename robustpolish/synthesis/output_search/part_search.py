"""The search on one decoupled part of a plant: scaled, shortened where it is large, solved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.long_calls import Budget, step_cost
from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.design.wanted_norm import out_of_reach
from robustpolish.synthesis.output_search.engine import Found, Settings, Task, examine
from robustpolish.synthesis.output_search.engines import ORDER
from robustpolish.synthesis.output_search.policy import POLICY
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.preflight import Preflight
from robustpolish.synthesis.problem.scaling import SolverPlant
from robustpolish.synthesis.problem.truncation import truncated
from robustpolish.synthesis.riccati.infimum import (
    LowerBound,
    estimated_bound,
    is_out_of_reach,
    lower_bound,
)
from robustpolish.synthesis.riccati.lqg import cancel_feedthrough, h2_lower_bound


@dataclass(frozen=True, eq=False)
class PartSearch:
    """One part in the units of the engines, what they found, and the work left to choose.

    Attributes
    ----------
    part : SolverPlant
    settings : Settings
    diagnosis : Preflight
    budget : Budget
    problem : Task
        Of fewer states than the part where that is harmless.
    searches : tuple of Found
    """

    part: SolverPlant
    settings: Settings
    diagnosis: Preflight
    budget: Budget
    problem: Task
    searches: tuple[Found, ...]

    @classmethod
    def of(
        cls,
        plant: GeneralizedPlant,
        settings: Settings,
        diagnosis: Preflight,
        budget: Budget,
        shorten: bool = True,
    ) -> PartSearch:
        """Scale a part, bound its norm from below and let the engines search.

        Parameters
        ----------
        plant : GeneralizedPlant
        settings : Settings
        diagnosis : Preflight
        budget : Budget
        shorten : bool
            Whether states that hardly count may be left out of a large plant.
        """
        norm, work = settings.norm, budget.share(POLICY.search_share)
        part = SolverPlant.of(plant, mapped=norm == "hinf")
        wanted = settings.wanted.in_unit(part.norm(1.0, norm))
        stated = _stated(part.matrices, settings, work, shorten)
        bound = stated.bound
        if bound is not None and bound.value > wanted.below and bound.proven:
            raise out_of_reach(settings.wanted, part.norm(bound.value, norm), norm, bound.how)
        regular, tolerance = diagnosis.regular_feedthrough, settings.tolerance
        problem = Task(stated.plant, norm, regular, tolerance, bound, wanted)
        searches: list[Found] = []
        for engine in (kind(settings) for kind in ORDER[norm, settings.method]):
            if any(found.best <= problem.goal for found in searches):
                break
            if engine.adds(problem, searches):
                searches.append(engine.search(problem, work))
        if stated.remark:
            if not _is_harmless(problem, searches, part.matrices, work):
                return cls.of(plant, settings, diagnosis, budget, shorten=False)
            searches[0].remarks.append(stated.remark)
        if work.exhausted:
            searches[-1].remarks.append("The work allowed was spent; allow more with effort.")
        best = min(found.best for found in searches)
        if bound is not None and best < bound.value * (1 - POLICY.spoilt):
            problem = replace(problem, bound=None)
        if stated.feedback is not None and stated.feedback.any():
            problem = replace(problem, plant=part.matrices)
            for found in searches:
                found.candidates = [c.beside(stated.feedback) for c in found.candidates]
        return cls(part, settings, diagnosis, budget, problem, tuple(searches))

    @property
    def shortened(self) -> bool:
        """Whether states were left out."""
        return self.problem.plant.nx < self.part.matrices.nx

    def with_all_states(self) -> PartSearch:
        """Search again, with the states that were left out."""
        given = self.part.original, self.settings, self.diagnosis, self.budget
        return PartSearch.of(*given, shorten=False)

    @property
    def best(self) -> float:
        """The smallest norm found, in the plant's units; zero if none was found."""
        found = min((search.best for search in self.searches), default=np.inf)
        return self.part.norm(found, self.problem.norm) if np.isfinite(found) else 0.0


class _Stated(NamedTuple):
    """The plant that is searched, and a norm below which none of its loops comes.

    ``feedback`` cancels a feedthrough; ``remark`` tells what was left out, "" for nothing.
    """

    plant: PlantMatrices
    bound: LowerBound | None
    feedback: Matrix | None = None
    remark: str = ""


def _stated(plant: PlantMatrices, settings: Settings, budget: Budget, shorten: bool) -> _Stated:
    """Bound the norm from below, without the feedthrough or without what hardly counts."""
    if settings.norm == "h2":
        plant, feedback = cancel_feedthrough(plant)
        return _Stated(plant, h2_lower_bound(plant), feedback)
    accuracy = POLICY.bound_accuracy * min(settings.tolerance, 1e-2)
    if shorten and plant.nx > POLICY.truncated_states:
        short = _shortened(plant, settings.tolerance, accuracy, budget)
        if short is not None:
            return short
    return _Stated(plant, lower_bound(plant, accuracy, budget))


def _shortened(
    plant: PlantMatrices, tolerance: float, accuracy: float, budget: Budget
) -> _Stated | None:
    """Leave out what hardly counts; None unless the bound holds for the whole plant too."""
    short = truncated(plant)
    if short is None:
        return None
    bound = estimated_bound(short.plant, accuracy, budget)
    budget.spend(step_cost(plant.nx))
    if bound is None or not is_out_of_reach(plant, bound.value * (1 - tolerance / 10)):
        return None
    few = f"of {short.plant.nx} of the {plant.nx} states"
    remark = (
        f"The equations are {few}; the others change the response by at most {short.error:.2g} in "
        "scaled units (Hankel bound)."
    )
    bound = bound._replace(how=f"{bound.how} {few}", proven=False)
    return _Stated(short.plant, bound, remark=remark)


def _is_harmless(
    problem: Task, searches: Sequence[Found], whole: PlantMatrices, budget: Budget
) -> bool:
    """Tell whether the best loop has the same norm with the whole plant."""
    candidates = [c for found in searches for c in found.candidates]
    best = min(candidates, key=lambda c: c.achieved, default=None)
    if best is None:
        return False
    true = replace(problem, plant=whole)
    seen = examine(true, best.controller, best.claimed, best.origin, budget)
    return seen is not None and (
        abs(seen.achieved - best.achieved) <= POLICY.harmless * best.achieved
    )
