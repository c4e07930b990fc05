"""Who solves the matrix inequalities, and until when."""

from __future__ import annotations

from dataclasses import dataclass

from robustpolish.synthesis.lmi.semidefinite import SemidefiniteProgram, SemidefiniteSolution
from robustpolish.synthesis.problem.deadline import Deadline


@dataclass(frozen=True)
class LmiOptions:
    """A backend, its solver and a deadline.

    Attributes
    ----------
    backend : {"cvxpy", "picos"}
    solver : str or None
    deadline : Deadline
    accuracy : float
        Relative tolerance handed to the solver.
    """

    backend: str
    solver: str | None
    deadline: Deadline
    accuracy: float = 1e-9

    def solve(self, program: SemidefiniteProgram) -> SemidefiniteSolution:
        """Solve a program within the time that is left; without an answer its x is None."""
        seconds = self.deadline.remaining
        if seconds <= 0:
            return SemidefiniteSolution(None, "no time left", 0.0)
        return program.solve(
            self.backend, solver=self.solver, tolerance=self.accuracy, time_limit=seconds
        )
