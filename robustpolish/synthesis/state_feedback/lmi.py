"""Inequalities of state feedback."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from scipy import linalg

from robustpolish.base.arrays import EPS, SOLVED
from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.budget import Budget
from robustpolish.synthesis.lmi.program import (
    Affine,
    ProgramSolver,
    SemidefiniteProgram,
    symmetric_block,
)
from robustpolish.synthesis.problem.matrices import (
    PlantMatrices,
    compressed_outputs,
    in_states,
    state_gain_norm,
    with_noise,
    with_small_penalty,
)
from robustpolish.synthesis.problem.pole_regions import PoleRegion
from robustpolish.synthesis.state_feedback.riccati import StateEngine, StateGain, central_state_gain

# Tolerances of interior-point solvers; the second where the first makes them break down.
SOLVER_TOLERANCE, EASED_TOLERANCE = 1e-9, 1e-7
# One round of inequalities each, with this disturbance on all states over the one that is there,
# for the H2 norm. Without it Y is singular where w excites little (one axis of the bearing at
# rest), and without a pole region the optimal gain does not depend on it.
_NOISE = (1e-1, 1e-2, 1e-3, 1e-4, 1e-4)
# With more slack than this the gain of least effort is taken as it is.
_COARSE_SLACK = 1e-2

# Coordinates in which the inequalities of one solve are well conditioned.


@dataclass(frozen=True, eq=False)
class Coordinates:
    """Coordinates: x = T x_new, u = V u_new, Lyapunov rows times E, norms over `unit`.

    Attributes
    ----------
    T : ndarray, shape (nx, nx)
    V : ndarray, shape (nu, nu)
        Diagonal.
    E : ndarray, shape (nx, nx)
        A congruence: it changes the numbers that a solver sees, not the solutions.
    unit : float
    """

    T: Matrix
    V: Matrix
    E: Matrix
    unit: float

    @classmethod
    def plain(cls, p: PlantMatrices, unit: float) -> Coordinates:
        """Return the coordinates of the problem itself."""
        return cls(np.eye(p.nx), np.eye(p.nu), np.eye(p.nx), unit)

    def without_congruence(self) -> Coordinates:
        """Return the coordinates with E = I."""
        return replace(self, E=np.eye(self.T.shape[0]))

    def apply(self, p: PlantMatrices) -> PlantMatrices:
        """Return the problem in these coordinates, where its norm is about one."""
        q = in_states(p, self.T)
        root = math.sqrt(self.unit)
        return q.replace(
            B1=q.B1 / root,
            B2=q.B2 @ self.V,
            C1=q.C1 / root,
            D11=q.D11 / self.unit,
            D12=q.D12 @ self.V / root,
        )

    def gain(self, Y: Matrix, M: Matrix) -> Matrix:
        """Return F = M inv(Y) in the problem's coordinates."""
        return self.V @ np.linalg.solve(Y, M.T).T @ np.linalg.inv(self.T)

    def next(self, q: PlantMatrices, Y: Matrix, M: Matrix, even_out: bool) -> Coordinates:
        """Return the coordinates in which Y is the identity and the gain of order one.

        Parameters
        ----------
        q : PlantMatrices
            In these coordinates.
        Y, M : ndarray
            A solution in these coordinates.
        even_out : bool
            Whether E is to make the Lyapunov inequality the identity. Not for the H2 norm: there
            the inequality is tight at the optimum.

        Raises
        ------
        numpy.linalg.LinAlgError
            If Y is not positive, or if what takes us back is beyond doubles: units shrink without
            end where a gain of zero is the best.
        """
        values, vectors = np.linalg.eigh((Y + Y.T) / 2)
        if not values[-1] > 0:
            raise linalg.LinAlgError("Y is not positive")
        # Eigenvalues below this share of the largest are rounding errors of a solver.
        values = np.maximum(values, values[-1] * SOLVED)
        step = vectors * np.sqrt(values)
        back = (vectors / np.sqrt(values)).T
        gains = np.linalg.norm(M @ back.T, axis=1)
        size = np.where(gains > 0, gains, 1.0)
        E = np.eye(q.nx)
        if even_out and not q.discrete:
            S = back @ (q.A @ Y + q.B2 @ M) @ back.T
            rates, directions = np.linalg.eigh(-(S + S.T))
            rates = np.maximum(rates, np.abs(rates).max() * SOLVED)
            E = directions / np.sqrt(rates)
        T, V = self.T @ step, self.V * size
        if not all(np.isfinite(np.linalg.inv(M)).all() for M in (T, V)):
            raise linalg.LinAlgError("the coordinates are beyond doubles")
        return Coordinates(T, V, E, self.unit)


