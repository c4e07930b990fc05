"""Where descents start: proposals of free numbers, as generators that every structure shares.

Each takes the budget and the random numbers last; the arguments before these are bound by
:func:`functools.partial`.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator, Sequence
from itertools import combinations
from typing import Any, NamedTuple

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import linalg

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.arrays import AnyVector as Vector
from robustpolish.base.budget import Budget, step_cost
from robustpolish.base.checks import matrix
from robustpolish.implementation.reduction import Reducer
from robustpolish.linear.systems import named_system
from robustpolish.plants.blocks import matrices_of
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.certificate import Norm
from robustpolish.synthesis.lmi.output_feedback import (
    bounded_real,
    controllers_near_optimum,
    impose_h2,
    loop_terms,
)
from robustpolish.synthesis.lmi.program import (
    Affine,
    ProgramSolver,
    SemidefiniteProgram,
    block_matrix,
    stabilising_gain,
    symmetric_block,
)
from robustpolish.synthesis.nonsmooth.descent import ObserverGain
from robustpolish.synthesis.nonsmooth.measures import StabilityMeasure, norm_measure
from robustpolish.synthesis.problem.matrices import (
    PlantMatrices,
    absorb_d22,
    controller_from_matrix,
    controller_matrix,
    minimum_effort_problem,
    regularise,
)
from robustpolish.synthesis.problem.matrices import augmented as with_integrators
from robustpolish.synthesis.problem.pole_regions import PoleRegion
from robustpolish.synthesis.riccati.gamma import central_controller, normalise, search_gamma
from robustpolish.synthesis.state_feedback import lmi
from robustpolish.synthesis.state_feedback.riccati import central_state_gain
from robustpolish.synthesis.structured.search import (
    CEILINGS,
    MultistartSearch,
    PartProblem,
    SearchEffort,
)

# Multi-objective output feedback with one Lyapunov matrix for all specifications.
#
# Scherer, Gahinet and Chilali, "Multiobjective output-feedback control via LMI optimization", IEEE
# TAC 42 (1997): the change of variables of the thesis's (10.20) to (10.24) makes every
# specification affine, at the price of a Lyapunov matrix that they share. The answer is a start for
# descents on the true norms, which have no such price.


class Specification(NamedTuple):
    """A norm of a channel: minimised if `bound` is None.

    Attributes
    ----------
    plant : GeneralizedPlant
        The channel, scaled, continuous.
    norm : {"hinf", "h2"}
    bound : float or None
    """

    plant: GeneralizedPlant
    norm: str
    bound: float | None


def mixed_start(
    specifications: Sequence[Specification],
    regions: Sequence[PoleRegion],
    solver: ProgramSolver,
    back_off: float,
) -> Matrix | None:
    """Return [[Ak, Bk], [Ck, Dk]] that meets the inequalities, as far as a solver can tell.

    Parameters
    ----------
    specifications : sequence of Specification
        All on the same A, B2, C2 and D22; exactly one is minimised.
    regions : sequence of PoleRegion
        In the unit of time of the scaled plant.
    solver : ProgramSolver
    back_off : float
        How far the norm backs off from its optimum before the controller is made small.

    Returns
    -------
    ndarray or None
        None if the inequalities have no solution or the solver found none.
    """
    P = specifications[0].plant
    channels = [PlantMatrices.of(each.plant).without_d22() for each in specifications]

    def impose(program: SemidefiniteProgram, unknowns: Any, square: Affine) -> None:
        (v,) = unknowns
        lyapunov = symmetric_block([[v.X, np.eye(P.nx)], [v.Y]])
        for s, channel in zip(specifications, channels, strict=True):
            loop = loop_terms(channel, v)
            target = square if s.bound is None else Affine.of(s.bound**2)
            if s.norm == "hinf":
                program.positive(-bounded_real(loop, target))
            else:
                program.nonnegative(target - impose_h2(program, loop, v))
                program.zero(loop.direct)
        A = block_matrix(loop_terms(channels[0], v).state)
        for region in regions:
            program.positive(lmi.region_matrix(region.L, region.M, lyapunov, A))

    found = next(controllers_near_optimum(channels[:1], impose, solver, [back_off - 1]), None)
    K = None if found is None else absorb_d22(found[0][0], P.D22)
    if K is None or not all(np.isfinite(M).all() for M in K):
        return None
    return controller_matrix(K)


# Multi-objective state feedback with one Lyapunov matrix for all specifications.
#
# With Y and M = F Y, the thesis's (10.18), (10.19), (10.27), (10.28) and the pole regions of
# Chilali and Gahinet are linear at once if all share Y. The answer is a start for descents on true
# norms.


def mixed_state_start(
    specifications: Sequence[Specification],
    regions: Sequence[PoleRegion],
    solver: ProgramSolver,
    back_off: float,
) -> Matrix | None:
    """Return F of u = F x that meets the inequalities, as far as a solver can tell.

    Parameters
    ----------
    specifications : sequence of Specification
        All on the same A and B2; exactly one is minimised.
    regions : sequence of PoleRegion
        In the unit of time of the scaled plant.
    solver : ProgramSolver
    back_off : float
        How far the norm backs off from its optimum before the controller is made small.

    Returns
    -------
    ndarray, shape (nu, nx), or None
        None if the inequalities have no solution or the solver found none.
    """
    problems = [PlantMatrices.of(s.plant) for s in specifications]
    nx, nu = problems[0].nx, problems[0].nu

    def stated(level: float | None) -> tuple[SemidefiniteProgram, Affine, Affine, Affine]:
        """State the inequalities; `level` fixes the square of the minimised norm over the unit."""
        program = SemidefiniteProgram()
        Y, M = program.symmetric(nx), program.matrix(nu, nx)
        program.positive(Y)
        square = program.scalar() if level is None else Affine.of(level)
        for s, p in zip(specifications, problems, strict=True):
            size = unit if s.bound is None else s.bound
            target = square if s.bound is None else Affine.of(1.0)
            own = p.replace(C1=p.C1 / size, D11=p.D11 / size, D12=p.D12 / size)
            if s.norm == "hinf":
                lmi.hinf_inequality(program, own, Y, M, target, np.eye(nx))
            else:
                program.nonnegative(target - lmi.h2_inequality(program, own, Y, M, np.eye(nx)))
        lmi.region_inequalities(program, problems[0], Y, M, regions)
        return program, Y, M, square

    unit, F = 1.0, None
    # The norm is not known before; a second time it is solved in its own unit.
    for _ in range(2):
        program, Y, M, square = stated(None)
        program.minimise(square)
        first = solver.solve(program)
        if first.x is None:
            return F
        unit *= math.sqrt(max(float(first.value(square).item()), 1e-16))
        program, Y, M, _ = stated(back_off**2)
        effort = program.symmetric(nu)
        program.positive(symmetric_block([[effort, M], [Y]]))
        program.minimise(effort.trace)
        second = solver.solve(program)
        if second.x is None:
            return F
        try:
            F = np.linalg.solve(second.value(Y), second.value(M).T).T
        except np.linalg.LinAlgError:
            return None
    return F


Coordinates = Callable[[Matrix], Vector]
"""From K = [[Ak, Bk], [Ck, Dk]] to the free numbers."""
Random = np.random.Generator
Mask = NDArray[np.bool_]

# Share of the work that is left for the proposals of one kind.
_SHARE = 0.3
# Riccati designs that are descended from, the best first.
_PROPOSALS = 6
# Regularisations of the scaled plant for Riccati designs: nobody knows which one is near the best.
_EPSILONS = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
# The search for a controller of lower order is only a start.
_LOWER_ORDER = SearchEffort(descents=12, fewest=5, patience=6)
# With more states a semidefinite program takes longer than the descents that it would start: at 24
# one of up to fifteen takes seconds.
STABILISING_STATES = 24


def known(points: Sequence[Vector], budget: Budget, rng: Random) -> Iterator[Vector]:
    """Propose points that need no search: the user's, or those at rest."""
    yield from points


