"""Dynamic output feedback for the H-infinity or the H2 norm, of full order or of a given one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from robustpolish.base.budget import (
    Budget,
    enforce_deadline,
    progress_bar,
    single_threaded_blas,
    step_cost,
)
from robustpolish.base.checks import described, invalid, positive
from robustpolish.errors import SolverError
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis import driver
from robustpolish.synthesis.backends.slycot_backend import synthesise
from robustpolish.synthesis.certificate import Gamma, Norm, NormTarget, norm_in_words
from robustpolish.synthesis.design import Design
from robustpolish.synthesis.driver import (
    AS_GOOD_AS_ZERO,
    COSTLY_STATES,
    EPSILONS,
    FALLING,
    SETTLED,
    SHIFTS,
    Candidate,
    Engine,
    Settings,
    Task,
)
from robustpolish.synthesis.lmi import output_feedback as lmi
from robustpolish.synthesis.lmi.program import ProgramSolver, SemidefiniteProgram
from robustpolish.synthesis.problem import matrices
from robustpolish.synthesis.problem.preflight import (
    SolvabilityCheck,
    check_solvability,
    decoupled_parts,
    whole_plant,
    with_control_penalty,
    with_measurement_noise,
)
from robustpolish.synthesis.riccati.gamma import (
    Attempt,
    GammaBracket,
    NormalisedPlant,
    central_controller,
    has_full_rank,
    normalise,
    search_gamma,
)
from robustpolish.synthesis.state_feedback.riccati import lqg
from robustpolish.synthesis.structured import methods
from robustpolish.synthesis.structured.search import TIME_LIMIT

# H-infinity output feedback by Riccati equations on a ladder of regularised plants.
#
# A regularised plant has a solution of its two Riccati equations whatever the rank of D12 and D21
# and whatever zeros lie on the axis. Its norm bounds the true one from above, and falls to it as
# epsilon goes to zero. So epsilon descends from 0.1 in half decades until the norm of the true
# loop, which alone is believed, is near the lower bound, or no longer improves.
#
# Where only zeros on the axis are in the way, as for a servo with an integrator and weights on S
# and K S, the axis is moved to the left instead, which costs next to nothing whatever the weights.


# H2 output feedback by Riccati equations, on regularised plants where need be.


class Lqg(Engine):
    """One pair of Riccati equations on a regular plant.

    A singular one is regularised less and less, as for the H-infinity norm, until the norm of the
    true loop settles.
    """

    def search(self) -> None:
        """Minimise the H2 norm of the loop."""
        if self._solved(0.0):
            return
        quiet = 0
        norms: list[float] = []
        # Singular H2 problems, whose equations bear half a decade less regularisation.
        for epsilon in (*EPSILONS, 10.0**-9):
            if self.budget.over:
                break
            before = self.best
            if not self._solved(epsilon):
                continue
            norms.append(self.best)
            # A relative fall of the H2 norm that is none.
            quiet = quiet + 1 if self.best > before * (1 - 1e-6) else 0
            if quiet >= 2:
                return
        self.falling = len(norms) > 4 and norms[-1] < FALLING * norms[-5]

    def _solved(self, epsilon: float) -> bool:
        self.budget.spend(step_cost(self.problem.plant.nx))
        K = lqg(matrices.regularise(self.problem.plant, epsilon))
        candidate = None if K is None else self.checked(K, np.inf, f"riccati, {epsilon:.1e}")
        if candidate is not None:
            self.candidates.append(candidate)
            seen = {"achieved": candidate.achieved, "gain": candidate.gain}
            self.history.append({"epsilon": epsilon, **seen})
        return candidate is not None


class Regularisation(NamedTuple):
    """How a plant is changed so that its equations have a solution.

    ``epsilon`` is the price, noise and disturbance of ``matrices.regularise``, ``shift`` by how
    much the axis is moved to the left; see ``matrices.shifted``.
    """

    epsilon: float
    shift: float = 0.0

    def normalised(self, plant: matrices.PlantMatrices) -> NormalisedPlant:
        """Change a plant and bring it into the coordinates of the equations."""
        return normalise(matrices.shifted(matrices.regularise(plant, self.epsilon), self.shift))


_AXIS = tuple(Regularisation(0.0, shift) for shift in (0.0, *SHIFTS))
_LADDER = tuple(Regularisation(epsilon) for epsilon in EPSILONS)
# How far above the optimal gamma central controllers are made, the most wanted first; nearer than
# 5e-4 they break their promise, and hard plants (NN9, HE1) need 1.01 or 1.03.
_BACK_OFFS = (1.003, 1.0005, 1.01, 1.03)
# Further distances from the optimum, tried on rungs that came close.
_REFINEMENTS = (1.0005, 1.001, 1.006)
# Rungs without a fall after which a ladder without a lower bound to aim at ends.
_QUIET = 3


class RegularisedRiccati(Engine):
    """Two Riccati equations on plants regularised less and less."""

    def __init__(self, settings: Settings, problem: Task, budget: Budget) -> None:
        super().__init__(settings, problem, budget)
        self.plant, self.gamma = problem.plant, 1.0
        self.costly = self.plant.nx > COSTLY_STATES
        # Beyond so many states of a plant the first controller that keeps the tolerance ends the
        # search, and none at further distances from the optimum is tried: each takes as long as
        # all the rest of a rung.
        self.many = self.plant.nx > 100
        self.near = problem.goal if self.many else problem.near
        # A finer tolerance than the usual one asks for finer steps.
        self.fineness = min(1.0, problem.tolerance / 4e-3)
        self.settled = SETTLED * self.fineness
        self.rungs: list[Regularisation] = []  # of the entries of the history

    def search(self) -> None:
        """Descend until the norm is good enough, settles or cannot be computed any more."""
        if self.problem.asked and self._solve_requested_gamma():
            return
        regular = self._solve_regular()
        quiet, failures = 0, 0
        waiting: tuple[NormalisedPlant, GammaBracket, Regularisation] | None = None
        # A price and a noise on x cost much beside weights that put zeros on the axis.
        done = self.best <= self.near and (self.many or any(rung.shift for rung in self.rungs))
        for rung in () if done else _LADDER:
            if self.budget.over or failures == 2:
                break
            normal = rung.normalised(self.plant)
            before, best = self.gamma, self.best
            bracket = self._bracket(normal)
            if bracket is None:
                failures += 1
                continue
            self.gamma = bracket.upper
            self._note(rung, self.gamma)
            # Where a norm is costly, loops are not checked on the first rung, nor while gamma falls
            # by more than this from one to the next.
            first = len(self.history) == regular + 1
            if self.costly and (first or self.gamma < (1 - 0.03) * before):
                waiting = normal, bracket, rung
                continue
            waiting = None
            candidate = self._confirmed(normal, bracket, rung)
            if candidate is None:
                failures += 1
                continue
            failures = 0
            self._take(candidate)
            # Entries of a controller above it cannot be verified in double precision.
            if candidate.achieved <= self.near or candidate.gain > 1e10:
                break
            if candidate.achieved <= best * 1.1:
                quiet = quiet + 1 if candidate.achieved > best * (1 - self.settled) else 0
            if quiet >= _QUIET and self.problem.bound is None:
                break
        if waiting is not None:
            self.candidates += filter(None, [self._confirmed(*waiting)])
        # The last two decades of epsilon have lowered the norm for certain.
        norms = [note["achieved"] for note in self.history if note["achieved"] >= 0]
        falls = len(norms) > 4 and min(norms) < FALLING * min(norms[:-4])
        self.falling = not regular and self.best > self.problem.goal and falls
        if not self.many:
            self._refine()

    def _note(self, rung: Regularisation, gamma: float) -> None:
        """Begin an entry of the history."""
        note: dict[str, Any] = {"epsilon": rung.epsilon, "gamma": gamma}
        note |= {"achieved": np.nan, "gain": np.nan} | ({"shift": rung.shift} if rung.shift else {})
        self.history.append(note)
        self.rungs.append(rung)

    def _take(self, candidate: Candidate) -> None:
        """Keep a candidate, and tell it in the last entry of the history."""
        self.history[-1] |= {"achieved": candidate.achieved, "gain": candidate.gain}
        self.candidates.append(candidate)

    def _solve_requested_gamma(self) -> bool:
        """Make the central controller for the norm that was asked for; tell whether that worked.

        The gain grows down the ladder, so that the first rung that has one is the best.
        """
        for rung in (*_AXIS, *_LADDER) if has_full_rank(self.plant) else _LADDER:
            if self.budget.over:
                return False
            candidate = self._controller(rung.normalised(self.plant), self.problem.goal, rung)
            if candidate is not None and candidate.achieved <= self.problem.goal:
                self._note(rung, candidate.claimed)
                self._take(candidate)
                return True
        return False

    def _solve_regular(self) -> int:
        """Solve a plant whose D12 and D21 have full rank; return how many entries that made.

        As it is, or with the axis moved less and less where zeros lie on it.
        """
        if not has_full_rank(self.plant):
            return 0
        bound = self.problem.bound
        bracket = None if bound is None else bound.bracket
        for rung in _AXIS:
            if self.budget.over:
                break
            normal, start = rung.normalised(self.plant), 1.0
            if rung.shift and bracket is not None:
                # How far the optimal gamma is expected to move with the axis; looked at first.
                start, near = bracket.upper * (1 + 0.02), 0.02
                bracket = search_gamma(normal.halves, start, near, self.budget, near)
            bracket = search_gamma(normal.halves, start, self.settled, self.budget, known=bracket)
            candidate = None if bracket is None else self._confirmed(normal, bracket, rung)
            if bracket is None or candidate is None:
                continue
            self._note(rung, bracket.upper)
            self._take(candidate)
            if candidate.achieved <= self.near or bound is None:
                break
        return len(self.rungs)

    def _bracket(self, normal: NormalisedPlant) -> GammaBracket | None:
        """Find the optimal gamma of one rung: coarsely while it falls fast, then finely."""
        first = self.gamma == 1.0
        shortcut = 0.0 if first else self.settled
        rough = search_gamma(normal.halves, self.gamma, 0.02, self.budget, shortcut)
        if rough is None or rough.upper < 0.9 * self.gamma or first:
            return rough
        return search_gamma(normal.halves, rough.upper, self.settled, self.budget, known=rough)

    def _confirmed(
        self, normal: NormalisedPlant, bracket: GammaBracket, rung: Regularisation
    ) -> Candidate | None:
        """Make a controller a little above the optimal gamma that keeps its promise."""
        for factor in _BACK_OFFS:
            usual = factor > 1 + self.problem.tolerance
            factor = 1 + (factor - 1) * (1.0 if usual else self.fineness)
            candidate = self._controller(normal, bracket.upper * factor, rung)
            if candidate is not None:
                return candidate
            if self.budget.over:
                return None
        return None

    def _controller(
        self, normal: NormalisedPlant, gamma: float, rung: Regularisation
    ) -> Candidate | None:
        self.budget.spend(step_cost(self.plant.nx))
        solution = normal.halves.attempt(gamma)
        if solution.X is None or solution.Y is None or not solution.feasible:
            return None
        try:
            K = central_controller(normal, gamma, solution.X, solution.Y)
        except np.linalg.LinAlgError:
            return None
        K = K.shifted_back(rung.shift)
        candidate = self.checked(K, gamma, f"riccati, epsilon {rung.epsilon:.1e}")
        return candidate if candidate is not None and candidate.keeps_claim else None

    def _refine(self) -> None:
        """Try other distances from the optimal gamma on the rungs that came close to the goal."""
        close = max(self.best, self.problem.goal) * 1.02
        notes = zip(self.history, self.rungs, strict=True)
        close_by = [(note, rung) for note, rung in notes if note["achieved"] <= close]
        # The gain grows down the ladder, so the first rungs are worth the most.
        for note, rung in close_by[: 2 if self.costly else None]:
            normal = rung.normalised(self.plant)
            for factor in _REFINEMENTS[1 if self.costly else 0 :]:
                if self.budget.over:
                    return
                gamma = note["gamma"] * (1 + (factor - 1) * self.fineness)
                self.candidates += filter(None, [self._controller(normal, gamma, rung)])


# H-infinity output feedback by linear matrix inequalities: balance, solve, tighten, verify.
#
# The projected inequalities are feasibility problems at one gamma. Where gamma has to go is told by
# the lower bound, and in which states and units to pose them by the Riccati equations of the
# plant, regularised as much as that gamma allows: coordinates change no inequality, but
# decide whether a solver in double precision can answer it. R and S, and the controller made of
# them, are the inequalities' own. A gamma that is not reached at once is approached in steps,
# the solution of one being the unit of the next.


# By how much the axis is moved where there are a price and a noise too.
_SHIFTS = (0.0, 1e-5, 1e-7)
# What counts as small in X and XY (:func:`balanced_states`), one choice after the other: no single
# one suits weights with poles over six decades and AC6.
_LEAST = ((1e-2, 1e-2), (1e-1, 1e-2), (1e-4, 1e-4), (1.0, 1.0))
# How far above its optimum a regularised plant is asked for where no lower bound tells.
_ABOVE_OPTIMUM = 1.01


class _RegularisedSolution(NamedTuple):
    """A regularised plant with solutions of its Riccati equations at a gamma."""

    epsilon: float
    shift: float
    plant: matrices.PlantMatrices
    gamma: float
    solution: Attempt


class _LmiEngine(Engine):
    """Engines that solve semidefinite programs."""

    method = "lmi"

    def __init__(self, settings: Settings, problem: Task, budget: Budget) -> None:
        super().__init__(settings, problem, budget)
        self.backend = settings.backend
        self.solver = ProgramSolver(settings.backend, settings.solver, budget)


class LmiHinf(_LmiEngine):
    """Projected inequalities; the claims of the candidates are the gammas they were solved for."""

    @staticmethod
    def is_useful(problem: Task, earlier: Sequence[Engine]) -> bool:
        """Tell whether a small plant is left for which no limit of the gain explains the norm."""
        small = problem.plant.nx <= lmi.LMI_STATES
        return not earlier or (small and not any(engine.falling for engine in earlier))

    def search(self) -> None:
        """Minimise the H-infinity norm of the loop."""
        if not (self.problem.goal > 0 and self._at_goal()):
            self._downwards()

    def _at_goal(self) -> bool:
        """Aim at the goal on the plants that are regularised the most; tell whether it is met."""
        problem = self.problem
        bound = 0.0 if problem.bound is None else problem.bound.value
        # Share of the tolerance above the lower bound at which the equations of a regularised plant
        # have to have a solution; the inequalities are posed nearer to the tolerance.
        level = max(bound * (1 + 0.7 * problem.tolerance), problem.asked * (1 - 1e-3))
        # Regularisations that are tried where a controller is missed.
        for rung in islice(_feasible(problem.plant, level, self.budget), 2):
            for least in _LEAST:
                self._descend(rung, problem.goal, least)
                if self.best <= problem.goal:
                    return True
        return bool(self.candidates)

    def _downwards(self) -> None:
        """Follow plants that are regularised less and less where no goal is known or reached."""
        start, failures = 1.0, 0
        norms: list[float] = []
        # Programs take long, so that decades have to do.
        for epsilon in EPSILONS[::2]:
            if failures == 2 or self.budget.over:
                break
            rung = _optimal(self.problem.plant, epsilon, start, self.budget)
            if rung is None:
                failures += 1
                continue
            start, before = rung.gamma, self.best
            for least in _LEAST[:2]:
                self._descend(rung, rung.gamma, least)
                if self.best < before:
                    break
            failures = 0 if self.best < before else failures + 1
            norms.append(self.best)
            if self.best <= AS_GOOD_AS_ZERO * norms[0] or self.best <= self.problem.near:
                break
        falls = len(norms) > 2 and norms[-1] < FALLING * norms[-3]
        self.falling = self.best > self.problem.goal and falls

    def _descend(self, rung: _RegularisedSolution, goal: float, least: tuple[float, float]) -> None:
        """Look for controllers with a norm below `goal`, at once or by gammas that fall."""
        solution = rung.solution
        if solution.X is None or solution.Y is None or self.budget.over:
            return
        P = lmi.balanced_states(rung.plant, solution.X, solution.Y, rung.gamma, least)
        if P is None:
            return
        # Numbers of order one suit the solver: the norm is divided by the goal, half of it at w and
        # half at z.
        root = np.sqrt(goal)
        P = P.replace(
            B1=P.B1 / root, D21=P.D21 / root, C1=P.C1 / root, D12=P.D12 / root, D11=P.D11 / goal
        )
        if self._solved(P, None, 1.0, goal, rung) is not None:
            return
        # How far above the lower bound gamma starts where the goal itself is not reached.
        gamma, failures = 1.03, 0
        known, reached = (P, None), np.inf
        # The most programs of one descent, of which three may find nothing.
        for _ in range(9):
            after = self._solved(*known, gamma, goal, rung)
            if after is None:
                failures += 1
                if failures > 3 or self.budget.over:
                    return
                # Growth of a first gamma that is not reached either.
                gamma = (gamma + reached) / 2 if np.isfinite(reached) else gamma * 1.02
                continue
            known, reached = after, gamma
            if gamma <= 1.0:
                return
            # What is nearly there is asked for at once.
            # Three tenths of the distance are left after one step.
            lower = 1 + 0.3 * (gamma - 1)
            gamma = lower if lower > 1 + 1e-3 else 1.0

    def _solved(
        self,
        plant: matrices.PlantMatrices,
        near: lmi.ProjectedSolution | None,
        gamma: float,
        goal: float,
        rung: _RegularisedSolution,
    ) -> tuple[matrices.PlantMatrices, lmi.ProjectedSolution] | None:
        """Solve at a gamma, in units of `goal`, beside a known solution, if there is one.

        Returns the plant and the solution in better states; None unless the controller keeps gamma.
        """
        point = lmi.solve_projected(plant, gamma, self.solver, near)
        after = None if point is None else lmi.rebalanced(plant, point.R, point.S)
        K = None if after is None else lmi.explicit_controller(after[0], gamma, after[1])
        claim = gamma * goal
        note = {"epsilon": rung.epsilon, "gamma": claim, "achieved": np.nan, "gain": np.nan}
        if rung.shift:
            note["shift"] = rung.shift
        self.history.append(note)
        if K is None or after is None:
            return None
        origin = f"lmi, epsilon {rung.epsilon:.1e}"
        candidate = self.checked(K.shifted_back(rung.shift), claim, origin)
        if candidate is None:
            return None
        note["achieved"], note["gain"] = candidate.achieved, candidate.gain
        self.candidates.append(candidate)
        if not candidate.keeps_claim:
            return None
        sizes = np.diag(after[1])
        return after[0], lmi.ProjectedSolution(sizes, sizes, gamma)


def _feasible(
    plant: matrices.PlantMatrices, gamma: float, budget: Budget
) -> Iterator[_RegularisedSolution]:
    """Yield regularised plants whose equations have solutions at a gamma, the strongest first."""
    pairs = [(epsilon, shift) for epsilon in EPSILONS for shift in _SHIFTS]
    if has_full_rank(plant):
        pairs = [(0.0, shift) for shift in (0.0, *SHIFTS)] + pairs
    for epsilon, shift in pairs:
        if budget.over:
            return
        regular = matrices.shifted(matrices.with_penalty_and_noise(plant, epsilon), shift)
        budget.spend(step_cost(plant.nx))
        solution = normalise(regular).halves.attempt(gamma)
        if solution.feasible:
            yield _RegularisedSolution(epsilon, shift, regular, gamma, solution)


def _optimal(
    plant: matrices.PlantMatrices, epsilon: float, start: float, budget: Budget
) -> _RegularisedSolution | None:
    """Return a regularised plant a little above the optimum of its equations.

    Of all shifts that with the smallest optimum: a smaller one leaves zeros too near the axis.
    """
    best: _RegularisedSolution | None = None
    for shift in _SHIFTS:
        regular = matrices.shifted(matrices.with_penalty_and_noise(plant, epsilon), shift)
        halves = normalise(regular).halves
        bracket = search_gamma(halves, start, _ABOVE_OPTIMUM - 1, budget)
        gamma = np.inf if bracket is None else bracket.upper * _ABOVE_OPTIMUM
        if best is None or gamma < best.gamma:
            solution = halves.attempt(gamma) if np.isfinite(gamma) else None
            if solution is not None and solution.feasible:
                best = _RegularisedSolution(epsilon, shift, regular, gamma, solution)
    return best


# H2 output feedback by linear matrix inequalities: solve, rebalance, back off, verify.

# Solutions in states that are rebalanced by the last one, and a relative fall that ends them.
_ROUNDS, _AGREEMENT = 4, 2e-3
# How far above the optimum controllers are asked for.
_GAMMA_BACK_OFFS = (1.00005, 1.003)


class LmiH2(_LmiEngine):
    """Inequalities (10.29) to (10.32)."""

    def search(self) -> None:
        """Minimise the H2 norm of the loop."""
        optimum, frame = np.inf, self.problem.plant
        for _ in range(_ROUNDS):
            program = SemidefiniteProgram()
            v = lmi.LmiVariables.of(program, frame, "h2")
            energy = lmi.impose_h2(program, lmi.loop_terms(frame, v), v)
            lmi.coupling(program, v)
            program.minimise(energy)
            solution = self.solver.solve(program)
            square = float(solution.value(energy).item())
            if not square > 0:
                break
            values = v.at(solution)
            self.history.append({"claim": np.sqrt(square)})
            self._keep(lmi.reconstruct(frame, values), np.sqrt(square) * (1 + 1e-4))
            settled = square > optimum * (1 - _AGREEMENT)
            optimum = min(optimum, square)
            after = lmi.rebalanced(frame, values.X, values.Y)
            if after is None:
                break
            frame = after[0]
            if settled:
                break
        if not np.isfinite(optimum):
            return
        for factor in _GAMMA_BACK_OFFS:
            bound = factor * np.sqrt(optimum)

            def impose(program: SemidefiniteProgram, each: Any, bound: float = bound) -> None:
                (v,) = each
                program.nonnegative(bound**2 - lmi.impose_h2(program, lmi.loop_terms(frame, v), v))

            for (K,) in lmi.well_conditioned_controllers([frame], "h2", impose, self.solver):
                self._keep(K, bound)

    def _keep(self, K: matrices.Controller | None, bound: float) -> None:
        candidate = None if K is None else self.checked(K, bound, "lmi")
        if candidate is not None:
            self.candidates.append(candidate)


# SLICOT's routines as an engine, for comparison: their claims are remarks, not results.

# Regularisation for SLICOT's routines, which refuse plants whose D12 or D21 lacks rank.
SLYCOT_EPSILON = 1e-4


class Slycot(Engine):
    """SB10AD for the H-infinity norm or SB10HD for the H2 norm.

    They find at most one controller, whose claim may be false; a remark says so.
    """

    method = backend = "slycot"

    def search(self) -> None:
        """Run the routine in a process of its own, which the safety net ends."""
        problem = self.problem
        P = matrices.regularise(problem.plant, 0.0 if problem.regular else SLYCOT_EPSILON)
        routine = "SB10AD" if problem.norm == "hinf" else "SB10HD"
        answer = synthesise(routine, (P.nx, P.nu, P.ny), P.system, self.budget.seconds_left)
        self.budget.update_late()
        if answer.controller is None:
            self.remarks.append(f"{answer.message}.")
            return
        claimed = np.inf if answer.gamma is None else answer.gamma
        self.history.append({"gamma": claimed, "regularised": not problem.regular})
        candidate = self.checked(matrices.Controller(*answer.controller), claimed, routine)
        if candidate is None:
            self.remarks.append(f"The controller of {routine} does not stabilise the plant.")
            return
        self.candidates.append(candidate)
        if not candidate.keeps_claim:
            self.remarks.append(
                f"{routine} claimed a norm {candidate.achieved / claimed:.4g} times smaller than "
                "that of its loop."
            )


Method = Literal["auto", "riccati", "lmi", "slycot"]

# The order in which each method calls the engines. To add one, write a subclass of
# :class:`~robustpolish.synthesis.driver.Engine` in a file of its own and name it here.

ENGINES: Mapping[str, Mapping[str, tuple[type[Engine], ...]]] = {
    "hinf": {
        "auto": (RegularisedRiccati, LmiHinf),
        "riccati": (RegularisedRiccati,),
        "lmi": (LmiHinf,),
        "slycot": (Slycot,),
    },
    "h2": {"auto": (Lqg,), "riccati": (Lqg,), "lmi": (LmiH2,), "slycot": (Slycot,)},
}
# Steps that one call may spend before `effort` is applied: about ten times what the slowest of 24
# COMPleib plants needs, and a few seconds.
_WORK = 20_000.0


@single_threaded_blas
def output_feedback(
    plant: GeneralizedPlant,
    norm: Norm = "hinf",
    method: Method = "auto",
    *,
    backend: str = "cvxpy",
    solver: str | None = None,
    control_weight: ArrayLike | None = None,
    measurement_noise: ArrayLike | None = None,
    gamma: Gamma | None = None,
    tolerance: float = 4e-3,
    effort: float = 1.0,
    time_limit: float | None = None,
    split: bool = True,
    order: int | None = None,
) -> Design:
    r"""Design a dynamic controller u = K y from the measurements for the smallest norm.

    The controller has at most as many states as the plant, or as `order` says. Scaling of
    signals, states and time, decoupled parts, D11 and D22, rank-deficient D12 and D21 and zeros
    on the stability boundary are taken care of. Only what is computed afresh from the closed loop
    is believed, and every design carries a proof of its stability and norm.

    Parameters
    ----------
    plant : GeneralizedPlant
        Continuous or discrete.
    norm : {"hinf", "h2"}
        The norm of the loop from w to z that is minimised.
    method : {"auto", "riccati", "lmi", "slycot"}
        "riccati": two Riccati equations on plants regularised less and less; "lmi": linear matrix
        inequalities, thesis (10.20) to (10.24), projected, and (10.29) to (10.32), in states
        that Riccati equations balance and at norms that the lower bound tells; "slycot": the SLICOT
        routines SB10AD and SB10HD in a process of their own; "auto": Riccati, and
        matrix inequalities where that leaves doubt.
    backend : {"cvxpy", "picos"}
        Who solves the matrix inequalities.
    solver : str, optional
        A solver of that backend, such as "SCS"; Clarabel or CVXOPT by default.
    control_weight : float or array_like, shape (nu,), optional
        Price on u, in units of z per unit of u, appended to z.
    measurement_noise : float or array_like, shape (ny,), optional
        Noise on y, in units of y per unit of w, appended to w. Where D12 or D21 is rank-deficient,
        price and noise together make a problem with an optimum of finite gain.
    gamma : float or (float, float), optional
        A number asks for any controller with a norm below it: the central one, which has
        less gain and more robustness than those near the infimum. A range (low, high) asks for the
        smallest norm above `low`; a controller near `low` will do. What no controller
        reaches is refused. In the plant's units, as `certificate.achieved`.
    tolerance : float
        How far above the infimum, relative, a controller may lie to have a smaller gain or fewer
        states.
    effort : float
        Factor on the work that the search may do. It is counted in steps, so that every machine,
        busy or idle, gives the same answer.
    time_limit : float, optional
        A safety net, in seconds; 60 s, and 300 s with `order`. If it is reached the status is
        "time_limit", and another machine may find something else; otherwise it changes nothing.
        It covers the certificate, for which the search leaves a quarter of the time, at most 5 s;
        where its proof is not complete half a second after the limit, there is no design.
        Functions are compiled once per user and version; these seconds are not counted.
    split : bool
        Whether to solve parts of the plant that share no signal one by one, which is quicker and
        gives the same norm.
    order : int, optional
        The most states that the controller may have; 0 is static feedback u = F y. The problem is
        then not convex: full-order designs are reduced, and from these, from controllers of fewer
        states and from random ones the norm itself is lowered. The result is certified, a local
        minimum, and its message says how far it is from what any order reaches.

    Returns
    -------
    Design
        Its status is "optimal" if the norm lies within `tolerance` of ``lower_bound``;
        "infimum_not_attained" if ever larger gains were still improving it; "time_limit" if
        the safety net was reached; "suboptimal" otherwise. ``details`` hold the ``diagnosis``,
        the ``claim`` of the method, which may be false, the ``work`` done in steps, the range
        that ``gamma`` asked for, per part the states (``parts``) and norms (``part_norms``),
        and an ``estimated_infimum`` where no bound is known: of doubles, and no bound. Its plant
        includes price and noise.

    Raises
    ------
    InfeasibleError
        If no controller stabilises the plant; it names the mode and the state that carries it. For
        the H2 norm also if D11 cannot be cancelled, which makes the norm infinite. And if the
        lower bound, which is told, lies above what `gamma` asks for.
    SolverError
        If no controller was found, none could be certified, or none keeps what `gamma` asks for.
    InvalidInputError
        If an argument does not fit.

    Notes
    -----
    Zhou, Doyle, Glover, "Robust and Optimal Control", 1996, theorem 17.1, for the Riccati
    equations; Stoorvogel, "The singular H-infinity control problem with dynamic measurement
    feedback", SIAM J. Control and Optimization 29 (1991) 160-184, for the lower bound where D12 or
    D21 is rank-deficient; Scherer, Gahinet, Chilali, "Multiobjective output-feedback control via
    LMI optimization", IEEE Trans. Automatic Control 42 (1997) 896-911, for the inequalities.

    Discrete-time plants are mapped to continuous time for the H-infinity norm, which keeps it
    exactly, and solved by discrete Riccati equations for the H2 norm.

    A plant of more than 100 states is searched without those that change its response by less than
    1e-8 of its largest Hankel singular value, if these are at least half of them: the controller
    has as few states. The certificate is that of the whole plant; where its loop has another norm,
    or its equations a solution below the bound, all states are searched. The message says so.

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.GeneralizedPlant.from_matrices(
    ...     [[0.0, 1.0], [0.0, 0.0]], [[0.0, 0.0], [1.0, 0.0]], [[0.0], [1.0]],
    ...     [[1.0, 0.0], [0.0, 0.0]], [[1.0, 0.0]], D12=[[0.0], [1.0]], D21=[[0.0, 1.0]])
    >>> design = rp.output_feedback(plant)
    >>> design.status, round(design.certificate.achieved, 1), design.certificate.valid
    ('optimal', 2.6, True)

    Any controller with a norm below 4, which has less gain:

    >>> gentle = rp.output_feedback(plant, gamma=4.0)
    >>> bool(gentle.certificate.bound <= 4.0)
    True

    A single state instead of two:

    >>> lean = rp.output_feedback(plant, order=1, effort=0.1)
    >>> lean.controller.nstates, lean.certificate.valid
    (1, True)
    """
    seconds = (60.0 if order is None else TIME_LIMIT) if time_limit is None else time_limit
    driver.check_arguments(plant, norm, method, ENGINES["hinf"], backend, tolerance, seconds)
    positive("effort", effort)
    if norm == "h2" and plant.is_discrete and method in ("lmi", "slycot"):
        shown = described(f"{method!r} for the H2 norm of a discrete-time plant")
        remedy = "Only the Riccati equations are written for it."
        raise invalid("method", shown, "'riccati' or 'auto'", remedy)
    if not (plant.nu and plant.ny):
        shown = described(f"{plant.nu} controls and {plant.ny} measurements")
        remedy = "Check controls= and measurements= of the plant."
        raise invalid("plant", shown, "at least one of each", remedy)
    wanted = NormTarget.checked(gamma)
    whole = with_measurement_noise(with_control_penalty(plant, control_weight), measurement_noise)
    if order is not None:
        most = methods.checked_order(order)
        methods.refuse_with_order(method, gamma)
        orders = methods.StructuredOptions.checked(norm, seconds, 0, effort=effort)
        options: Any = {"backend": backend, "solver": solver, "tolerance": tolerance}
        try:
            limit = min(60.0, seconds / 2)
            full = output_feedback(whole, norm, effort=effort, time_limit=limit, **options)
        except SolverError:
            full = None  # nothing proven: few states may do where this found nothing
        return methods.design_fixed_order(plant, whole, most, full, norm, tolerance, orders)
    plant = whole
    settings = Settings(norm, method, backend, solver, tolerance, wanted, ENGINES[norm][method])
    # Steps on the size of the plant that a call may spend at least: a search over gamma of a
    # plant of 120 states takes 40, where `work` would leave one of 250 states seven.
    work = max(_WORK, 80.0 * step_cost(plant.nx))
    budget = Budget.with_certificate_reserve(effort * work, seconds)
    diagnosis = check_solvability(plant)
    diagnosis.require_stabilisable()
    # Delays are approximated in the parts; the whole is certified with them as they are.
    parts = decoupled_parts(plant) if split else (whole_plant(plant.without_delays()),)
    with progress_bar("Designing an output feedback"), enforce_deadline(budget):
        found = driver.design_by_parts(plant, parts, settings, diagnosis, budget)
    # Up to so many states of a plant its zeros on the axis are looked for, to explain a result.
    if plant.nx <= 30 and not (diagnosis.regular_feedthrough and found.status == "optimal"):
        diagnosis = diagnosis.with_zeros(plant)
    bound = found.bound if found.known else None
    details = {
        "diagnosis": diagnosis,
        "parts": tuple(part.states for part in parts),
        "part_norms": tuple(c.achieved if c else None for c in found.chosen),
        "claim": driver.combined_norm((c.claim for c in found.done), norm),
        "work": budget.spent,
        "estimated_infimum": None if found.known or not found.bound else found.bound,
    }
    return found.design(_message(found, diagnosis), bound, details)


def _message(found: driver.JoinedController, diagnosis: SolvabilityCheck) -> str:
    achieved, bound, floor = found.certificate.achieved, found.bound, found.lower_bound_note
    wanted, status = found.settings.wanted, found.status
    if bound > 0 and status == "suboptimal" and found.known:
        floor = f"that is at most {achieved / bound - 1:.2g} of it above the infimum: {floor}"
    known = floor if bound > 0 else "it is not known how far above the infimum that is"
    text = f"The {norm_in_words(found.settings.norm)} norm is {achieved:.6g}"
    text += {
        "optimal": f"; {floor}.",
        "suboptimal": f"; {known}.",
        "infimum_not_attained": " and could still be lowered by ever larger gains: the infimum is "
        "not attained. Price u (D12) and add noise to y (D21) to choose how much gain is worth it.",
        "time_limit": f"; {floor}." if bound > 0 else ".",
    }[status]
    if wanted.is_requested:
        text += f" It was asked for {wanted.in_words()}."
    remarks = [remark for c in found.done for remark in c.findings.remarks]
    text += driver.time_limit_note(found.budget)
    return " ".join([text, *diagnosis.findings, *dict.fromkeys(remarks)])
