"""Feedback whose gains follow numbers of the plant that are measured while it runs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, Literal

import control
from numpy.typing import ArrayLike

from robustpolish.errors import SolverError
from robustpolish.long_calls import Budget, same_bits, working
from robustpolish.models import UncertainSystem
from robustpolish.models.plant.blocks import named_system
from robustpolish.models.plant.sorting import Chosen
from robustpolish.synthesis.lmi.semidefinite import ProgramSolver
from robustpolish.synthesis.polytopes.family import LyapunovFamily
from robustpolish.synthesis.polytopes.feasible_part import refused_vertices
from robustpolish.synthesis.polytopes.inequalities import Question
from robustpolish.synthesis.polytopes.loops import output_loop, state_loop
from robustpolish.synthesis.polytopes.policy import POLICY
from robustpolish.synthesis.polytopes.proof import BallLoop, prove
from robustpolish.synthesis.polytopes.scheduled_design import ScheduledDesign
from robustpolish.synthesis.polytopes.scheduled_output import scheduled_controllers
from robustpolish.synthesis.polytopes.state_gain import GainProblem, candidates
from robustpolish.synthesis.polytopes.vertices import (
    Polytope,
    polytope,
    scaled_vertices,
    with_equal,
)
from robustpolish.synthesis.problem.preflight import noisy
from robustpolish.synthesis.problem.scaling import ScaledPlant
from robustpolish.validation import described, instance_of, invalid, known_keys, positive

Found = tuple[list[BallLoop], tuple[control.StateSpace, ...], float]


@same_bits
def scheduled_feedback(
    plant: UncertainSystem,
    *,
    controls: Chosen,
    measurements: Chosen | None = None,
    rates: Mapping[str, float] | None = None,
    control_weight: ArrayLike | None = None,
    measurement_noise: ArrayLike | None = None,
    backend: Literal["cvxpy", "picos"] = "cvxpy",
    solver: str | None = None,
    time_limit: float = 300.0,
) -> ScheduledDesign:
    r"""Design a controller that is scheduled by the numbers of a plant, for the smallest gain.

    The numbers of a linear parameter-varying plant change with time and are measured. There is a
    controller for each corner of their box, mixed as the plant is, and one Lyapunov matrix for all
    corners proves the loop however fast the numbers move.

    Parameters
    ----------
    plant : UncertainSystem
        With real numbers, each of which is measured. Its matrices depend on a line on each (or on
        a function of it, such as 1 / m).
    controls : int, str or sequence of str
        Which inputs are u, by name, or how many of the last ones.
    measurements : int, str or sequence of str, optional
        Which outputs are y. Without them u = F x, all states measured.
    rates : mapping of str to float, optional
        Largest rates of change of some numbers, in their units per s; what is not named may jump.
        The Lyapunov matrix is then affine in them, which lowers the bound. For output feedback
        rates enter the proof, not the search, and loops of eight and more states take minutes
        there. In continuous time only.
    control_weight : float or array_like, shape (nu,), optional
        Price on u in units of z per unit of u: ``control_weight * u`` joins z.
    measurement_noise : float or array_like, shape (ny,), optional
        Noise on y in units of y per unit of w, which joins w.
    backend, solver : str, optional
        Who solves the inequalities; "cvxpy" (with Clarabel) or "picos".
    time_limit : float, optional
        Seconds: a safety net for the search, whose work is limited otherwise; the status says if it
        was reached.

    Returns
    -------
    ScheduledDesign

    Raises
    ------
    InvalidInputError
        If the numbers reach the controls or the measurements directly; the message tells how to
        put a filter between. Output feedback in discrete time is refused too.
    InfeasibleError
        If a corner has an unstable mode that no control moves; it is named.
    SolverError
        If no controller was found and proven for the whole box.

    Notes
    -----
    The proof is started again from the loops at the corners: the bounded-real inequality with one
    P, or with P affine in slow numbers and a slack for all, is checked in ball arithmetic at
    every corner and, for each of them, at every corner of the rates. All loops in between are
    mixtures of these. For state feedback and numbers that may jump, scheduling does not lower the
    bound, only the gains: with one Lyapunov matrix, C1 constant and D11 zero, some fixed gain
    reaches as much. It does with bounded rates, and for output feedback.

    References
    ----------
    P. Apkarian, P. Gahinet, G. Becker, "Self-scheduled H-infinity control of linear
    parameter-varying systems: a design example", Automatica 31 (1995). P. Apkarian, R.J. Adams,
    "Advanced gain-scheduling techniques for uncertain systems", IEEE Trans. Control Systems
    Technology 6 (1998), for bounded rates.

    Examples
    --------
    >>> import robustpolish as rp
    >>> k = rp.uncertain_real("k", 5.0, range=(1.0, 9.0))
    >>> plant = rp.uncertain_system([[0, k], [-1, 0.5]], [[1, 0], [0, 1]], [[1, 0]], 0)
    >>> jumps = rp.scheduled_feedback(plant, controls=1, control_weight=1.0)
    >>> slow = rp.scheduled_feedback(plant, controls=1, control_weight=1.0, rates={"k": 0.1})
    >>> bool(slow.bound < 0.85 * jumps.bound)
    True
    """
    remedy = "Make it with uncertain_real and uncertain_system."
    instance_of("plant", plant, UncertainSystem, "an UncertainSystem", remedy)
    positive("time_limit", time_limit)
    whole = _checked(polytope(plant, controls, measurements, control_weight), measurements)
    if measurements is not None:
        whole = replace(whole, plants=tuple(noisy(p, measurement_noise) for p in whole.plants))
    elif measurement_noise is not None:
        remedy = "Name measurements=, or leave it out."
        raise invalid("measurement_noise", measurement_noise, "none for state feedback", remedy)
    limits = _rates(whole, rates)
    refused_vertices(whole)
    budget = Budget(POLICY.work, time_limit)
    programs = ProgramSolver(backend, solver, budget, POLICY.tolerance)
    with working("Designing for all corners"):
        scaled, vertices = scaled_vertices(whole)
        moving = [whole.speed(name) * rate * scaled.time for name, rate in limits.items()]
        family = LyapunovFamily.affine(whole.positions, moving)
        question = Question(family, "hinf", vertices[0].discrete)
        problem = GainProblem(vertices, question, scheduled=True)
        ways = (
            _gains(problem, scaled, programs)
            if measurements is None
            else _dynamic(problem, scaled, programs)
        )
        found = _proven(ways, question, programs)
    if found is None:
        raise SolverError(_failure(budget.late))
    controllers, bound = found
    jump = all(map(math.isinf, limits.values()))
    return ScheduledDesign(
        controllers=controllers,
        points=whole.points,
        bound=scaled.norm(bound),
        rates=limits,
        status="time_limit" if budget.late else "proven",
        message="The bound is proven for numbers that move within their ranges"
        + (", however fast." if jump else " and rates.")
        + (" The time limit was reached: a better one may exist." if budget.late else ""),
        vertices=whole,
    )


def _proven(
    ways: Iterator[Found], question: Question, solver: ProgramSolver
) -> tuple[tuple[control.StateSpace, ...], float] | None:
    """Return the first controllers that are proven, with their bound."""
    for loops, controllers, claimed in ways:
        proof = prove(loops, question, solver, claimed)
        if proof is not None:
            return controllers, proof.bound
    return None


def _gains(problem: GainProblem, scaled: ScaledPlant, solver: ProgramSolver) -> Iterator[Found]:
    plant = scaled.original
    for found in candidates(problem, solver):
        loops = [state_loop(p, F) for p, F in zip(problem.plants, found.gains, strict=True)]
        gains = (plant.static_controller(scaled.state_gain(F)) for F in found.gains)
        yield loops, tuple(gains), found.claimed


def _dynamic(problem: GainProblem, scaled: ScaledPlant, solver: ProgramSolver) -> Iterator[Found]:
    for made, claimed in scheduled_controllers(problem.plants, solver):
        loops = [output_loop(p, K) for p, K in zip(problem.plants, made, strict=True)]
        yield loops, tuple(_named(scaled, K) for K in made), claimed


def _named(scaled: ScaledPlant, K: Any) -> control.StateSpace:
    """Return a controller in the plant's units; the factors are powers of two and round nothing."""
    plant = scaled.original
    own = scaled.controller(control.StateSpace(*K, remove_useless_states=False))
    states = [f"controller_{i + 1}" for i in range(own.nstates)]
    names = (plant.measurement_names, plant.control_names, states)
    return named_system((own.A, own.B, own.C, own.D), plant.dt, *names)