def stabilising(
    loop: PlantMatrices, mask: Mask, coordinates: Coordinates, budget: Budget, rng: Random
) -> Iterator[Vector]:
    """Propose a gain that stabilises, by cone complementarity, where descents may find none."""
    if loop.nx > STABILISING_STATES:
        return
    solver = ProgramSolver("cvxpy", None, budget.share(_SHARE), accuracy=1e-7)
    # A decay rate of 1e-3 of the plant's size, and 15 semidefinite programs at most.
    gain = stabilising_gain(loop, mask, solver, 1e-3, 15)
    if gain is not None:
        yield coordinates(gain)


def regulator(
    loop: PlantMatrices, mask: Mask, coordinates: Coordinates, budget: Budget, rng: Random
) -> Iterator[Vector]:
    """Propose the gain of the pattern that is nearest to a linear-quadratic state feedback."""
    F = central_state_gain(minimum_effort_problem(loop, 1.0), math.inf)
    if F is not None:
        yield coordinates(np.where(mask, F @ np.linalg.pinv(loop.C2), 0.0))


def inequality(
    specifications: Sequence[Specification],
    regions: Sequence[PoleRegion],
    order: int,
    solver: tuple[str, str | None],
    coordinates: Coordinates,
    budget: Budget,
    rng: Random,
) -> Iterator[Vector]:
    """Propose the controller of inequalities that share one Lyapunov matrix, if there is one."""
    own = budget.share(_SHARE)
    # How far the norm backs off from the optimum before the controller is made small; a dynamic
    # controller needs more room for its change of variables.
    if order:
        program = ProgramSolver(*solver, own, accuracy=1e-8)
        K = mixed_start(specifications, regions, program, 1.05)
    else:
        K = mixed_state_start(specifications, regions, ProgramSolver(*solver, own), 1.01)
    if K is not None:
        yield coordinates(K)


