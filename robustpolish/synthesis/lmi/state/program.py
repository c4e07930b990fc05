"""One semidefinite program of state feedback: stated in coordinates, solved, verified."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import linalg

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.long_calls import Budget
from robustpolish.synthesis.lmi.affine import Affine, symmetric_block
from robustpolish.synthesis.lmi.semidefinite import ProgramSolver, SemidefiniteProgram
from robustpolish.synthesis.lmi.state.coordinates import Coordinates
from robustpolish.synthesis.lmi.state.inequalities import (
    gain_inequality,
    h2_inequality,
    hinf_inequality,
    region_inequalities,
)
from robustpolish.synthesis.problem.full_state import state_gain_norm, with_noise
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.state_search.engine import StateEngine, StateGain
from robustpolish.synthesis.state_search.policy import POLICY


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
        condition that is exact where Y is the identity of the coordinates.
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


@dataclass(frozen=True, eq=False)
class SolvedProgram:
    """The gain of one program and what the next one needs of it.

    Attributes
    ----------
    gain : StateGain
    Y : ndarray
        The inverse of the Lyapunov matrix, in the plant's states.
    next : Coordinates
        Those that suit the next program.
    """

    gain: StateGain
    Y: Matrix
    next: Coordinates


@dataclass(frozen=True, eq=False)
class StatePrograms:
    """The programs of one search.

    Attributes
    ----------
    plant : PlantMatrices
    engine : StateEngine
        Norm, regions, backend and solver.
    budget : Budget
    history : list of dict
        Gets one entry per program.
    """

    plant: PlantMatrices
    engine: StateEngine
    budget: Budget
    history: list[dict[str, Any]]

    def judged(self, F: Matrix) -> float:
        """Return the norm that a gain achieves; infinite outside the regions."""
        p, regions = self.plant, self.engine.regions
        achieved = state_gain_norm(p, F, self.engine.norm)
        if math.isfinite(achieved) and regions:
            poles = np.linalg.eigvals(p.A + p.B2 @ F)
            if not all(region.contains(poles) for region in regions):
                return math.inf
        return achieved

    def solve(
        self,
        coordinates: Coordinates,
        demand: Demand,
        step: str,
        tolerance: float = POLICY.solver_tolerance,
    ) -> SolvedProgram | None:
        """Solve one program and judge its gain by its loop.

        Parameters
        ----------
        coordinates : Coordinates
        demand : Demand
        step : str
            What the history says about it.
        tolerance : float, optional
            For the solver.

        Returns
        -------
        SolvedProgram or None
            None if the solver gave nothing usable.
        """
        p, engine, c = self.plant, self.engine, coordinates
        hinf = engine.norm == "hinf"
        q = c.apply(p if hinf else with_noise(p, demand.noise))
        program = SemidefiniteProgram()
        Y, M = _variables(program, c, demand.fixed, p)
        limit = demand.limit
        if hinf:
            square = program.scalar() if limit is None else Affine.of((limit / c.unit) ** 2)
            hinf_inequality(program, q, Y, M, square, c.E)
        else:
            square = h2_inequality(program, q, Y, M, c.E)
        region_inequalities(program, q, Y, M, engine.regions)
        # The inequality of the effort holds Y among its blocks: twice would double the time.
        if limit is None or demand.gain is not None:
            program.positive(Y)
        if demand.held is not None:
            left, right = demand.held[0] @ c.V, np.linalg.inv(c.T) @ demand.held[1]
            gain_inequality(program, Y, M, Affine.of(1.0), left, right)
        program.minimise(square if limit is None else _smallness(program, Y, M, c, demand.gain))
        solver = ProgramSolver(engine.backend, engine.solver, self.budget, tolerance)
        solution = solver.solve(program)
        told = {"step": step, "solver_status": solution.status, "seconds": solution.elapsed}
        self.history.append(told)
        if solution.x is None:
            return None
        y, m = solution.value(Y), solution.value(M)
        claimed = c.unit * math.sqrt(max(solution.value(square).item(), 0.0))
        try:
            F = c.gain(y, m)
            following = c.next(q, y, m, even_out=hinf)
        except linalg.LinAlgError:
            return None
        achieved = self.judged(F)
        told |= {"claimed": claimed, "achieved": achieved}
        if 0 < achieved < math.inf:
            following = replace(following, unit=achieved)
        return SolvedProgram(StateGain(F, claimed, achieved), c.T @ y @ c.T.T, following)


def _variables(
    program: SemidefiniteProgram, c: Coordinates, fixed: Matrix | None, p: PlantMatrices
) -> tuple[Affine, Affine]:
    Y = program.symmetric(p.nx)
    if fixed is None:
        return Y, program.matrix(p.nu, p.nx)
    return Y, np.linalg.solve(c.V, fixed @ c.T) @ Y


def _smallness(
    program: SemidefiniteProgram, Y: Affine, M: Affine, c: Coordinates, gain: float | None
) -> Affine:
    """Return what is to be small: the squared gain over `gain`, or the effort F Y F'."""
    if gain is None:
        W = program.symmetric(M.shape[0])
        program.positive(symmetric_block([[W, M], [Y]]))
        return W.trace
    size = program.scalar()
    right: Matrix = np.linalg.inv(c.T).astype(float)
    gain_inequality(program, Y, M, size, c.V / gain, right)
    return size