# The linear matrix inequalities of state feedback in Y and M = F Y.
#
# Equations (10.18), (10.19) for the H-infinity norm and (10.27), (10.28) for the H2 norm of the
# thesis, their discrete-time counterparts (de Oliveira, Geromel, Bernussou, IJC 75, 2002), pole
# regions and a bound on the gain. Everything is normalised so that the norm sought is about one.


def hinf_inequality(
    program: SemidefiniteProgram, p: PlantMatrices, Y: Affine, M: Affine, square: Affine, E: Matrix
) -> None:
    """Require the squared H-infinity norm to be below `square`, a scalar expression.

    The congruence `E` multiplies the rows and columns of the states; it changes the numbers
    that the solver sees, not the set of solutions.
    """
    S, Z = p.A @ Y + p.B2 @ M, p.C1 @ Y + p.D12 @ M
    bound, eye = square.times(np.eye(p.nw)), np.eye(p.nz)
    if p.discrete:
        rows = [[E.T @ Y @ E, E.T @ S, E.T @ p.B1, None], [Y, None, Z.T], [bound, p.D11.T], [eye]]
    else:
        # The negative of (10.19), with the sign of the rows of the states turned.
        rows = [[-(E.T @ (S + S.T) @ E), E.T @ p.B1, E.T @ Z.T], [bound, -p.D11.T], [eye]]
    program.positive(symmetric_block(rows))


def h2_inequality(
    program: SemidefiniteProgram, p: PlantMatrices, Y: Affine, M: Affine, E: Matrix
) -> Affine:
    """Return a scalar expression that is at least the squared H2 norm.

    z is turned so that u reaches only its first part: the rest of the trace is linear in Y. The
    condition stays (10.28); the solver has fewer and better scaled variables.
    """
    factors: Any = linalg.qr(p.D12, pivoting=True)
    Q, size = factors[0], np.abs(np.diag(factors[1]))
    rank = int(np.sum(size > EPS * max(p.D12.shape) * size.max(initial=0.0)))
    C, D11, D12 = Q.T @ p.C1, Q.T @ p.D11, Q.T @ p.D12
    S, Z, eye = p.A @ Y + p.B2 @ M, C[:rank] @ Y + D12[:rank] @ M, np.eye(p.nw)
    W = program.symmetric(rank)
    if p.discrete:
        program.positive(symmetric_block([[E.T @ Y @ E, E.T @ S, E.T @ p.B1], [Y, None], [eye]]))
        program.positive(symmetric_block([[W, Z, D11[:rank]], [Y, None], [eye]]))
    else:
        program.positive(symmetric_block([[-(E.T @ (S + S.T) @ E), E.T @ p.B1], [eye]]))
        program.positive(symmetric_block([[W, Z], [Y]]))
    free, direct = C[rank:], D11[rank:]
    return W.trace + ((free @ Y @ free.T).trace + np.trace(direct @ direct.T))


def region_inequalities(
    program: SemidefiniteProgram,
    p: PlantMatrices,
    Y: Affine,
    M: Affine,
    regions: Sequence[PoleRegion],
) -> None:
    """Require the poles to lie in every one of `regions`, given in the problem's unit of time."""
    S = p.A @ Y + p.B2 @ M
    for region in regions:
        # Poles are asked to lie inside their region by this share of its size, so that rounding
        # errors of the solver leave them inside.
        L = region.L + 1e-6 * np.linalg.norm(region.L, 2) * np.eye(len(region.L))
        program.positive(region_matrix(L, region.M, Y, S))