# Riccati designs in observer form.


def riccati(
    plant: PlantMatrices, norm: Norm, coordinates: Coordinates, budget: Budget, rng: Random
) -> Iterator[Vector]:
    """Propose the best central H-infinity and LQG designs as observers; F = L = 0 if none is."""
    form = ObserverGain(plant.A, plant.B2, plant.C2, plant.D22)
    own = budget.share(_SHARE)
    found: list[Vector] = []
    if norm == "hinf" and not plant.discrete:
        found.extend(_central_designs(plant, form, own))
    plain = plant.without_d22()
    for epsilon in _EPSILONS:
        if found and own.over:
            break
        own.spend(2 * step_cost(2 * plant.nx))
        # LQG design for the regularised plant: F and L minimise an H2 norm each.
        P = regularise(plain, epsilon)
        F, L = (central_state_gain(half, math.inf) for half in (P, P.dual))
        if F is not None and L is not None:
            found.append(form.join(F, -L.T))
    objective = norm_measure(with_integrators(plant, plant.nx), norm)

    def achieved(point: Vector) -> float:
        K = form.gain(point)
        # Designs with larger entries than this share of the first ceiling are no starts.
        if np.abs(K).max(initial=0.0) > 0.3 * CEILINGS[0] or budget.over:
            return np.inf
        budget.spend(objective.work)
        pieces = objective.pieces(K, 0.0, ())
        return pieces[0].value if pieces else np.inf

    best = sorted(found, key=achieved)[:_PROPOSALS]
    for point in best or [np.zeros(form.size)]:
        yield coordinates(form.gain(point))


def _central_designs(plant: PlantMatrices, form: ObserverGain, budget: Budget) -> Iterator[Vector]:
    """Yield central H-infinity controllers of regularised plants in observer form."""
    gamma, riccati = 1.0, 2 * step_cost(2 * plant.nx)
    for epsilon in _EPSILONS:
        if budget.over:
            return
        normal = normalise(regularise(plant.without_d22(), epsilon))
        bracket = search_gamma(normal.halves, gamma, 1e-3, budget)
        if bracket is None:
            continue
        gamma = bracket.upper
        # Back-offs from the smallest gamma: nobody knows which one is near the best observer.
        for back_off in (1.001, 1.005, 1.02, 1.2):
            # The observer form tries many invariant subspaces.
            budget.spend(riccati + 30 * step_cost(plant.nx))
            found = normal.halves.attempt(gamma * back_off)
            if not found.feasible or found.X is None or found.Y is None:
                continue
            K = central_controller(normal, gamma * back_off, found.X, found.Y)
            # Dk vanishes with D11; D22 is left out of the formulas and put back by the observer.
            gains = observer_form(plant.A, plant.B2, plant.C2, 0 * plant.D22, K.A, K.B, K.C)
            if gains is not None:
                yield form.join(*gains)


# Starts for a controller of few states: one of fewer states, augmented, and full order, reduced.


