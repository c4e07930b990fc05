"""Robust state feedback for a polytope of plants, by matrix inequalities with a slack variable."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from robustpolish.base.arrays import AGREE
from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.budget import (
    WORK,
    Budget,
    DeadlineError,
    enforce_deadline,
    progress_bar,
    single_threaded_blas,
)
from robustpolish.base.checks import described, invalid, one_of, positive
from robustpolish.base.results import Card, Displayed, Table, quantities
from robustpolish.errors import InfeasibleError, SolverError
from robustpolish.linear.arithmetic.balls import BallSystem
from robustpolish.plants.blocks import SignalChoice
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.plants.uncertain.system import UncertainSystem
from robustpolish.plots.charts import plot_bars
from robustpolish.robust.questions import WorstCaseGain, round_up, worst_case_gain
from robustpolish.synthesis.certificate import Certificate, Norm, certify
from robustpolish.synthesis.lmi.program import Affine, ProgramSolver, symmetric_block
from robustpolish.synthesis.problem.matrices import PlantMatrices, state_gain_norm
from robustpolish.synthesis.problem.preflight import check_solvability
from robustpolish.synthesis.scheduled import polytope as polytopes
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
        return tuple(name or str(i) for i, name in enumerate(polytopes.vertex_names(self.points)))

    def _card(self) -> Card:
        name = "H-infinity" if self.norm == "hinf" else "H2"
        bounds = quantities(
            (f"{name} norm proven to be at most", self.bound),
            ("largest at a vertex", max(self.vertex_norms)),
            ("holds for numbers that change with time", self.time_varying),
        )
        norms = tuple(zip(self._names, self.vertex_norms, strict=True))
        tables = (bounds, Table("", ("vertex", "norm"), norms))
        return Card(f"Robust state feedback: {self.status}", tables, (self.message,))


# State feedback for the vertices of a polytope: one gain for all, or one that is scheduled.
#
# A program in P, V and L = F V gives a first gain for each tilt of the slack. One gain for all is
# then improved in turns: with the gain held the slack is free, with the slack held the gain is, and
# each program contains the last answer.

# Weights of the slack on the derivative of the state. Small ones come back to a common Lyapunov
# matrix, large ones leave the matrices freer; which is best depends on how fast the loop is in the
# plant's unit of time.
_TILTS = (0.03, 0.1, 0.3, 1.0, 3.0)
# Programs solved again in the coordinates of the last answer.
_ROUNDS = 2
# How often gain and slack are minimised in turn; each lowers the bound or leaves it.
_TURNS = 25
# How far inside the inequalities the slack is taken between two turns. One far inside lets the gain
# move far, one near the edge moves it where that did not help; a turn that lowers the bound by less
# than the worthwhile share is the last with its room.
_TURN_ROOMS = (0.1, 0.01, 0.001)
_WORTHWHILE = 1e-3
# The same where an answer only serves for coordinates.
_ROOM = 0.3
# Halvings of the polytope's size when it is told for which part of it there is a gain.
_SHRINKINGS = 5
BACK_OFFS = (0.01, 0.03, 0.1)
"""How far the gain may move from the smallest bound to get smaller, one after the other until a
proof succeeds: it often grows without limit towards the optimum."""


class VertexGains(NamedTuple):
    """Gains, one for each vertex, the bound that a program claims, and easy coordinates."""

    gains: tuple[Matrix, ...]
    claimed: float
    easy: Coordinates


@dataclass(frozen=True, eq=False)
class GainSearch:
    """The search for gains at the vertices, in scaled units.

    Attributes
    ----------
    plants : tuple of PlantMatrices
        At the vertices.
    specification : PolytopeSpecification
    solver : ProgramSolver
    scheduled : bool
        A gain for each vertex, mixed as the plants are, instead of one for all.
    """

    plants: tuple[PlantMatrices, ...]
    specification: polytopes.PolytopeSpecification
    solver: ProgramSolver
    scheduled: bool = False

    def candidates(self) -> Iterator[VertexGains]:
        """Yield gains of a small bound, then smaller gains with larger bounds.

        Near the smallest bound gains often grow without limit, until a proof fails.
        """
        best, tilt = self._best_tilt()
        if best is None:
            return
        for _ in range(_ROUNDS):
            again = self._program(best.easy, tilt)
            if again is None or again.claimed >= best.claimed:
                break
            best = self._interior(again, best.easy, tilt)
        one_of_many = not (self.scheduled or self.specification.tied)
        for back_off in BACK_OFFS:
            limit = best.claimed * (1 + back_off)
            smaller = self._program(best.easy, tilt, limit)
            for _ in range(_ROUNDS):
                again = smaller and self._program(smaller.easy, tilt, limit, True)
                if again is None:
                    break
                # Rounding may carry the loop at a vertex over the bound.
                pairs = zip(self.plants, again.gains, strict=True)
                norms = [state_gain_norm(p, F, self.specification.norm) for p, F in pairs]
                # A bound exceeded by more is broken: the smallest gains lie at the edge of
                # inequalities whose numbers span twenty decades, and on some processors rounding
                # carries them over it by 1e-3.
                if max(norms) > again.claimed * (1 + AGREE):
                    break
                smaller = again
            if smaller is not None:
                yield self._alternate(smaller, back_off) if one_of_many else smaller

    def loops(self, found: VertexGains) -> list[BallSystem]:
        """Return the loops at the vertices, without rounding."""
        return [polytopes.state_loop(p, F) for p, F in zip(self.plants, found.gains, strict=True)]

    def bound(self, found: VertexGains) -> float | None:
        """Return the bound that is proven for gains; None if none is."""
        return polytopes.prove(self.loops(found), self.specification, self.solver, found.claimed)

    def feasible_share(self) -> float:
        """Return for which part of a polytope, shrunk towards its middle, there is a proven gain.

        Beyond the last one programs claim huge gains.
        """
        low, high = 0.0, 1.0
        for _ in range(_SHRINKINGS):
            share = (low + high) / 2
            part = replace(self, plants=polytopes.shrunk_matrices(self.plants, share))
            found = next(part.candidates(), None)
            good = found is not None and part.bound(found) is not None
            low, high = (share, high) if good else (low, share)
        return low

    def _best_tilt(self) -> tuple[VertexGains | None, float]:
        """Return the best first answer, and the weight of the slack on the derivative for it."""
        start = Coordinates.plain(self.plants[0], 1.0)
        family = polytopes.LyapunovFamily.common(len(self.plants))
        common = replace(self, specification=replace(self.specification, family=family))
        plain = common._program(start, 0.0)
        plain = plain and common._interior(plain, start, 0.0)
        if self.specification.tied:
            return plain, 0.0
        if plain is not None:
            start = plain.easy
        # In discrete time the inequality has one form that is best where there is but one vertex.
        tilts = (0.0,) if self.specification.discrete else _TILTS
        solved = [(found, tilt) for tilt in tilts if (found := self._program(start, tilt))]
        if not solved:
            return None, _TILTS[0]
        best, tilt = min(solved, key=lambda pair: pair[0].claimed)
        return self._interior(best, start, tilt), tilt

    def _interior(self, solved: VertexGains, c: Coordinates, tilt: float) -> VertexGains:
        """Return an answer with coordinates of one that is well inside its inequalities."""
        inside = self._program(c, tilt, solved.claimed * (1 + _ROOM))
        if inside is None:
            return solved
        return solved._replace(easy=replace(inside.easy, unit=solved.claimed))

    def _program(
        self, c: Coordinates, tilt: float, limit: float | None = None, themselves: bool = False
    ) -> VertexGains | None:
        """Minimise the bound; or, with a limit on it, the gains, by their effort or themselves."""
        if self.solver.budget.over:
            return None  # a program that is not solved takes longer to make than a limit allows
        specification, plants = self.specification, [c.apply(p) for p in self.plants]
        n, nu, count = plants[0].nx, plants[0].nu, len(plants) if self.scheduled else 1
        program = polytopes.PolytopeProgram(specification, n)
        free = not (specification.tied or specification.discrete)
        weights = (tilt, 1.0) if free else specification.tied_weights
        V = program.matrices[0] if specification.tied else program.matrix(n, n)
        gains = [program.matrix(nu, n) for _ in range(count)]
        square = program.scalar() if limit is None else Affine.of((limit / c.unit) ** 2)
        for i, p in enumerate(plants):
            L = gains[i % count]
            AV, CV = p.A @ V + p.B2 @ L, p.C1 @ V + p.D12 @ L
            S = polytopes.with_gain(V, AV, Affine.of(specification.seen(CV)), *weights)
            program.impose(i, S, CV, V, (p.B1, p.D11), square)
        if limit is None:
            program.minimise(square)
        elif themselves:
            size, right = program.scalar(), np.linalg.inv(c.T).astype(float)
            for L in gains:
                gain_inequality(program, V, L, size, c.V, right)
            program.minimise(size)
        else:
            # The effort is F V F' of each gain, summed.
            effort = Affine.of(0.0)
            for L in gains:
                W = program.symmetric(nu)
                program.positive(symmetric_block([[W, L], [(V + V.T) / 2]]))
                effort = effort + W.trace
            program.minimise(effort)
        solution = self.solver.solve(program)
        if solution.x is None:
            return None
        claimed = c.unit * math.sqrt(max(solution.value(square).item(), 0.0))
        v, P = solution.value(V), [solution.value(M) for M in program.matrices]
        try:
            found = [c.gain(v.T, solution.value(L)) for L in gains]
            sizes = np.sqrt(sum(solution.value(L) ** 2 for L in gains) / count)
            easy = c.next(plants[0], specification.mean(P), sizes, even_out=False)
        except np.linalg.LinAlgError:
            return None
        if not (0 < claimed < math.inf and all(np.isfinite(F).all() for F in found)):
            return None
        each = tuple(found[i % count] for i in range(len(plants)))
        return VertexGains(each, claimed, replace(easy, unit=claimed))

    def _alternate(self, start: VertexGains, back_off: float) -> VertexGains:
        """Improve one gain for all: with the gain held the slack is free, and the other way."""
        c = start.easy
        plants = [c.apply(p) for p in self.plants]
        # In these coordinates u = V F T x.
        F = np.linalg.solve(c.V, start.gains[0] @ c.T)
        rooms = list(_TURN_ROOMS)
        held = self._slack(plants, F, rooms[0])
        for _ in range(_TURNS):
            if held is None or not rooms:
                break
            moved = self._gain(plants, held)
            again = None if moved is None else self._slack(plants, moved, rooms[0])
            slow = again is None or again.square > (1 - _WORTHWHILE) ** 2 * held.square
            if moved is not None and again is not None and again.square < held.square:
                F, held = moved, again
            if slow:
                rooms = rooms[1:]
                held = (self._slack(plants, F, rooms[0]) if rooms else None) or held
        if held is None:
            return start
        level = math.sqrt(held.square) * c.unit
        if level >= start.claimed:
            return start
        smaller = self._gain(plants, held, held.square * (1 + back_off) ** 2)
        if smaller is not None:
            F, level = smaller, level * (1 + back_off)
        gain: Matrix = c.V @ F @ np.linalg.inv(c.T)
        return VertexGains((gain,) * len(plants), level, c)

    def _slack(
        self, plants: list[PlantMatrices], F: Matrix, room: float
    ) -> polytopes.ProgramResult | None:
        """Return a slack well inside the inequalities for a gain, and the least gamma^2."""
        loops = [(p.A + p.B2 @ F, p.B1, p.C1 + p.D12 @ F, p.D11) for p in plants]
        same = all(np.array_equal(loop[2], loops[0][2]) for loop in loops)
        least = polytopes.lyapunov_analysis(loops, self.specification, self.solver, same)
        if least is None or not least.square > 0:
            return None
        limit = least.square * (1 + room) ** 2
        inside = polytopes.lyapunov_analysis(loops, self.specification, self.solver, same, limit)
        return inside and inside._replace(square=least.square)

    def _gain(
        self, plants: list[PlantMatrices], held: polytopes.ProgramResult, limit: float | None = None
    ) -> Matrix | None:
        """Return the gain of the smallest bound with the slack held; with a limit, the smallest."""
        specification, n, nu = self.specification, plants[0].nx, plants[0].nu
        program = polytopes.PolytopeProgram(specification, n)
        F = program.matrix(nu, n)
        square = program.scalar() if limit is None else Affine.of(limit)
        assert held.X is not None
        for i, p in enumerate(plants):
            A, C = p.A + p.B2 @ F, p.C1 + p.D12 @ F
            seen = Affine.of(specification.seen(C))
            V = specification.at(i, held.P) if held.V is None else held.V
            program.impose(
                i, polytopes.with_slack(held.X, A, seen), C @ V, V, (p.B1, p.D11), square
            )
        if limit is None:
            program.minimise(square)
        else:
            size, eyes = program.scalar(), (np.eye(nu), np.eye(n))
            program.positive(symmetric_block([[size.times(eyes[0]), F], [size.times(eyes[1])]]))
            program.minimise(size)
        solution = self.solver.solve(program)
        return None if solution.x is None else solution.value(F)


def refuse_uncontrollable_vertices(whole: polytopes.Polytope) -> None:
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
    whole = polytopes.polytope(plant, controls, None, control_weight).with_full_state()
    for name, vertex in zip(whole.names, whole.plants, strict=True):
        if norm == "h2" and not vertex.is_discrete and vertex.D11.any():
            raise invalid(
                "plant",
                described(f"D11 that is not zero at {name}"),
                "no direct path from w to z, through which the H2 norm is infinite",
                'Use norm="hinf", or filter z.',
            )
    refuse_uncontrollable_vertices(whole)
    budget = Budget(WORK, time_limit)
    programs = ProgramSolver(backend, solver, budget, polytopes.ACCURACY)
    make = (
        polytopes.LyapunovFamily.common
        if lyapunov == "common"
        else polytopes.LyapunovFamily.per_vertex
    )
    with progress_bar("Designing for all vertices"), enforce_deadline(budget):
        scaled, vertices = polytopes.scaled_vertices(whole)
        family = make(len(vertices))
        specification = polytopes.PolytopeSpecification(family, norm, vertices[0].discrete)
        search = GainSearch(vertices, specification, programs)
        for found in search.candidates():
            proven = search.bound(found)
            # Units are powers of two, but for the root of that of time in an H2 norm.
            bound = math.inf if proven is None else round_up(scaled.norm(proven, norm))
            F = scaled.state_gain(found.gains[0])
            design = _verified_design(whole, norm, lyapunov, F, bound, budget.late)
            if design is not None:
                return design
        share = search.feasible_share()
    raise SolverError(_failure(lyapunov, share, budget.late))


def _verified_design(
    whole: polytopes.Polytope, norm: Norm, lyapunov: Lyapunov, F: Matrix, bound: float, late: bool
) -> RobustStateFeedback | None:
    """Return the design of a gain with all that is proven of it; None if that is too little."""
    certificates = tuple(certify(p, F, norm) for p in whole.plants)
    if not all(c.valid for c in certificates):
        return None
    worst: WorstCaseGain | None = None
    loop = None
    if whole.system is not None:
        loop = polytopes.uncertain_loop(whole.system, whole.plants[0].nz, F)
        try:
            worst = worst_case_gain(loop) if norm == "hinf" else None
        except DeadlineError:
            # A bound that is proven already does without.
            if not math.isfinite(bound):
                raise
    varying = lyapunov == "common" and whole.is_convex_hull and math.isfinite(bound)
    if not whole.is_convex_hull:
        bound = math.inf
    if not varying and worst is not None and worst.proven:
        bound = min(bound, worst.upper)
    if whole.is_convex_hull and not math.isfinite(bound):
        return None
    status: Status = "vertices only"
    if math.isfinite(bound):
        status = "time_limit" if late else "proven"
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


def _message(
    whole: polytopes.Polytope, status: Status, varying: bool, worst: WorstCaseGain | None
) -> str:
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