def region_matrix(L: Matrix, M: Matrix, Y: Affine, S: Affine) -> Affine:
    """Return -(kron(L, Y) + kron(M, S) + kron(M, S)'), positive for poles in a region; S = A Y."""
    size = range(len(L))
    return symmetric_block(
        [[-(Y * L[i, j] + S * M[i, j] + S.T * M[j, i]) for j in size[i:]] for i in size]
    )


def gain_inequality(
    program: SemidefiniteProgram, Y: Affine, M: Affine, square: Affine, left: Matrix, right: Matrix
) -> None:
    """Require the largest singular value of left M inv(Y) right to be below sqrt(square).

    The exact condition contains Y H Y with H = inv(right right'), which is convex in Y on
    the wrong side; its tangent at Y = I lies below it, hence the condition is sufficient, and
    exact at Y = I. The rows are multiplied by right', which leaves the gain off the diagonal.
    """
    similar = np.linalg.inv(right) @ Y @ right
    tangent = similar + similar.T - np.eye(right.shape[1])
    program.positive(
        symmetric_block([[square.times(np.eye(left.shape[0])), left @ M @ right], [tangent]])
    )


# One semidefinite program of state feedback: stated in coordinates, solved, verified.


class SolvedProgram(NamedTuple):
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

    def loop_norm_of(self, F: Matrix) -> float:
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
        c: Coordinates,
        step: str,
        tolerance: float = SOLVER_TOLERANCE,
        *,
        noise: float = 0.0,
        fixed: Matrix | None = None,
        held: tuple[Matrix, Matrix] | None = None,
        limit: float | None = None,
        size: float | None = None,
    ) -> SolvedProgram | None:
        """Solve one program for the smallest norm and judge its gain by its loop.

        Parameters
        ----------
        c : Coordinates
        step : str
            What the history says about it.
        tolerance : float, optional
            For the solver.
        noise : float
            For the H2 norm: disturbance on all states, as a share of the one that is there.
        fixed : ndarray or None
            A gain: only its Lyapunov matrix is sought.
        held : (ndarray, ndarray) or None
            left and right: the largest singular value of left F right is kept below 1, by the
            condition that is exact where Y is the identity of the coordinates.
        limit : float or None
            The norm is kept below it, and the effort F Y F' minimised instead.
        size : float or None
            With `limit`: the gain over this size is minimised, not the effort.

        Returns
        -------
        SolvedProgram or None
            None if the solver gave nothing usable.
        """
        p, engine = self.plant, self.engine
        hinf = engine.norm == "hinf"
        q = c.apply(p if hinf else with_noise(p, noise))
        program = SemidefiniteProgram()
        Y: Affine = program.symmetric(p.nx)
        free = fixed is None
        M = program.matrix(p.nu, p.nx) if free else np.linalg.solve(c.V, fixed @ c.T) @ Y
        if hinf:
            square = program.scalar() if limit is None else Affine.of((limit / c.unit) ** 2)
            hinf_inequality(program, q, Y, M, square, c.E)
        else:
            square = h2_inequality(program, q, Y, M, c.E)
        region_inequalities(program, q, Y, M, engine.regions)
        # The inequality of the effort holds Y among its blocks: twice would double the time.
        if limit is None or size is not None:
            program.positive(Y)
        if held is not None:
            left, right = held[0] @ c.V, np.linalg.inv(c.T) @ held[1]
            gain_inequality(program, Y, M, Affine.of(1.0), left, right)
        objective = square
        if limit is not None and size is None:
            W = program.symmetric(p.nu)
            program.positive(symmetric_block([[W, M], [Y]]))
            objective = W.trace
        elif limit is not None:
            objective = program.scalar()
            gain_inequality(program, Y, M, objective, c.V / size, np.linalg.inv(c.T))
        program.minimise(objective)
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
        achieved = self.loop_norm_of(F)
        told |= {"claimed": claimed, "achieved": achieved}
        if 0 < achieved < math.inf:
            following = replace(following, unit=achieved)
        return SolvedProgram(StateGain(F, claimed, achieved), c.T @ y @ c.T.T, following)

    def first(
        self, attempts: Sequence[tuple[Coordinates, float]], step: str, **demand: Any
    ) -> SolvedProgram | None:
        """Solve a program in several coordinates, with a tolerance each, until one is solved."""
        for coordinates, tolerance in attempts:
            solved = self.solve(coordinates, step, tolerance, **demand)
            if solved is not None or self.budget.over:
                return solved
        return None


