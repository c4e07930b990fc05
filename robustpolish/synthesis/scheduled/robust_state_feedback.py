"""Robust state feedback for a polytope of plants, by matrix inequalities with a slack variable."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.budget import (
    Budget,
    DeadlineError,
    enforce_deadline,
    progress_bar,
    single_threaded_blas,
)
from robustpolish.base.checks import described, invalid, one_of, positive
from robustpolish.base.results import Card, Displayed, Table, quantities
from robustpolish.errors import InfeasibleError, SolverError
from robustpolish.plants.blocks import SignalChoice
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.plants.uncertain.system import UncertainSystem
from robustpolish.plots.charts import plot_bars
from robustpolish.robust.questions import WorstCaseGain, round_up, worst_case_gain
from robustpolish.synthesis.certificate import Certificate, Norm, certify
from robustpolish.synthesis.lmi.program import (
    Affine,
    ProgramSolver,
    SemidefiniteProgram,
    symmetric_block,
)
from robustpolish.synthesis.problem.matrices import PlantMatrices, state_gain_norm
from robustpolish.synthesis.problem.preflight import check_solvability
from robustpolish.synthesis.scheduled.polytope import (
    POLICY,
    LyapunovFamily,
    Polytope,
    PolytopeSpecification,
    Terms,
    extreme_rates,
    impose,
    mean,
    polytope,
    scaled_vertices,
    shrunk_matrices,
    tied_weights,
    weighted_sum,
    with_gain,
    with_slack,
)
from robustpolish.synthesis.scheduled.proof import (
    ProgramResult,
    lyapunov_analysis,
    prove,
    state_loop,
    uncertain_loop,
)
from robustpolish.synthesis.state_feedback.lmi import Coordinates, gain_inequality

# `RobustStateFeedback`: one gain for all plants of a polytope, and what is proven of it.

Lyapunov = Literal["vertices", "common"]
Status = Literal["proven", "vertices only", "time_limit"]


@dataclass(frozen=True, eq=False, repr=False)
class RobustStateFeedback(Displayed):
    """A gain F of u = F x for all plants of a polytope.

    Attributes
    ----------
    gain : ndarray, shape (nu, nx)
        F.
    norm : {"hinf", "h2"}
    bound : float
        Proven for every plant that is meant, in the plants' units, prices included; infinite where
        nothing between the vertices is proven.
    vertex_norms : tuple of float
        What F achieves at each vertex.
    points : tuple of mapping of str to float
        The numbers at the vertices; empty mappings for a list of plants.
    certificates : tuple of Certificate
        Of the loop at each vertex.
    lyapunov : {"vertices", "common"}
        What the search and the proof used.
    time_varying : bool
        Whether the bound holds for plants that change with time, however fast; the H-infinity
        norm is then the largest ratio of energies of z and w.
    worst_case : WorstCaseGain or None
        Of the loop of an uncertain system; None for a list of plants, and for the H2 norm.
    loop : UncertainSystem or None
        That loop.
    status : {"proven", "vertices only", "time_limit"}
        Whether the bound is proven; after "time_limit" it is, but another machine may find a
        better gain.
    message : str
        The status in words, with what was found on the way.

    Examples
    --------
    >>> import robustpolish as rp
    >>> k = rp.uncertain.real("k", 2.0, percent=50)
    >>> mass = rp.uncertain.system([[0, 1], [-k, -0.1]], [[0, 0], [1, 1]], [[1, 0]], 0)
    >>> design = rp.robust_state_feedback(mass, controls=1, control_weight=0.3, norm="h2")
    >>> design.status, design.gain.shape, max(design.vertex_norms) <= design.bound
    ('proven', (1, 2), True)
    >>> design.plot().get_xlabel()
    'H2 norm'
    """

    gain: Matrix
    norm: Literal["hinf", "h2"]
    bound: float
    vertex_norms: tuple[float, ...]
    points: tuple[Mapping[str, float], ...]
    certificates: tuple[Certificate, ...]
    lyapunov: Lyapunov
    time_varying: bool
    worst_case: WorstCaseGain | None
    loop: UncertainSystem | None
    status: Status
    message: str

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the norm that the gain achieves at each vertex.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
        """
        name = "H-infinity norm" if self.norm == "hinf" else "H2 norm"
        vertices = xr.DataArray(
            list(self.vertex_norms), {"vertex": list(self._names)}, "vertex", name
        )
        return plot_bars(vertices, ax=ax)

    @property
    def _names(self) -> tuple[str, ...]:
        told = [", ".join(f"{k} = {v:.6g}" for k, v in point.items()) for point in self.points]
        return tuple(text or str(i) for i, text in enumerate(told))

    def _card(self) -> Card:
        name = "H-infinity" if self.norm == "hinf" else "H2"
        rows = (
            (f"{name} norm proven to be at most", self.bound),
            ("largest at a vertex", max(self.vertex_norms)),
            ("holds for numbers that change with time", self.time_varying),
        )
        told = Table(
            "",
            ("vertex", "norm"),
            tuple(zip(self._names, self.vertex_norms, strict=True)),
        )
        tables = (quantities(*rows), told)
        return Card(f"Robust state feedback: {self.status}", tables, (self.message,))


