"""The driver of all designs of prescribed structure: search part by part, join, certify."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from robustpolish.analysis import h2_norm, hinf_norm
from robustpolish.deadline import ends_with
from robustpolish.errors import SolverError
from robustpolish.long_calls import Budget, working
from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.certificate.certificate import certify
from robustpolish.synthesis.design.design import Design
from robustpolish.synthesis.design.status import Status
from robustpolish.synthesis.problem.decoupling import PlantPart
from robustpolish.synthesis.problem.fixed_modes import refuse_unstable
from robustpolish.synthesis.structured_search.part_search import design_part
from robustpolish.synthesis.structured_search.policy import POLICY
from robustpolish.synthesis.structured_search.structure import (
    Norm,
    PartDesign,
    PartProblem,
    Structure,
)
from robustpolish.validation import one_of, positive

_BOUND_THE_GAIN = (
    "Bound the gain (gain_bound), or price u and add noise to y (control_weight, "
    "measurement_noise)."
)


@dataclass(frozen=True, eq=False)
class Orders:
    """What every structured method is told about the search, checked.

    Attributes
    ----------
    budget : Budget
    seed : int
    target : float
        A norm that is good enough.
    """

    budget: Budget
    seed: int
    target: float = 0.0

    @classmethod
    def checked(
        cls, norm: Norm, time_limit: float, seed: int, target: float = 0.0, effort: float = 1.0
    ) -> Orders:
        """Check the arguments that all methods share, and start the clock of the safety net."""
        one_of("norm", norm, ("hinf", "h2"))
        budget = Budget.before_a_proof(
            effort * POLICY.work, positive("time_limit", time_limit, "s")
        )
        return cls(budget, seed, positive("target", target, zero=True))


def checked_bound(gain_bound: float | None) -> float | None:
    """Return a bound on the gain, which has to be positive if there is one."""
    return None if gain_bound is None else positive("gain_bound", gain_bound)


def design_structured(
    plant: GeneralizedPlant,
    whole: GeneralizedPlant,
    parts: Sequence[PlantPart],
    structure: Structure,
    norm: Norm,
    orders: Orders,
) -> Design:
    """Design a controller of a structure, part by part, and certify it for the whole plant.

    Parameters
    ----------
    plant : GeneralizedPlant
        As it was given.
    whole : GeneralizedPlant
        With prices and noise: what the design is certified for.
    parts : sequence of PlantPart
        The parts of `whole` that the structure does not join.
    structure : Structure
    norm : {"hinf", "h2"}
    orders : Orders

    Raises
    ------
    InfeasibleError
        If a part without anything to choose is unstable.
    SolverError
        If nothing was found, or its certificate fails.
    """
    problems = [structure.problem(part) for part in parts]
    for part, problem in zip(parts, problems, strict=True):
        if problem is None:
            refuse_unstable(part.plant)
    with working("Searching a controller"), ends_with(orders.budget):
        designs = _design_parts(problems, orders)
    late = orders.budget.late
    controller, details = structure.join(whole, parts, designs)
    found = [design for design in designs if design is not None]
    with ends_with(orders.budget):
        certificate = certify(whole, controller, norm)
    if not certificate.valid:
        raise SolverError(
            "The controller that was found could not be certified: "
            + "; ".join(certificate.reasons)
            + ". "
            + _BOUND_THE_GAIN
        )
    status, message = _verdict(found, certificate.achieved, late)
    measured: Any = certificate.achieved
    if plant is not whole:  # without the price and noise that were asked for
        loop = plant.closed_loop(controller)
        measured = hinf_norm(loop) if norm == "hinf" else h2_norm(loop)
    return Design(
        plant=whole,
        controller=controller,
        closed_loop=whole.closed_loop(controller),
        norm=norm,
        status=status,
        message=message,
        certificate=certificate,
        method=structure.method,
        backend="scipy",
        elapsed=orders.budget.elapsed,
        history=tuple({"part": i, **entry} for i, d in enumerate(found) for entry in d.history),
        details=MappingProxyType(
            {
                "plain_norm": float(measured),
                "descents": sum(d.descents for d in found),
                "part_norms": tuple(d.norm for d in found),
                **details,
            }
        ),
        lower_bound=0.0 if certificate.achieved == 0 else None,
    )


def _design_parts(
    problems: Sequence[PartProblem | None], orders: Orders
) -> list[PartDesign | None]:
    """Solve identical problems once, each with the share of the work that its size asks for."""
    different = {problem.key: problem for problem in problems if problem is not None}
    left = sum(problem.objective.work for problem in different.values())
    done: dict[tuple[bytes, ...], PartDesign] = {}
    for key, problem in different.items():
        budget = orders.budget.share(problem.objective.work / left)
        done[key] = design_part(problem, budget, orders.seed, orders.target)
        left -= problem.objective.work
    return [None if problem is None else done[problem.key] for problem in problems]


def _verdict(designs: Sequence[PartDesign], achieved: float, late: bool) -> tuple[Status, str]:
    if achieved == 0:
        return "optimal", "The disturbances do not reach the performance outputs at all."
    falls = "The norm keeps falling as the gain grows; the search was stopped at a large gain. "
    growing = any(d.at_ceiling for d in designs)
    if late:
        return "time_limit", (
            "The best certified controller when time ran out. Raise time_limit, or pass this "
            "controller as initial. " + (falls + _BOUND_THE_GAIN if growing else "")
        ).rstrip()
    if growing:
        return "infimum_not_attained", falls + _BOUND_THE_GAIN
    worst = min(designs, key=lambda d: d.agreeing / max(1, d.descents), default=None)
    if worst is None:
        return "suboptimal", "Nothing to control: the loop is the open loop."
    spent = " The work of one search was spent." if any(d.reason == "work" for d in designs) else ""
    return "suboptimal", (
        f"A local minimum; {worst.agreeing} of {worst.descents} descents ended there.{spent} "
        "Another seed may find a lower one, or this controller passed as initial."
    )
