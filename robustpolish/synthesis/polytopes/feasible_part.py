"""Why there is no gain for a polytope: a vertex that none stabilises, or a polytope too large."""

from __future__ import annotations

from dataclasses import replace

from robustpolish.errors import InfeasibleError
from robustpolish.synthesis.lmi.semidefinite import ProgramSolver
from robustpolish.synthesis.polytopes.loops import state_loop
from robustpolish.synthesis.polytopes.policy import POLICY
from robustpolish.synthesis.polytopes.proof import prove
from robustpolish.synthesis.polytopes.state_gain import GainProblem, candidates
from robustpolish.synthesis.polytopes.vertices import Polytope, shrunk_matrices
from robustpolish.synthesis.problem.preflight import diagnose


def refused_vertices(whole: Polytope) -> None:
    """Refuse a polytope with a vertex that no controller stabilises.

    Raises
    ------
    InfeasibleError
        It names the vertex and the mode.
    """
    for name, plant in zip(whole.names, whole.plants, strict=True):
        modes = [mode for mode in diagnose(plant).fixed_modes if mode.exact]
        if modes:
            listed = "; ".join(str(mode) for mode in modes)
            raise InfeasibleError(
                f"No controller stabilises the vertex {name} because of the {listed}. To go on, "
                "add an actuator or sensor that reaches it, or exclude this vertex.",
                [mode.eigenvalue for mode in modes],
            )


def share_with_gain(problem: GainProblem, solver: ProgramSolver) -> float:
    """Return for which part of a polytope, shrunk towards its middle, there is a proven gain.

    Parameters
    ----------
    problem : GainProblem
    solver : ProgramSolver
    """
    low, high = 0.0, 1.0
    for _ in range(POLICY.shrinkings):
        share = (low + high) / 2
        part = replace(problem, plants=shrunk_matrices(problem.plants, share))
        low, high = (share, high) if _has_gain(part, solver) else (low, share)
    return low


def _has_gain(problem: GainProblem, solver: ProgramSolver) -> bool:
    """Say whether there is a gain that is proven: beyond the last one programs claim huge gains."""
    found = next(candidates(problem, solver), None)
    if found is None:
        return False
    loops = [state_loop(p, F) for p, F in zip(problem.plants, found.gains, strict=True)]
    return prove(loops, problem.question, solver, found.claimed) is not None