# State feedback by linear matrix inequalities, solved again in better coordinates.


class LmiStateEngine(StateEngine):
    """Inequalities in Y and F Y, each answer verified from its loop.

    The first solve is made in the given states. Each further one uses states in which the
    last Y is the identity, controls in which the last gain is of order one, and a congruence
    that evens out the Lyapunov inequality, so that nothing near the optimum is small.
    """

    def search(self, plant: PlantMatrices, budget: Budget) -> StateGain | None:
        """Minimise the norm; see :class:`StateEngine`."""
        p = compressed_outputs(plant)
        programs = StatePrograms(p, self, budget, [])
        first = state_gain_norm(p, central_state_gain(plant, math.inf), self.norm)
        start = Coordinates.plain(p, first if 0 < first < math.inf else 1.0)
        found = _iterate(programs, start)
        if (found is None or not found.agreed) and not budget.over:
            other = _iterate(programs, _coordinates_by_continuation(programs, start))
            if found is None or (
                other is not None
                and (
                    other.best.gain.achieved < found.best.gain.achieved
                    or other.agreed > found.agreed
                )
            ):
                found = other
        if found is None:
            return None
        gain = found.best.gain
        if self.norm == "hinf":
            near = 0.5 * gain.achieved < found.claimed < gain.achieved
            gain = _reduce_gain(programs, found, found.claimed if near else gain.achieved)
            claimed = max(gain.claimed, gain.achieved)
        else:
            # The smallest bound of (10.28) for this gain, without noise, is the Gramian's.
            claimed = gain.achieved
        return replace(gain, claimed=claimed, history=tuple(programs.history))


class _LmiIteration(NamedTuple):
    """The best of several rounds, the next coordinates, the last claim, and whether to trust."""

    best: SolvedProgram
    coordinates: Coordinates
    claimed: float
    agreed: bool


def _iterate(programs: StatePrograms, coordinates: Coordinates) -> _LmiIteration | None:
    """Solve again and again, each time in the coordinates that the last answer suggests."""
    engine, older = programs.engine, coordinates
    best: SolvedProgram | None = None
    agreed = False
    claimed, tolerance = math.inf, SOLVER_TOLERANCE
    for number, noise in enumerate(_NOISE, start=1):
        if programs.budget.over:
            break
        # Where the solver breaks down in new coordinates, more plainly, then in the old.
        plain = coordinates.without_congruence()
        attempts = [
            (coordinates, tolerance),
            (plain, max(tolerance, EASED_TOLERANCE)),
            (replace(plain, T=older.T), SOLVER_TOLERANCE),
        ]
        step = f"inequalities, round {number}"
        solved = programs.first(attempts, step, noise=noise)
        if solved is None:
            break
        older, coordinates = coordinates, solved.next
        achieved, claimed = solved.gain.achieved, solved.gain.claimed
        # The gain agrees with the best so far, and its claim with its achievement; with noise the
        # claim is for a larger norm.
        close = 0.1 * engine.slack
        settled = best is not None and abs(achieved / best.gain.achieved - 1) < close
        settled = settled and (engine.norm == "h2" or abs(claimed / achieved - 1) < close)
        if achieved > claimed * (1 + engine.slack):
            # The solver went so near the edge that its gain is wrong: stay further inside.
            # Largest solver tolerance, over the slack, where gains next to the edge are wrong.
            tolerance = min(30 * tolerance, 0.1 * engine.slack)
        near = best.gain.achieved if best is not None and engine.norm == "h2" else claimed
        if achieved == 0:  # nothing is below that
            return _LmiIteration(solved, coordinates, 0.0, True)
        # Rounds agree within this many slacks; within a tenth of a slack they are settled.
        agreed = agreed or settled or abs(near / achieved - 1) < 5.0 * engine.slack
        if best is None or achieved < best.gain.achieved:
            best = solved
        if settled:
            break
    if best is None or not math.isfinite(best.gain.achieved):
        return None
    return _LmiIteration(best, coordinates, claimed, agreed)