def augmented(
    shorter: PartProblem, order: int, coordinates: Coordinates, budget: Budget, rng: Random
) -> Iterator[Vector]:
    """Propose the best controller of fewer states with states added that nobody hears yet.

    The added states listen to y and the others, and their outputs have no weight: the loop is that
    of the shorter controller, and the gradient over their weights is not zero. So no order does
    worse than a lower one that was searched.
    """
    own = budget.share(0.35)
    problem = shorter.below(CEILINGS[0])
    search = MultistartSearch(problem, shorter.stability, _LOWER_ORDER, own)
    found = search.run(shorter.proposals(own, rng), rng).point
    if found is None:
        return
    K = shorter.parametrisation.gain(found)
    k, more, (rows, columns) = shorter.order, order - shorter.order, K.shape
    old_rows = np.r_[:k, k + more : rows + more]
    old_columns = np.r_[:k, k + more : columns + more]
    new = slice(k, k + more)
    for _ in range(3):
        grown = np.zeros((rows + more, columns + more))
        grown[np.ix_(old_rows, old_columns)] = K
        # Time constants of the added states from a tenth to ten times the plant's unit of time.
        rates = 10 ** rng.uniform(-1.0, 1.0, size=more)
        grown[new, new] = np.diag(np.exp(-rates) if shorter.loop.discrete else -rates)
        grown[new, old_columns] = rng.normal(size=(more, columns))
        yield coordinates(grown)


def reduced(
    plant: GeneralizedPlant,
    norm: Norm,
    order: int,
    coordinates: Coordinates,
    budget: Budget,
    rng: Random,
) -> Iterator[Vector]:
    """Propose Riccati designs of full order, reduced in every way: stable loops by their norm.

    A reduced controller seldom keeps the norm, and often not even stability, but lies where good
    controllers of its order are, which random draws on plants with many states hardly ever do.
    """
    inner = PlantMatrices.of(plant)
    if not (inner.nx and inner.nu and inner.ny):
        return
    own = budget.share(_SHARE)
    loop = with_integrators(inner, order)
    measure = norm_measure(loop, norm)
    stability = StabilityMeasure.of(loop, float(np.linalg.norm(loop.A, 2)) or 1.0)

    def merit(K: Matrix) -> tuple[bool, float]:
        if own.over or not np.abs(K).max(initial=0.0) <= CEILINGS[0]:
            return True, np.inf
        own.spend(measure.work)
        norms = measure.pieces(K, 0.0, ())
        pieces = norms or stability.pieces(K, 0.0, ())
        return not norms, pieces[0].value if pieces else np.inf

    with np.errstate(all="ignore"), warnings.catch_warnings():
        # Ill-conditioned equations of extreme designs: what comes of them is compared below.
        warnings.simplefilter("ignore")
        found = list(_reduced_designs(plant, inner, norm, order, own, rng))
        merits = [(merit(K), i) for i, K in enumerate(found)]
    kept: list[tuple[bool, float]] = []
    for value, i in sorted(merits):
        # Several ways of reduction often give the same controller, whose norm is the same.
        alike = (v[0] == value[0] and abs(value[1] - v[1]) <= 1e-3 * abs(value[1]) for v in kept)
        if any(alike) or not np.isfinite(value[1]):
            continue
        kept.append(value)
        yield coordinates(found[i])
        if len(kept) >= _PROPOSALS:
            return


def _reduced_designs(
    plant: GeneralizedPlant, inner: PlantMatrices, norm: Norm, order: int, budget: Budget, rng: Any
) -> Iterator[Matrix]:
    n = inner.nx
    for K in riccati(inner, norm, lambda K: K, budget, rng):
        parts = controller_from_matrix(K, n)
        own = control.StateSpace(*parts, plant.dt, remove_useless_states=False)
        # Its Gramians are those of a loop with twice the states.
        budget.spend(10 * step_cost(2 * n))
        try:
            reducer = Reducer(plant, own)
        except (np.linalg.LinAlgError, ValueError):
            continue
        for candidate in reducer.of_order(order):
            yield padded(candidate.controller, order)


def padded(controller: control.StateSpace, order: int) -> Matrix:
    """Return [[Ak, Bk], [Ck, Dk]] of a controller, with idle states up to an order."""
    A, B, C, D = matrices_of(controller)
    more = order - len(A)
    idle = 0.5 if controller.isdtime(strict=True) else -1.0
    return np.block(
        [
            [linalg.block_diag(A, idle * np.eye(more)), np.pad(B, ((0, more), (0, 0)))],
            [np.pad(C, ((0, 0), (0, more))), D],
        ]
    )


# Observers with state feedback: the controller of F and L, and F and L of a controller.


# Up to this many real poles and pairs every choice of poles is tried; beyond, some drawn at random.
_ALL_CHOICES = 10
_DRAWN_CHOICES = 30


