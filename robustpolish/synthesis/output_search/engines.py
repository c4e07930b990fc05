"""The engines by name, and the order in which "auto" calls them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robustpolish.synthesis.certificate.certificate import Norm
from robustpolish.synthesis.lmi.options import LmiOptions
from robustpolish.synthesis.lmi.output.engine import solve_lmi
from robustpolish.synthesis.output_search.candidates import Candidate, Findings
from robustpolish.synthesis.output_search.slycot_engine import solve_slycot
from robustpolish.synthesis.problem.deadline import Deadline
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.solver_plant import SolverPlant
from robustpolish.synthesis.riccati.output_h2 import cancel_feedthrough, minimise_h2
from robustpolish.synthesis.riccati.output_hinf import descend
from robustpolish.validation import described, invalid

METHODS = ("auto", "riccati", "lmi", "slycot")
# Inequalities for more states take longer than a call of "auto" is expected to.
_LMI_STATES = 14


@dataclass(frozen=True)
class Settings:
    """What the user asks of the engines."""

    norm: Norm
    method: str
    backend: str
    solver: str | None
    tolerance: float


def run_engines(
    problem: SolverPlant, settings: Settings, regular: bool, deadline: Deadline
) -> list[Findings]:
    """Run the engines that the settings ask for on one plant.

    Parameters
    ----------
    problem : SolverPlant
    settings : Settings
    regular : bool
        Whether D12 and D21 have full rank.
    deadline : Deadline
    """
    if settings.norm == "h2":
        return _run_h2(problem.matrices, settings, regular, deadline)
    plant = problem.matrices
    options = LmiOptions(settings.backend, settings.solver, deadline)
    if settings.method == "lmi":
        return [solve_lmi(plant, "hinf", options)]
    if settings.method == "slycot":
        return [solve_slycot(plant, "hinf", deadline, not regular)]
    first = descend(plant, deadline)
    if settings.method == "riccati" or first.converged or first.falling:
        return [first]
    if plant.A.shape[0] > _LMI_STATES or deadline.expired:
        return [first]
    return [first, solve_lmi(plant, "hinf", options)]


def _run_h2(
    plant: PlantMatrices, settings: Settings, regular: bool, deadline: Deadline
) -> list[Findings]:
    if plant.discrete and settings.method in ("lmi", "slycot"):
        raise invalid(
            "method",
            described(f"{settings.method!r} for the H2 norm of a discrete-time plant"),
            "'riccati' or 'auto'",
            "Only the Riccati equations are written for it.",
        )
    closed, feedback = cancel_feedthrough(plant)
    if settings.method == "lmi":
        options = LmiOptions(settings.backend, settings.solver, deadline)
        searches = [solve_lmi(closed, "h2", options, regular)]
    elif settings.method == "slycot":
        searches = [solve_slycot(closed, "h2", deadline, not regular)]
    else:
        searches = [minimise_h2(closed, deadline)]
    if feedback.any():
        for found in searches:
            found.candidates = [_added(c, feedback) for c in found.candidates]
    return searches


def _added(candidate: Candidate, feedback: np.ndarray) -> Candidate:
    """Return the candidate together with the static controller that cancels D11."""
    K = candidate.controller
    total = K._replace(D=K.D + feedback)
    return Candidate(total, candidate.achieved, candidate.claimed, candidate.origin)