# State feedback for the vertices of a polytope: one gain for all, or one that is scheduled.
#
# A program in P, V and L = F V gives a first gain for each tilt of the slack. One gain for all is
# then improved in turns: with the gain held the slack is free, with the slack held the gain is, and
# each program contains the last answer.


@dataclass(frozen=True, eq=False)
class GainProblem:
    """What is asked for, in scaled units.

    Attributes
    ----------
    plants : tuple of PlantMatrices
        At the vertices.
    question : PolytopeSpecification
    scheduled : bool
        A gain for each vertex, mixed as the plants are, instead of one for all.
    """

    plants: tuple[PlantMatrices, ...]
    specification: PolytopeSpecification
    scheduled: bool = False


@dataclass(frozen=True, eq=False)
class VertexGains:
    """Gains, one for each vertex, and the bound that a program claims for them.

    Attributes
    ----------
    gains : tuple of ndarray
    claimed : float
    easy : Coordinates
        In which the next program is easy.
    """

    gains: tuple[Matrix, ...]
    claimed: float
    easy: Coordinates


def candidates(problem: GainProblem, solver: ProgramSolver) -> Iterator[VertexGains]:
    """Yield gains of a small bound, then smaller gains with larger bounds.

    Near the smallest bound gains often grow without limit, until a proof fails.

    Parameters
    ----------
    problem : GainProblem
    solver : ProgramSolver
    """
    best, tilt = _best_tilt(problem, solver)
    if best is None:
        return
    for _ in range(POLICY.rounds):
        again = _program(problem, best.easy, tilt, solver)
        if again is None or again.claimed >= best.claimed:
            break
        again = _interior_solution(problem, again, best.easy, tilt, solver)
        if again is None:
            break
        best = again
    one_of_many = not (problem.scheduled or problem.specification.tied)
    for back_off in POLICY.back_offs:
        limit = best.claimed * (1 + back_off)
        smaller = _program(problem, best.easy, tilt, solver, limit)
        for _ in range(POLICY.rounds):
            again = smaller and _program(problem, smaller.easy, tilt, solver, limit, True)
            if again is None or not _is_kept(problem, again):
                break
            smaller = again
        if smaller is not None:
            yield _alternate(problem, smaller, back_off, solver) if one_of_many else smaller


def _is_kept(problem: GainProblem, found: VertexGains) -> bool:
    """Tell whether the loops of the vertices keep the bound, which rounding may break."""
    norms = (
        state_gain_norm(p, F, problem.specification.norm)
        for p, F in zip(problem.plants, found.gains, strict=True)
    )
    return max(norms) <= found.claimed * (1 + POLICY.broken)


def _best_tilt(problem: GainProblem, solver: ProgramSolver) -> tuple[VertexGains | None, float]:
    """Return the best first answer, and the weight of the slack on the derivative for it."""
    start = Coordinates.plain(problem.plants[0], 1.0)
    family = LyapunovFamily.common(len(problem.plants))
    common = replace(problem, specification=replace(problem.specification, family=family))
    plain = _program(common, start, 0.0, solver)
    plain = plain and _interior_solution(common, plain, start, 0.0, solver)
    if problem.specification.tied:
        return plain, 0.0
    if plain is not None:
        start = plain.easy
    best, chosen = None, POLICY.tilts[0]
    # In discrete time the inequality has one form that is best where there is but one vertex.
    for tilt in (0.0,) if problem.specification.discrete else POLICY.tilts:
        solved = _program(problem, start, tilt, solver)
        if solved is not None and (best is None or solved.claimed < best.claimed):
            best, chosen = solved, tilt
    return best and _interior_solution(problem, best, start, chosen, solver), chosen