def observer_form(
    A: Matrix, B: Matrix, C: Matrix, D: Matrix, Ak: Matrix, Bk: Matrix, Ck: Matrix
) -> tuple[Matrix, Matrix] | None:
    """Find F and L whose observer-based controller equals a given one.

    Any strictly proper controller of the plant's order is, in suitable coordinates, a Luenberger
    observer with u = F xhat (Bender and Fowell 1985; Alazard and Apkarian 1999). So the H-infinity
    problem over F and L, which is bilinear in (10.74) of the thesis, has the same infimum as the
    convex one over strictly proper controllers. The controller's state is T xhat with T of the
    invariant subspace [I; T] of the loop matrix; the loop's poles are then those of A + B F, chosen
    for the subspace, and of A - L C. Among the choices the best conditioned T is taken.

    Parameters
    ----------
    A, B, C, D : ndarray
        The plant from u to y, with n states.
    Ak, Bk, Ck : ndarray
        A strictly proper controller with n states.

    Returns
    -------
    tuple of ndarray or None
        None if no choice gives an invertible T to working accuracy.
    """
    n = len(A)
    loop = np.block([[A, B @ Ck], [Bk @ C, Ak + Bk @ D @ Ck]])
    found = np.linalg.eig(loop)
    poles, vectors = np.asarray(found[0], complex), np.asarray(found[1], complex)
    best, condition = None, 1e10
    for choice in _choices(poles, n):
        top, bottom = vectors[:n, choice], vectors[n:, choice]
        if np.linalg.cond(top) > 1e12:
            continue
        T = np.linalg.solve(top.T, bottom.T).T
        own = float(np.linalg.cond(T.real))
        if np.abs(T.imag).max() <= 1e-6 * np.abs(T).max() and own < condition:
            best, condition = (Ck @ T.real, np.linalg.solve(T.real, Bk)), own
    return best


def _choices(poles: NDArray[np.complex128], n: int) -> list[list[int]]:
    """Return sets of n poles closed under conjugation; all of them for small plants."""
    groups = _conjugate_groups(poles)
    if len(groups) <= _ALL_CHOICES:
        return [
            [i for group in members for i in group]
            for count in range(len(groups) + 1)
            for members in combinations(groups, count)
            if sum(map(len, members)) == n
        ]
    rng = np.random.default_rng(0)
    orders = [groups, groups[::-1]]
    orders += [[groups[i] for i in rng.permutation(len(groups))] for _ in range(_DRAWN_CHOICES)]
    choices = []
    for order in orders:
        choice: list[int] = []
        for group in order:
            if len(choice) + len(group) <= n:
                choice.extend(group)
        choices.append(choice)
    return [choice for choice in choices if len(choice) == n]


def _conjugate_groups(poles: NDArray[np.complex128]) -> list[list[int]]:
    """Return the indices of real poles and of complex pairs, slow ones first."""
    rest = sorted(range(len(poles)), key=lambda i: (-poles[i].real, abs(poles[i].imag)))
    groups: list[list[int]] = []
    while rest:
        group = [rest.pop(0)]
        pole = poles[group[0]]
        if pole.imag != 0 and rest:
            group.append(min(rest, key=lambda j: abs(poles[j] - np.conj(pole))))
            rest.remove(group[1])
        groups.append(group)
    return groups


def observer_controller(plant: GeneralizedPlant, F: ArrayLike, L: ArrayLike) -> control.StateSpace:
    """Return the observer (10.63) with u = F xhat as a controller u = K y.

    Parameters
    ----------
    plant : GeneralizedPlant
    F : array_like, shape (nu, nx)
        State feedback, the thesis's D_c.
    L : array_like, shape (nx, ny)
        Observer gain, the thesis's C_c.

    Returns
    -------
    control.StateSpace
        Its states are the estimates, named after the plant's states with ``_hat``.

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    >>> K = rp.synthesis.observer_controller(plant, [[-3.0]], [[4.0]])
    >>> sorted(plant.closed_loop(K).poles().real.round(9).tolist())
    [-3.0, -2.0]
    """
    F = matrix("F", F, (plant.nu, plant.nx))
    L = matrix("L", L, (plant.nx, plant.ny))
    A = plant.A + plant.B2 @ F - L @ (plant.C2 + plant.D22 @ F)
    states = [f"{name}_hat" for name in plant.states]
    names = (plant.measurement_names, plant.control_names, states)
    return named_system((A, L, F, np.zeros((plant.nu, plant.ny))), plant.dt, *names)
