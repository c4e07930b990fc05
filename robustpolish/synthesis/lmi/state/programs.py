"""One semidefinite program of state feedback: stated in a frame, solved, verified."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from robustpolish.synthesis.lmi.affine import Affine, symmetric_block
from robustpolish.synthesis.lmi.semidefinite import SemidefiniteProgram
from robustpolish.synthesis.lmi.state.frames import Frame
from robustpolish.synthesis.lmi.state.inequalities import (
    gain_inequality,
    h2_inequality,
    hinf_inequality,
    region_inequalities,
)
from robustpolish.synthesis.problem.pole_regions import PoleRegion
from robustpolish.synthesis.problem.state_feedback_problem import StateFeedbackProblem

Matrix = NDArray[np.float64]

SOLVER_TOLERANCE = 1e-9
EASED_TOLERANCE = 1e-7


@dataclass(frozen=True, eq=False)
class LmiOptions:
    """How inequalities are solved.

    Attributes
    ----------
    norm : {"hinf", "h2"}
    backend : str
    solver : str or None
    regions : sequence of PoleRegion
        In the problem's unit of time.
    slack : float
        Relative distance from the optimum that is given away for a smaller effort.
    remaining : callable
        Seconds that are left.
    """

    norm: str
    backend: str = "cvxpy"
    solver: str | None = None
    regions: Sequence[PoleRegion] = ()
    slack: float = 2e-5
    remaining: Callable[[], float] = field(default=lambda: math.inf)

    def judged(self, p: StateFeedbackProblem, F: Matrix) -> float:
        """Return the norm that a gain achieves; infinite outside the regions."""
        achieved = p.achieved(F, self.norm)
        if math.isfinite(achieved) and self.regions:
            poles = np.linalg.eigvals(p.A + p.B2 @ F)
            if not all(region.contains(poles) for region in self.regions):
                return math.inf
        return achieved


@dataclass(frozen=True, eq=False)
class LmiAnswer:
    """A gain, what was claimed for it and what it achieves.

    Attributes
    ----------
    F : ndarray
    claimed, achieved : float
    Y : ndarray
        The inverse of the Lyapunov matrix, in the problem's states.
    sharp : bool
        Whether it comes near what the solver takes for the optimum.
    """

    F: Matrix
    claimed: float
    achieved: float
    Y: Matrix
    sharp: bool = True


@dataclass(frozen=True, eq=False)
class Demand:
    """What one program is asked for besides the smallest norm.

    Attributes
    ----------
    noise : float
        For the H2 norm: disturbance on all states, as a share of the one that is there.
    fixed : ndarray or None
        A gain: only its Lyapunov matrix is sought.
    held : (ndarray, ndarray) or None
        left and right: the largest singular value of left F right is kept below 1, by the
        condition that is exact where Y is the identity of the frame.
    limit : float or None
        The norm is kept below it, and the effort F Y F' minimised instead.
    gain : float or None
        With `limit`: the gain over this size is minimised, not the effort.
    """

    noise: float = 0.0
    fixed: Matrix | None = None
    held: tuple[Matrix, Matrix] | None = None
    limit: float | None = None
    gain: float | None = None


def solve_once(
    p: StateFeedbackProblem,
    options: LmiOptions,
    frame: Frame,
    demand: Demand,
    history: list[dict[str, Any]],
    tolerance: float = SOLVER_TOLERANCE,
) -> tuple[LmiAnswer, Frame] | None:
    """Solve one program and judge its gain by its loop.

    Parameters
    ----------
    p : StateFeedbackProblem
    options : LmiOptions
    frame : Frame
    demand : Demand
    history : list of dict
        Gets one entry.
    tolerance : float, optional
        For the solver.

    Returns
    -------
    (LmiAnswer, Frame) or None
        The answer and the frame for the next solve; None if the solver gave nothing usable.
    """
    hinf = options.norm == "hinf"
    q = frame.apply(p if hinf else p.with_noise(demand.noise))
    program = SemidefiniteProgram()
    Y, M = _variables(program, frame, demand.fixed, p)
    limit = demand.limit
    if hinf:
        square = program.scalar() if limit is None else Affine.of((limit / frame.unit) ** 2)
        hinf_inequality(program, q, Y, M, square, frame.E)
    else:
        square = h2_inequality(program, q, Y, M, frame.E)
    region_inequalities(program, q, Y, M, options.regions)
    program.positive(Y)
    if demand.held is not None:
        left, right = demand.held[0] @ frame.V, np.linalg.inv(frame.T) @ demand.held[1]
        gain_inequality(program, Y, M, Affine.of(1.0), left, right)
    program.minimise(square if limit is None else _smallness(program, Y, M, frame, demand.gain))
    remaining = options.remaining()
    solution = program.solve(
        options.backend,
        solver=options.solver,
        tolerance=tolerance,
        time_limit=remaining if math.isfinite(remaining) else None,
    )
    history.append({"solver_status": solution.status, "seconds": solution.elapsed})
    if solution.x is None:
        return None
    y, m = solution.value(Y), solution.value(M)
    claimed = frame.unit * math.sqrt(max(solution.value(square).item(), 0.0))
    try:
        F = frame.gain(y, m)
        new = frame.next(q, y, m, even_out=hinf)
    except linalg.LinAlgError:
        return None
    achieved = options.judged(p, F)
    history[-1] |= {"claimed": claimed, "achieved": achieved}
    if 0 < achieved < math.inf:
        new = replace(new, unit=achieved)
    return LmiAnswer(F, claimed, achieved, frame.T @ y @ frame.T.T), new


def _variables(
    program: SemidefiniteProgram, frame: Frame, fixed: Matrix | None, p: StateFeedbackProblem
) -> tuple[Affine, Affine]:
    Y = program.symmetric(p.nx)
    if fixed is None:
        return Y, program.matrix(p.nu, p.nx)
    return Y, np.linalg.solve(frame.V, fixed @ frame.T) @ Y


def _smallness(
    program: SemidefiniteProgram, Y: Affine, M: Affine, frame: Frame, gain: float | None
) -> Affine:
    """Return what is to be small: the squared gain over `gain`, or the effort F Y F'."""
    if gain is None:
        W = program.symmetric(M.shape[0])
        program.positive(symmetric_block([[W, M], [Y]]))
        return W.trace
    size = program.scalar()
    right: Matrix = np.linalg.inv(frame.T).astype(float)
    gain_inequality(program, Y, M, size, frame.V / gain, right)
    return size