def _interior_solution(
    problem: GainProblem, solved: VertexGains, c: Coordinates, tilt: float, solver: ProgramSolver
) -> VertexGains:
    """Return an answer with coordinates of one that is well inside its inequalities."""
    inside = _program(problem, c, tilt, solver, solved.claimed * (1 + POLICY.room))
    if inside is None:
        return solved
    return replace(solved, easy=replace(inside.easy, unit=solved.claimed))


def _program(
    problem: GainProblem,
    c: Coordinates,
    tilt: float,
    solver: ProgramSolver,
    limit: float | None = None,
    gains_themselves: bool = False,
) -> VertexGains | None:
    """Minimise the bound; or, with a limit on it, the gains, by their effort or themselves."""
    if solver.budget.over:
        return None  # to put a program together that is not solved takes longer than a limit allows
    program = SemidefiniteProgram()
    plants = [c.apply(p) for p in problem.plants]
    n, nu = plants[0].nx, plants[0].nu
    specification = problem.specification
    matrices = [program.symmetric(n) for _ in range(specification.family.size)]
    rates = extreme_rates(program, specification.family, matrices)
    tied = specification.tied
    V = matrices[0] if tied else program.matrix(n, n)
    count = len(plants) if problem.scheduled else 1
    gains = [program.matrix(nu, n) for _ in range(count)]
    a, b = tied_weights(specification.discrete)
    weights = (a, b) if specification.discrete or tied else (tilt, 1.0)
    square = program.scalar() if limit is None else Affine.of((limit / c.unit) ** 2)
    for i, p in enumerate(plants):
        L = gains[i % count]
        AV, CV = p.A @ V + p.B2 @ L, p.C1 @ V + p.D12 @ L
        seen = CV if specification.norm == "hinf" else Affine.of(np.zeros((0, n)))
        terms = Terms(with_gain(V, AV, seen, *weights), CV, V, p.B1, p.D11)
        impose(program, specification, i, matrices, terms, square, rates=rates)
    if limit is None:
        program.minimise(square)
    elif gains_themselves:
        size, right = program.scalar(), np.linalg.inv(c.T).astype(float)
        for L in gains:
            gain_inequality(program, V, L, size, c.V, right)
        program.minimise(size)
    else:
        program.minimise(_effort(program, gains, V))
    solution = solver.solve(program)
    if solution.x is None:
        return None
    claimed = c.unit * math.sqrt(max(solution.value(square).item(), 0.0))
    v, P = solution.value(V), [solution.value(M) for M in matrices]
    try:
        found = tuple(c.gain(v.T, solution.value(L)) for L in gains)
        middle = mean([weighted_sum(row, P) for row in specification.family.shares])
        sizes = np.sqrt(mean([solution.value(L) ** 2 for L in gains]))
        following = c.next(plants[0], middle, sizes, even_out=False)
    except np.linalg.LinAlgError:
        return None
    if not (math.isfinite(claimed) and claimed > 0 and all(np.isfinite(F).all() for F in found)):
        return None
    each = tuple(found[i % count] for i in range(len(plants)))
    return VertexGains(each, claimed, replace(following, unit=claimed))


def _effort(program: SemidefiniteProgram, gains: list[Affine], V: Affine) -> Affine:
    """Return what is to be small: F V F' of each gain, summed."""
    total = Affine.of(0.0)
    for L in gains:
        W = program.symmetric(L.shape[0])
        program.positive(symmetric_block([[W, L], [(V + V.T) / 2]]))
        total = total + W.trace
    return total