def _checked(whole: Polytope, measurements: Chosen | None) -> Polytope:
    """Return a polytope whose mixtures the controllers follow, or say what to do."""
    if not whole.all_mixtures:
        raise invalid(
            "plant",
            described("a plant that is not on a line in each number, the others held"),
            "one whose corners mix to all plants of the box",
            'Take functions of its numbers for numbers of their own, such as "k_squared".',
        )
    if any(element.group for element in whole.numbers):
        remedy = "Make each with uncertain_real: each is measured on its own."
        raise invalid("plant", described("an ellipsoid"), "numbers of their own", remedy)
    if measurements is None:
        return with_equal(whole.with_full_state(), ("B2", "D12"))
    plant = whole.plants[0]
    if plant.is_discrete:
        remedy = "Design in continuous time, or with state feedback."
        raise invalid("plant", described("discrete time"), "continuous time", remedy)
    if any(p.D22.any() for p in whole.plants):
        remedy = "Put a lag before the controls or behind the measurements."
        raise invalid("plant", described("a D22 that is not zero"), "none from u to y", remedy)
    return with_equal(whole, ("B2", "C2", "D12", "D21"))


def _rates(whole: Polytope, given: Mapping[str, float] | None) -> dict[str, float]:
    names = [element.name for element in whole.numbers]
    given = {} if given is None else given
    instance_of("rates", given, Mapping, "a mapping of names to rates", 'Write {"k": 0.5}.')
    known_keys(("rates",), given, names)
    if given and whole.plants[0].is_discrete:
        remedy = "Leave rates out: the bound then holds for jumps."
        raise invalid("rates", given, "no rates in discrete time", remedy)
    checked = {name: positive(("rates", name), rate, zero=True) for name, rate in given.items()}
    return {name: checked.get(name, math.inf) for name in names}


def _failure(late: bool) -> str:
    text = "No controller was found and proven for the whole box. "
    if late:
        return text + (
            "The time limit was reached. Raise time_limit, or leave numbers out of rates= (the "
            "bound then holds for jumps of them, which is proven much faster)."
        )
    return text + (
        "Make the ranges smaller, tell rates= of numbers that move slowly, or give the problem a "
        "price (control_weight) and a noise (measurement_noise)."
    )