def _coordinates_by_continuation(programs: StatePrograms, coordinates: Coordinates) -> Coordinates:
    """Return coordinates for a hard problem from easier ones, in which u has a higher price."""
    # Easier problems by whose coordinates a hard one is approached.
    for price in (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6):
        easier = compressed_outputs(with_small_penalty(programs.plant, price))
        gain = central_state_gain(easier, math.inf)
        unit = state_gain_norm(easier, gain, programs.engine.norm)
        if not 0 < unit < math.inf or programs.budget.over:
            continue
        solved = replace(programs, plant=easier).solve(
            replace(coordinates, unit=unit),
            f"inequalities with a price of {price:.0e}",
            noise=_NOISE[0],
        )
        if solved is not None:
            coordinates = solved.next
    return coordinates


def _reduce_gain(programs: StatePrograms, found: _LmiIteration, estimate: float) -> StateGain:
    """Give the slack away for a smaller gain.

    The gain often grows without limit towards the optimum, until it is too large for its
    loop to be computed. A gain of small effort under twice the slack is joined to the best one by a
    line in (Y, M), along which the inequalities hold, and the last point of that line within the
    slack is taken. `estimate` is where the solver sees the optimum: at most the norm of the best.
    """
    best, slack, eased = found.best.gain, programs.engine.slack, EASED_TOLERANCE
    # Far from the optimum the gain itself can be minimised, near it only the effort.
    coarse = slack > _COARSE_SLACK
    size = (float(np.linalg.norm(best.F, 2)) or None) if coarse else None
    plain = found.coordinates.without_congruence()
    # The last resort is an inner point: the norm minimised with a loose tolerance.
    attempts = (
        (found.coordinates, 2, eased),
        (plain, 2, 10 * eased),
        (plain, 0, max(10 * slack, eased)),
    )
    for base in dict.fromkeys((estimate, best.achieved)):
        if programs.plant.nu == 0 or programs.budget.over:
            break
        for attempt, share, tolerance in attempts:
            limit = base * (1 + share * slack)
            demand = {"limit": limit, "size": size} if share else {}
            step = "smallest effort near the optimum"
            end = programs.solve(attempt, step, tolerance, **demand)
            if end is not None and math.isfinite(end.gain.achieved):
                break
        else:
            continue
        if coarse and end.gain.achieved <= limit * (1 + slack):
            return replace(end.gain, claimed=max(limit, end.gain.achieved))
        smaller = _line_search(programs, found.best, end, base)
        if smaller is not best:
            return smaller
    return best


def _line_search(
    programs: StatePrograms, best: SolvedProgram, end: SolvedProgram, base: float
) -> StateGain:
    """Return the last point within the slack; without one, the point of the smallest norm."""
    slack = programs.engine.slack
    claim = base * (1 + slack)
    # A norm below the optimum is a rounding error of a loop with too large a gain.
    floor = base * (1 - slack)
    chosen, low, high, share = best.gain, 0.0, 1.0, 1.0
    # Points on the line from the best gain to one of less effort.
    for _ in range(14):
        Y = (1 - share) * best.Y + share * end.Y
        M = (1 - share) * best.gain.F @ best.Y + share * end.gain.F @ end.Y
        try:
            F: Matrix = np.linalg.solve(Y, M.T).T.astype(float)
        except linalg.LinAlgError:
            break
        achieved = programs.loop_norm_of(F)
        if achieved < floor:
            achieved = math.inf
        if achieved <= claim:
            chosen, low = StateGain(F, claim, achieved), share
        else:
            high = share
            if achieved < chosen.achieved and chosen.achieved > claim:
                chosen = StateGain(F, achieved, achieved)
        share = (low + high) / 2
        if low == high:
            break
    return chosen