def _alternate(
    problem: GainProblem, start: VertexGains, back_off: float, solver: ProgramSolver
) -> VertexGains:
    """Improve one gain for all: with the gain held the slack is free, and the other way round."""
    c, best = start.easy, start
    plants = [c.apply(p) for p in problem.plants]
    # In these coordinates u = V F T x.
    F = np.linalg.solve(c.V, best.gains[0] @ c.T)
    rooms = list(POLICY.turn_rooms)
    held = _solve_for_slack(problem, plants, F, rooms[0], solver)
    for _ in range(POLICY.turns):
        if held is None or not rooms:
            break
        moved = _solve_for_gain(problem, plants, held, solver, None)
        again = (
            None if moved is None else _solve_for_slack(problem, plants, moved, rooms[0], solver)
        )
        enough = (1 - POLICY.gain_of_turn) ** 2
        slow = again is None or again.square > enough * held.square
        if moved is not None and again is not None and again.square < held.square:
            F, held = moved, again
        if slow:
            rooms = rooms[1:]
            nearer = _solve_for_slack(problem, plants, F, rooms[0], solver) if rooms else None
            held = nearer or held
    if held is not None:
        level = math.sqrt(held.square) * c.unit
        if level < best.claimed:
            limit = held.square * (1 + back_off) ** 2
            smaller = _solve_for_gain(problem, plants, held, solver, limit)
            if smaller is not None:
                F, level = smaller, level * (1 + back_off)
            gain: Matrix = c.V @ F @ np.linalg.inv(c.T)
            return VertexGains((gain,) * len(plants), level, c)
    return best


def _solve_for_slack(
    problem: GainProblem,
    plants: list[PlantMatrices],
    F: Matrix,
    room: float,
    solver: ProgramSolver,
) -> ProgramResult | None:
    """Return a slack well inside the inequalities for a gain, with the least square of the norm."""
    loops = [(p.A + p.B2 @ F, p.B1, p.C1 + p.D12 @ F, p.D11) for p in plants]
    same = all(np.array_equal(loop[2], loops[0][2]) for loop in loops)
    least = lyapunov_analysis(loops, problem.specification, solver, same)
    if least is None or not least.square > 0:
        return None
    limit = least.square * (1 + room) ** 2
    inside = lyapunov_analysis(loops, problem.specification, solver, same, limit)
    return None if inside is None else replace(inside, square=least.square)


def _solve_for_gain(
    problem: GainProblem,
    plants: list[PlantMatrices],
    held: ProgramResult,
    solver: ProgramSolver,
    limit: float | None,
) -> Matrix | None:
    """Return the gain of the smallest bound with the slack held; with a limit, the smallest."""
    specification = problem.specification
    program = SemidefiniteProgram()
    n, nu = plants[0].nx, plants[0].nu
    matrices = [program.symmetric(n) for _ in range(specification.family.size)]
    rates = extreme_rates(program, specification.family, matrices)
    F = program.matrix(nu, n)
    square = program.scalar() if limit is None else Affine.of(limit)
    assert held.X is not None
    for i, p in enumerate(plants):
        A, C = p.A + p.B2 @ F, p.C1 + p.D12 @ F
        seen = C if specification.norm == "hinf" else Affine.of(np.zeros((0, n)))
        V = held.V if held.V is not None else weighted_sum(specification.family.shares[i], held.P)
        terms = Terms(with_slack(held.X, A, seen), C @ V, V, p.B1, p.D11)
        impose(program, specification, i, matrices, terms, square, rates=rates)
    if limit is None:
        program.minimise(square)
    else:
        size, eyes = program.scalar(), (np.eye(nu), np.eye(n))
        program.positive(symmetric_block([[size.times(eyes[0]), F], [size.times(eyes[1])]]))
        program.minimise(size)
    solution = solver.solve(program)
    return None if solution.x is None else solution.value(F)


# Feasibility: vertices that no gain stabilises, and the part of a polytope that has a gain.


def refused_vertices(whole: Polytope) -> None:
    """Refuse a polytope with a vertex that no controller stabilises.

    Raises
    ------
    InfeasibleError
        It names the vertex and the mode.
    """
    for name, plant in zip(whole.names, whole.plants, strict=True):
        modes = [mode for mode in check_solvability(plant).fixed_modes if mode.exact]
        if modes:
            listed = "; ".join(str(mode) for mode in modes)
            raise InfeasibleError(
                f"No controller stabilises the vertex {name} because of the {listed}. To go on, "
                "add an actuator or sensor that reaches it, or exclude this vertex.",
                [mode.eigenvalue for mode in modes],
            )


def feasible_share(problem: GainProblem, solver: ProgramSolver) -> float:
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
    return prove(loops, problem.specification, solver, found.claimed) is not None


