"""SLICOT's routines as an engine, for comparison: their claims are remarks, not results."""

from __future__ import annotations

import numpy as np

from robustpolish.synthesis.backends.slycot_backend import synthesise
from robustpolish.synthesis.certificate.certificate import Norm
from robustpolish.synthesis.output_search.candidates import Findings, examine
from robustpolish.synthesis.problem.deadline import Deadline
from robustpolish.synthesis.problem.matrices import Controller, PlantMatrices, regularise

_EPSILON = 1e-4


def solve_slycot(
    plant: PlantMatrices, norm: Norm, deadline: Deadline, regularised: bool
) -> Findings:
    """Run SB10AD or SB10HD on a scaled plant.

    Parameters
    ----------
    plant : PlantMatrices
        Scaled; without D11 for the H2 norm.
    norm : {"hinf", "h2"}
    deadline : Deadline
    regularised : bool
        Whether to regularise the plant first, which the routines need if D12 or D21 is singular.

    Returns
    -------
    Findings
        With at most one candidate, whose claim may be false; a remark says so.
    """
    found = Findings("slycot", "slycot")
    P = regularise(plant, _EPSILON if regularised else 0.0)
    nu, ny = P.B2.shape[1], P.C2.shape[0]
    whole = (
        P.A,
        np.hstack([P.B1, P.B2]),
        np.vstack([P.C1, P.C2]),
        np.block([[P.D11, P.D12], [P.D21, np.zeros((ny, nu))]]),
    )
    routine = "SB10AD" if norm == "hinf" else "SB10HD"
    answer = synthesise(routine, (P.A.shape[0], nu, ny), whole, deadline.remaining)
    found.expired = deadline.expired
    if answer.controller is None:
        found.remarks.append(f"{answer.message}.")
        return found
    K = Controller(*answer.controller)
    claimed = np.inf if answer.gamma is None else answer.gamma
    found.history.append({"gamma": claimed, "regularised": regularised})
    candidate = examine(plant, K, claimed, routine, norm)
    if candidate is None:
        found.remarks.append(f"The controller of {routine} does not stabilise the plant.")
        return found
    found.candidates.append(candidate)
    found.converged = norm == "h2" and not regularised
    if not candidate.honest:
        found.remarks.append(
            f"{routine} claimed a norm {candidate.achieved / claimed:.4g} times smaller than that "
            "of its loop."
        )
    return found
