"""SLICOT's routines as an engine, for comparison: their claims are remarks, not results."""

from __future__ import annotations

import numpy as np

from robustpolish.long_calls import Budget
from robustpolish.synthesis.backends.slycot_backend import synthesise
from robustpolish.synthesis.output_search.engine import Engine, Found, Task, examine
from robustpolish.synthesis.output_search.policy import POLICY
from robustpolish.synthesis.problem.matrices import Controller, regularise


class Slycot(Engine):
    """SB10AD for the H-infinity norm or SB10HD for the H2 norm.

    They find at most one controller, whose claim may be false; a remark says so.
    """

    def search(self, problem: Task, budget: Budget) -> Found:
        """Run the routine in a process of its own, which the safety net ends."""
        found = Found("slycot", "slycot")
        # The routines need D12 and D21 of full rank.
        P = regularise(problem.plant, 0.0 if problem.regular else POLICY.slycot_epsilon)
        whole = (
            P.A,
            np.hstack([P.B1, P.B2]),
            np.vstack([P.C1, P.C2]),
            np.block([[P.D11, P.D12], [P.D21, np.zeros((P.ny, P.nu))]]),
        )
        routine = "SB10AD" if problem.norm == "hinf" else "SB10HD"
        answer = synthesise(routine, (P.nx, P.nu, P.ny), whole, budget.seconds_left)
        budget.look()
        if answer.controller is None:
            found.remarks.append(f"{answer.message}.")
            return found
        claimed = np.inf if answer.gamma is None else answer.gamma
        found.history.append({"gamma": claimed, "regularised": not problem.regular})
        candidate = examine(problem, Controller(*answer.controller), claimed, routine, budget)
        if candidate is None:
            found.remarks.append(f"The controller of {routine} does not stabilise the plant.")
            return found
        found.candidates.append(candidate)
        if not candidate.honest:
            found.remarks.append(
                f"{routine} claimed a norm {candidate.achieved / claimed:.4g} times smaller than "
                "that of its loop."
            )
        return found