@single_threaded_blas
def robust_state_feedback(
    plant: Sequence[GeneralizedPlant] | UncertainSystem,
    norm: Literal["hinf", "h2"] = "hinf",
    *,
    controls: SignalChoice | None = None,
    lyapunov: Lyapunov = "vertices",
    control_weight: ArrayLike | None = None,
    backend: Literal["cvxpy", "picos"] = "cvxpy",
    solver: str | None = None,
    time_limit: float = 300.0,
) -> RobustStateFeedback:
    r"""Design one gain u = F x for all plants of a polytope, for the smallest worst norm.

    Linear matrix inequalities with a Lyapunov matrix for each vertex and a slack that all share
    give a first gain; gain and slack are then improved in turns. What is returned is proven afresh.

    Parameters
    ----------
    plant : sequence of GeneralizedPlant, or UncertainSystem
        The vertices, of the same sizes, continuous or discrete, all states taken as measured; or a
        system with real numbers, whose vertices are the corners of their box. All its
        outputs are z.
    norm : {"hinf", "h2"}, optional
        The norm from w to z whose largest value is minimised.
    controls : int, str or sequence of str, optional
        Of an uncertain system: which inputs are u, by name, or how many of the last ones.
    lyapunov : {"vertices", "common"}, optional
        One Lyapunov matrix for each vertex, for plants that do not change with time. "common" is
        one for all (quadratic stability): it costs performance, and covers plants that move within
        the polytope however fast.
    control_weight : float or array_like, shape (nu,), optional
        Price on u in units of z per unit of u: ``control_weight * u`` joins z.
    backend, solver : str, optional
        Who solves the inequalities; "cvxpy" (with Clarabel) or "picos".
    time_limit : float, optional
        Seconds: a safety net for the search, whose work is limited otherwise; the status says if it
        was reached.

    Returns
    -------
    RobustStateFeedback

    Raises
    ------
    InvalidInputError
        If plants do not fit each other, or something else than real numbers is uncertain.
    InfeasibleError
        If a vertex has an unstable mode that no control moves; it is named.
    SolverError
        If no gain was found and proven for the whole polytope; the message tells for which part of
        it there is one.

    Notes
    -----
    Gains that exist may be missed: the inequalities are sufficient. For a list of plants
    the matrices that prove the bound are checked in ball arithmetic, for every mixture of the
    vertices. That is the whole box of an uncertain system if its matrices depend on a line
    on each number, or on a function of it such as 1 / m; otherwise the vertices only guide the
    search, and the bound is that of ``worst_case``, proven for numbers that do not change with
    time. It is taken too where it is the smaller one.

    References
    ----------
    M.C. de Oliveira, J. Bernussou, J.C. Geromel, "A new discrete-time robust stability condition",
    Systems & Control Letters 37 (1999). M.C. de Oliveira, J.C. Geromel, J. Bernussou, "Extended H2
    and H-infinity norm characterizations and controller parametrizations for discrete-time
    systems", Int. J. Control 75 (2002). U. Shaked, "Improved LMI representations for the analysis
    and the design of continuous-time systems with polytopic type uncertainty", IEEE TAC 46 (2001).

    Examples
    --------
    A mass on a spring that is known to 80 %:

    >>> import robustpolish as rp
    >>> k = rp.uncertain.real("k", 5.0, percent=80)
    >>> mass = rp.uncertain.system([[0, 1], [-k, -0.1]], [[0, 0], [1, 1]], [[1, 0]], 0)
    >>> design = rp.robust_state_feedback(mass, controls=1, control_weight=0.3)
    >>> design.status, design.worst_case.proven, bool(design.bound < 0.31)
    ('proven', True, True)
    """
    one_of("norm", norm, ("hinf", "h2"))
    one_of("lyapunov", lyapunov, ("vertices", "common"))
    positive("time_limit", time_limit)
    whole = polytope(plant, controls, None, control_weight).with_full_state()
    _check_norm(whole, norm)
    refused_vertices(whole)
    budget = Budget(POLICY.work, time_limit)
    programs = ProgramSolver(backend, solver, budget, POLICY.tolerance)
    count = len(whole.plants)
    makes = LyapunovFamily.common if lyapunov == "common" else LyapunovFamily.per_vertex
    with progress_bar("Designing for all vertices"), enforce_deadline(budget):
        scaled, vertices = scaled_vertices(whole)
        problem = GainProblem(
            vertices, PolytopeSpecification(makes(count), norm, vertices[0].discrete)
        )
        for found in candidates(problem, programs):
            F = found.gains[0]
            loops = [state_loop(p, F) for p in vertices]
            proof = prove(loops, problem.specification, programs, found.claimed)
            # Units are powers of two, but for the root of that of time in an H2 norm.
            bound = math.inf if proof is None else round_up(scaled.norm(proof.bound, norm))
            design = _verified_design(whole, norm, lyapunov, scaled.state_gain(F), bound, budget)
            if design is not None:
                return design
        share = feasible_share(problem, programs)
    raise SolverError(_failure(lyapunov, share, budget.late))


def _verified_design(
    whole: Polytope, norm: Norm, lyapunov: Lyapunov, F: Any, bound: float, budget: Budget
) -> RobustStateFeedback | None:
    """Return the design of a gain with all that is proven of it; None if that is too little."""
    certificates = tuple(certify(p, F, norm) for p in whole.plants)
    if not all(c.valid for c in certificates):
        return None
    worst: WorstCaseGain | None = None
    loop = None
    if whole.system is not None:
        loop = uncertain_loop(whole.system, whole.plants[0].nz, F)
        worst = _worst_case_if_time(loop, bound) if norm == "hinf" else None
    varying = lyapunov == "common" and whole.is_convex_hull and math.isfinite(bound)
    if not whole.is_convex_hull:
        bound = math.inf
    if not varying and worst is not None and worst.proven:
        bound = min(bound, worst.upper)
    if whole.is_convex_hull and not math.isfinite(bound):
        return None
    status: Status = "proven" if math.isfinite(bound) else "vertices only"
    if status == "proven" and budget.late:
        status = "time_limit"
    return RobustStateFeedback(
        gain=F,
        norm=norm,
        bound=bound,
        vertex_norms=tuple(c.achieved for c in certificates),
        points=whole.points,
        certificates=certificates,
        lyapunov=lyapunov,
        time_varying=varying,
        worst_case=worst,
        loop=loop,
        status=status,
        message=_message(whole, status, varying, worst),
    )


def _message(whole: Polytope, status: Status, varying: bool, worst: WorstCaseGain | None) -> str:
    if whole.is_convex_hull:
        text = "The bound is proven for every mixture of the vertices"
        text += ", also if they change with time." if varying else ", unless they change with time."
    else:
        text = (
            "Not all plants of the box are mixtures of its corners, where alone the inequalities "
            "hold. "
        )
        if status == "vertices only":
            text += "Nothing is proven in between; look at rp.robust_stability(design.loop)."
        else:
            text += "The bound is that of worst_case, for numbers that do not change with time."
    if worst is not None and math.isinf(worst.upper) and worst.status == "unstable":
        text += " Some machine in between is unstable, see worst_case.witness."
    if status == "time_limit":
        text += " The time limit was reached: a better gain may exist."
    return text


def _failure(lyapunov: Lyapunov, share: float, late: bool) -> str:
    kind = "one Lyapunov matrix for all" if lyapunov == "common" else "one slack for all"
    text = f"No gain was found and proven for the whole polytope, with {kind} vertices. "
    if late:
        return text + "The time limit was reached; raise time_limit."
    text += (
        "Each vertex alone can be stabilised, but not even a small part around the middle. "
        if share == 0
        else f"For {100 * share:.0f} % of it around its middle there is one. "
    )
    other = 'Try lyapunov="vertices"' if lyapunov == "common" else "Make the ranges smaller"
    return text + f"{other}, or measure the numbers and use scheduled_feedback."


def _worst_case_if_time(loop: UncertainSystem, bound: float) -> WorstCaseGain | None:
    """Return the worst-case gain; None if there was no time for it and the bound is proven."""
    try:
        return worst_case_gain(loop)
    except DeadlineError:
        if not math.isfinite(bound):
            raise
        return None


def _check_norm(whole: Polytope, norm: Norm) -> None:
    if norm == "hinf" or whole.plants[0].is_discrete:
        return
    for name, plant in zip(whole.names, whole.plants, strict=True):
        if plant.D11.any():
            raise invalid(
                "plant",
                described(f"D11 that is not zero at {name}"),
                "no direct path from w to z, through which the H2 norm is infinite",
                'Use norm="hinf", or filter z.',
            )
