"""Controllers of tunable blocks: PID, filters, gains and small state spaces, wired as they are."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray

from robustpolish.base.budget import (
    WORK,
    Budget,
    enforce_deadline,
    progress_bar,
    single_threaded_blas,
)
from robustpolish.base.checks import described, instance_of, invalid, one_of, positive, whole_number
from robustpolish.errors import InfeasibleError, SolverError
from robustpolish.linear.norms.h2 import h2_norm
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.certificate import Norm, certify
from robustpolish.synthesis.design import Design
from robustpolish.synthesis.driver import solve_each_once
from robustpolish.synthesis.problem.matrices import controller_from_matrix
from robustpolish.synthesis.problem.pole_regions import Place
from robustpolish.synthesis.problem.preflight import (
    PlantPart,
    Status,
    decoupled_parts,
    refuse_unstable,
    whole_plant,
    with_control_penalty,
    with_measurement_noise,
)
from robustpolish.synthesis.structured import search, structures
from robustpolish.synthesis.structured.block_parts import TunableBlock, TunedBlocks
from robustpolish.synthesis.structured.block_structure import (
    BlockStructure,
    Placement,
    place_blocks,
)
from robustpolish.synthesis.structured.starts import padded

# The driver of all designs of prescribed structure: search part by part, join, certify.

_BOUND_THE_GAIN = (
    "Bound the gain (gain_bound), or price u and add noise to y (control_weight, "
    "measurement_noise)."
)


@dataclass(frozen=True, eq=False)
class StructuredOptions:
    """What every structured method is told about the search, checked.

    Attributes
    ----------
    budget : Budget
    seed : int
    target : float
        A norm that is good enough.
    """

    budget: Budget
    seed: int
    target: float = 0.0

    @classmethod
    def checked(
        cls, norm: Norm, time_limit: float, seed: int, target: float = 0.0, effort: float = 1.0
    ) -> StructuredOptions:
        """Check the arguments that all methods share, and start the clock of the safety net."""
        one_of("norm", norm, ("hinf", "h2"))
        seconds = positive("time_limit", time_limit, "s")
        budget = Budget.with_certificate_reserve(effort * WORK, seconds)
        return cls(budget, seed, positive("target", target, zero=True))


def checked_bound(gain_bound: float | None) -> float | None:
    """Return a bound on the gain, which has to be positive if there is one."""
    return None if gain_bound is None else positive("gain_bound", gain_bound)


def design_structured(
    plant: GeneralizedPlant,
    whole: GeneralizedPlant,
    parts: Sequence[PlantPart],
    structure: search.ControllerStructure,
    options: StructuredOptions,
) -> Design:
    """Design a controller of a structure, part by part, and certify it for the whole plant.

    Parameters
    ----------
    plant : GeneralizedPlant
        As it was given.
    whole : GeneralizedPlant
        With prices and noise: what the design is certified for.
    parts : sequence of PlantPart
        The parts of `whole` that the structure does not join.
    structure : ControllerStructure
    options : StructuredOptions

    Raises
    ------
    InfeasibleError
        If a part without anything to choose is unstable.
    SolverError
        If nothing was found, or its certificate fails.
    """
    problems = [structure.problem(part) for part in parts]
    for part, problem in zip(parts, problems, strict=True):
        if problem is None:
            refuse_unstable(part.plant)
    budget, norm = options.budget, structure.norm
    with progress_bar("Searching a controller"), enforce_deadline(budget):
        done = solve_each_once(
            [(p.key, p.objective.work, p) for p in problems if p is not None],
            budget,
            lambda problem, own: search.design_part(problem, own, options.seed, options.target),
        )
    designs = [None if problem is None else done[problem.key] for problem in problems]
    late = budget.late
    controller, details = structure.join(whole, parts, designs)
    found = [design for design in designs if design is not None]
    with enforce_deadline(budget):
        certificate = certify(whole, controller, norm)
    if not certificate.valid:
        raise SolverError(
            "The controller that was found could not be certified: "
            f"{'; '.join(certificate.reasons)}. {_BOUND_THE_GAIN}"
        )
    status, message = _verdict(found, certificate.achieved, late)
    measured: Any = certificate.achieved
    if plant is not whole:  # without the price and noise that were asked for
        loop = plant.closed_loop(controller)
        measured = hinf_norm(loop) if norm == "hinf" else h2_norm(loop)
    numbers = {
        "plain_norm": float(measured),
        "descents": sum(len(d.history) for d in found),
        "part_norms": tuple(d.norm for d in found),
    }
    return Design(
        plant=whole,
        controller=controller,
        closed_loop=whole.closed_loop(controller),
        norm=norm,
        status=status,
        message=message,
        certificate=certificate,
        method=structure.method,
        backend="scipy",
        elapsed=budget.elapsed,
        history=tuple({"part": i, **entry} for i, d in enumerate(found) for entry in d.history),
        details=MappingProxyType({**numbers, **details}),
        lower_bound=0.0 if certificate.achieved == 0 else None,
    )


def _verdict(
    designs: Sequence[search.PartDesign], achieved: float, late: bool
) -> tuple[Status, str]:
    if achieved == 0:
        return "optimal", "The disturbances do not reach the performance outputs at all."
    falls = ""
    if any(d.at_ceiling for d in designs):
        falls = (
            "The norm keeps falling as the gain grows; the search was stopped at a large gain. "
            + _BOUND_THE_GAIN
        )
    if late:
        return "time_limit", (
            "The best certified controller when time ran out. Raise time_limit, or pass this "
            f"controller as initial. {falls}"
        ).rstrip()
    if falls:
        return "infimum_not_attained", falls
    if not designs:
        return "suboptimal", "Nothing to control: the loop is the open loop."
    worst = min(designs, key=lambda d: d.agreeing / len(d.history))
    spent = " The work of one search was spent." if any(d.reason == "work" for d in designs) else ""
    return "suboptimal", (
        f"A local minimum; {worst.agreeing} of {len(worst.history)} descents ended there.{spent} "
        "Another seed may find a lower one, or this controller passed as initial."
    )


# Dynamic output feedback with few states: what `output_feedback(order=)` does.


def checked_order(order: Any) -> int:
    """Return a number of states, which has to be a whole one."""
    return whole_number("order", order, 0, remedy="0 is static feedback.")


def refuse_with_order(method: str, gamma: Any) -> None:
    """Refuse arguments that say nothing about a controller of few states."""
    if method != "auto":
        raise invalid(
            "method",
            described(f"{method!r} together with order="),
            "'auto'",
            "Riccati equations and matrix inequalities know full order only; leave method out.",
        )
    if gamma is not None:
        raise invalid(
            "gamma",
            described("gamma= together with order="),
            "one of the two",
            "rp.static_output_feedback(plant, order=k, target=gamma) stops below a norm.",
        )


def design_fixed_order(
    plant: GeneralizedPlant,
    whole: GeneralizedPlant,
    order: int,
    full: Design | None,
    norm: Norm,
    tolerance: float,
    options: StructuredOptions,
) -> Design:
    """Design a controller of at most `order` states.

    Parameters
    ----------
    plant : GeneralizedPlant
        As it was given.
    whole : GeneralizedPlant
        With prices and noise.
    order : int
    full : Design or None
        The design without a limit of its order, if there is one: where to start, and how low the
        norm can be.
    norm : {"hinf", "h2"}
    tolerance : float
        A norm within it of the lower bound is good enough.
    options : StructuredOptions

    Returns
    -------
    Design
    """
    short = full
    if full is not None and full.controller.nstates > order:
        try:
            short = full.reduce(order=order)
        except (InfeasibleError, SolverError):
            short = None
    bound = 0.0 if full is None else full.lower_bound or 0.0
    enough = bound * (1 + tolerance)
    if short is None or short.certificate.achieved > enough:
        start = None
        if short is not None:
            parts = controller_from_matrix(padded(short.controller, order), order)
            start = control.StateSpace(*parts, plant.dt, remove_useless_states=False)
        decoupled = decoupled_parts(whole)
        if order and len(decoupled) > 1:
            # The limit counts the states of all parts.
            decoupled = (whole_plant(whole.without_delays()),)
        structure = structures.StaticStructure(norm, order, initial=start)
        options = replace(options, target=enough)
        try:
            found = design_structured(plant, whole, decoupled, structure, options)
        except SolverError:
            if short is None:
                raise
            found = short
        if short is None or found.certificate.achieved <= short.certificate.achieved:
            short = found
    return _with_gap(short, full, order, bound, enough)


def _with_gap(
    design: Design, full: Design | None, order: int, bound: float, enough: float
) -> Design:
    """Say how far a design is from what any number of states reaches."""
    if full is None:
        return design
    achieved, states = design.certificate.achieved, design.controller.nstates
    if full is design:
        more = f"It has {states} of the {order} states asked for at most."
        return replace(design, message=f"{design.message} {more}")
    if bound > 0:
        above = f"{achieved / bound:.4g} times {bound:.6g}, below which no controller comes"
    elif full.certificate.achieved > 0:
        above = f"{achieved / full.certificate.achieved:.4g} times that of full order"
    else:
        above = "where full order reaches 0"
    count = f"{states} state{'' if states == 1 else 's'}"
    good = 0 < achieved <= enough and design.status != "time_limit"
    return replace(
        design,
        status="optimal" if good else design.status,
        message=f"With {count} the norm is {achieved:.6g}, {above}. {design.message}",
        lower_bound=bound if bound > 0 else design.lower_bound,
    )


# State feedback of an observer's estimate, designed for the norm of the whole loop.


@single_threaded_blas
def observer_feedback(
    plant: GeneralizedPlant,
    norm: Norm = "hinf",
    *,
    time_limit: float = search.TIME_LIMIT,
    seed: int = 0,
    gain_bound: float | None = None,
    control_weight: ArrayLike | None = None,
    measurement_noise: ArrayLike | None = None,
    target: float = 0.0,
) -> Design:
    r"""Design u = F xhat with a Luenberger observer for the norm of the whole loop.

    The observer of the thesis's (10.63),

    .. math:: \dot{\hat x} = A \hat x + B_2 u + L (y - C_2 \hat x - D_{22} u),

    and the feedback F are found together, which (10.74) leaves open because it is
    bilinear in F and L. The way around: a strictly proper controller of the plant's order is an
    observer in suitable coordinates, so central H-infinity controllers from two Riccati equations
    (and LQG designs) are rewritten as F and L, and the true norm is then lowered over F and L
    by descents.

    Parameters
    ----------
    plant : GeneralizedPlant
        Continuous or discrete, with any D; in discrete time the observer predicts.
    norm : {"hinf", "h2"}
        The norm from w to z; "h2" gives the LQG controller.
    time_limit : float
        Safety net in s for search and certificate; the work of the search is limited otherwise. The
        status says if it was reached, an error if no certificate was complete in time.
    seed : int
        Of the random starts.
    gain_bound : float, optional
        Largest singular value of the controller at any frequency, in the plant's units; the
        controller is then held stable by itself.
    control_weight : float or array_like, shape (nu,), optional
        Price on u: ``control_weight`` times u joins z. In units of z per unit of u.
    measurement_noise : float or array_like, shape (ny,), optional
        Noise on y as additional disturbances, in units of y per unit of w.
    target : float
        Stop as soon as the norm is below, in the plant's units.

    Returns
    -------
    Design
        ``details`` holds ``state_feedback`` (F, shape (nu, nx)), ``observer_gain`` (L, shape
        (nx, ny)), ``feedback_poles`` (of A + B2 F) and ``observer_poles`` (of A - L C2), in
        rad/s, and ``plain_norm``, without price and noise. The status is as in
        :func:`static_output_feedback`.

    Raises
    ------
    InvalidInputError
        If an argument does not fit the plant.
    InfeasibleError
        If an unstable mode cannot be moved; it is named.
    SolverError
        If no certified controller was found.

    References
    ----------
    M.L. Postma, Polishing robot: vibrations due to impact, (10.63) to (10.74). Alazard and
    Apkarian, "Exact observer-based structures for arbitrary compensators", IJRNC 9 (1999).

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.GeneralizedPlant.from_matrices(
    ...     [[1.0]], [[1.0, 0.0]], [[1.0]], [[1.0], [0.0]], [[1.0]],
    ...     D12=[[0.0], [1.0]], D21=[[0.0, 1.0]],
    ... )
    >>> design = rp.observer_feedback(plant, "h2")
    >>> design.details["observer_gain"].round(3)  # 1 + sqrt(2), the Kalman gain
    array([[2.414]])
    """
    options = StructuredOptions.checked(norm, time_limit, seed, target)
    whole = with_measurement_noise(with_control_penalty(plant, control_weight), measurement_noise)
    structure = structures.ObserverStructure(norm, checked_bound(gain_bound))
    return design_structured(plant, whole, decoupled_parts(whole), structure, options)


# Springs and dampers instead of a controller: what a force actuation means physically.


@single_threaded_blas
def passive_feedback(
    plant: GeneralizedPlant,
    springs: Sequence[Place] = (),
    dampers: Sequence[Place] = (),
    norm: Norm = "hinf",
    *,
    stiffness_bound: float | Mapping[Place, float] | None = None,
    damping_bound: float | Mapping[Place, float] | None = None,
    control_weight: ArrayLike | None = None,
    time_limit: float = search.TIME_LIMIT,
    seed: int = 0,
) -> Design:
    r"""Choose springs and dampers at given places for the smallest norm from w to z.

    The thesis reads its second solution, forces as controls, as springs and dampers
    added to the machine. Here that is meant literally: u is the force of elements with
    non-negative coefficients, k (q_b - q_a) and d (q_b' - q_a') on a and the opposite on b. Such
    elements cannot add energy, so a stable machine stays stable.

    Parameters
    ----------
    plant : GeneralizedPlant
        Continuous, with forces (or torques) as controls. A displacement is a state whose
        derivative is another state, its velocity; its force is the control that drives that
        velocity alone.
    springs, dampers : sequence of (str, str)
        Places, such as ``("x", "ground")`` or ``("x_m", "x")``: names of displacements.
    norm : {"hinf", "h2"}
        The norm from w to z.
    stiffness_bound, damping_bound : float or mapping, optional
        Largest coefficients, one for all or one for each place, in the plant's units. Without
        a bound the norm may fall for ever with a growing coefficient.
    control_weight : float or array_like, shape (nu,), optional
        Price on the forces: ``control_weight`` times u joins z.
    time_limit : float
        Safety net in s for the search, whose work is limited otherwise; the status says if it
        was reached.
    seed : int
        Of the random starts.

    Returns
    -------
    Design
        With the state feedback that the elements amount to (its plant measures the state).
        ``details["elements"]`` lists each :class:`PassiveElement` with value and unit.

    Raises
    ------
    InvalidInputError
        If a place is unknown, has no velocity or no force, or the plant is discrete.
    InfeasibleError
        If the machine has an unstable mode that no element can reach.
    SolverError
        If no choice of elements makes the machine stable.

    References
    ----------
    M.L. Postma, Polishing robot: vibrations due to impact, (10.41) and section 11.2.

    Examples
    --------
    >>> import robustpolish as rp
    >>> mass = rp.GeneralizedPlant.from_matrices(
    ...     [[0.0, 1.0], [-100.0, 0.1]], [[0.0], [1.0]], [[0.0], [1.0]], [[1.0, 0.0]],
    ...     [[1.0, 0.0]], states=["x", "dx"],
    ... )
    >>> design = rp.passive_feedback(mass, dampers=[("x", "ground")], damping_bound=30.0)
    >>> for element in design.details["elements"]:
    ...     print(element)
    damper between x and ground: ... N s/m
    """
    options = StructuredOptions.checked(norm, time_limit, seed)
    if plant.is_discrete:
        raise invalid(
            "plant",
            described(f"a discrete plant, dt = {plant.dt}"),
            "a continuous plant",
            "Springs and dampers act without a sampler: pass the continuous model.",
        )
    whole = with_control_penalty(plant, control_weight).with_full_state()
    mechanics = structures.Mechanics.of(plant)
    wanted = [("spring", _place("springs", p, mechanics)) for p in springs]
    wanted += [("damper", _place("dampers", p, mechanics)) for p in dampers]
    if not wanted or len(set(wanted)) != len(wanted):
        raise invalid("springs", wanted, "different places, at least one", "Name them once each.")
    limits = [
        _limit("stiffness_bound", stiffness_bound, place)
        if kind == "spring"
        else _limit("damping_bound", damping_bound, place)
        for kind, place in wanted
    ]
    structure = structures.PassiveStructure(norm, mechanics, wanted, np.array(limits))
    parts = decoupled_parts(whole, structure.joined)
    return design_structured(whole, whole, parts, structure, options)


def _place(argument: str, place: Place, mechanics: structures.Mechanics) -> Place:
    known = [n for n in mechanics.plant.states if n in mechanics.force]
    pair: list[str] = [place] if isinstance(place, str) else list(place)
    if len(set(pair)) != 2 or len(pair) != 2 or not {*pair} <= {*known, structures.GROUND}:
        raise invalid(
            argument,
            place,
            f"two different places out of {', '.join(known) or 'none'} and {structures.GROUND}",
            "A place is a displacement state with a force on it: choose actuation='force'.",
        )
    return (pair[0], pair[1])


def _limit(argument: str, bound: float | Mapping[Place, float] | None, place: Place) -> float:
    if isinstance(bound, Mapping):
        bound = bound.get(place, bound.get((place[1], place[0])))
    return np.inf if bound is None else positive(argument, bound)


# Static and fixed-order output feedback on the true norm, with a prescribed sparsity.


@single_threaded_blas
def static_output_feedback(
    plant: GeneralizedPlant,
    norm: Norm = "hinf",
    structure: ArrayLike | None = None,
    order: int = 0,
    *,
    time_limit: float = search.TIME_LIMIT,
    initial: control.StateSpace | ArrayLike | None = None,
    seed: int = 0,
    gain_bound: float | None = None,
    control_weight: ArrayLike | None = None,
    measurement_noise: ArrayLike | None = None,
    target: float = 0.0,
) -> Design:
    r"""Design u = F y, or a dynamic controller of a given order, for the true norm.

    The problem is not convex: linear matrix inequalities only find a start. From several
    starts the norm itself is then lowered, first by BFGS, then by a bundle method that
    sees all peaks of the singular values at once, until the descents agree or the work is
    done. What is returned is a local minimum, certified; no method at hand can tell whether it
    is global.

    Parameters
    ----------
    plant : GeneralizedPlant
        Continuous or discrete, with any D.
    norm : {"hinf", "h2"}
        The norm from w to z.
    structure : array_like of bool, shape (nu, ny), optional
        True where F may differ from zero. Without it F is free within each decoupled part of
        the plant and zero between them; pass ``np.ones((nu, ny))`` to join the parts.
        For ``order > 0`` the shape is (order + nu, order + ny), for [[Ak, Bk], [Ck, Dk]].
    order : int
        States of the controller for each decoupled part; 0 is static. Without a `structure`
        :func:`robustpolish.output_feedback` with ``order=`` is the way: it also starts from what
        full order reaches and says how far from it the result is.
    time_limit : float
        Safety net in s for search and certificate; the work of the search is limited otherwise. The
        status says if it was reached, an error if no certificate was complete in time.
    initial : array_like or control.StateSpace, optional
        A controller to start from, stabilising or not: F, or a system of the given order.
    seed : int
        Of the random starts; the same seed gives the same result unless time runs out.
    gain_bound : float, optional
        Largest singular value allowed for F, in the plant's units. A dynamic controller is
        held stable and bounded at all frequencies.
    control_weight : float or array_like, shape (nu,), optional
        Price on u: ``control_weight`` times u joins z. In units of z per unit of u.
    measurement_noise : float or array_like, shape (ny,), optional
        Noise on y as additional disturbances, in units of y per unit of w. A price on u
        bounds u, not the gain; noise bounds the gain.
    target : float
        Stop as soon as the norm is below, in the plant's units.

    Returns
    -------
    Design
        With status "suboptimal" (a local minimum, as the message says),
        "infimum_not_attained" (the norm keeps falling as the gain grows) or "time_limit".
        Its plant includes price and noise; ``details["plain_norm"]`` is the norm of the loop
        with the plant as it was given.

    Raises
    ------
    InvalidInputError
        If an argument does not fit the plant.
    InfeasibleError
        If an unstable mode cannot be moved by any gain of the structure; it is named.
    SolverError
        If no stabilising gain was found, which proves nothing.

    References
    ----------
    Apkarian and Noll, "Nonsmooth H-infinity synthesis", IEEE TAC 51 (2006). Burke, Henrion,
    Lewis and Overton, "HIFOO", ROCOND 2006. El Ghaoui, Oustry and AitRami, IEEE TAC 42 (1997).

    Examples
    --------
    The more gain, the lower the norm, so that the bound decides:

    >>> import robustpolish as rp
    >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    >>> design = rp.static_output_feedback(plant, gain_bound=3.0)
    >>> design.gain.round(3), round(design.certificate.achieved, 3)
    (array([[-3.]]), 0.5)
    """
    options = StructuredOptions.checked(norm, time_limit, seed, target)
    order = checked_order(order)
    mask = None if structure is None else checked_structure(structure, order, plant.nu, plant.ny)
    start = _initial(initial, order, plant)
    whole = with_measurement_noise(with_control_penalty(plant, control_weight), measurement_noise)

    joined = order > 0 and (mask is not None or start is not None)
    parts = (whole_plant(whole),) if joined else decoupled_parts(whole, mask)
    asked = structures.StaticStructure(norm, order, mask, checked_bound(gain_bound), start)
    return design_structured(plant, whole, parts, asked, options)


def checked_structure(structure: ArrayLike, order: int, nu: int, ny: int) -> NDArray[np.bool_]:
    """Return which entries of [[Ak, Bk], [Ck, Dk]] are free, refused in a wrong shape."""
    shape = (order + nu, order + ny)
    mask = np.asarray(structure)
    known = mask.dtype == bool or (mask.dtype.kind in "iuf" and np.isin(mask, (0, 1)).all())
    if mask.shape != shape or not known:
        sizes = f"{nu} controls by {ny} measurements"
        remedy = "Mark the entries of u = K y that may differ from zero."
        if order:
            sizes += f", after {order} rows and columns for the controller's states"
            remedy = "Mark the entries of [[Ak, Bk], [Ck, Dk]] that may differ from zero."
        shown = described(f"shape {mask.shape}, entries {mask.dtype}")
        raise invalid("structure", shown, f"booleans of shape {shape}: {sizes}", remedy)
    return mask.astype(bool)


def _initial(initial: Any, order: int, plant: GeneralizedPlant) -> control.StateSpace | None:
    if initial is None:
        return None
    if not isinstance(initial, control.StateSpace):
        initial = control.StateSpace([], [], [], np.asarray(initial, dtype=float), plant.dt)
    text = "{} outputs, {} inputs and {} states".format
    wanted = text(plant.nu, plant.ny, order)
    given = text(initial.noutputs, initial.ninputs, initial.nstates)
    if given != wanted:
        raise invalid("initial", described(given), wanted, "Match the plant and order.")
    return initial


@single_threaded_blas
def structured_output_feedback(
    plant: GeneralizedPlant,
    blocks: TunableBlock | Sequence[TunableBlock],
    norm: Norm = "hinf",
    *,
    initial: Design | Mapping[str, float] | None = None,
    time_limit: float = search.TIME_LIMIT,
    seed: int = 0,
    gain_bound: float | None = None,
    control_weight: ArrayLike | None = None,
    measurement_noise: ArrayLike | None = None,
    target: float = 0.0,
) -> Design:
    r"""Tune a controller that is made of blocks for the true norm.

    Each block goes from measurements to controls of the plant, by name; what several blocks send
    to one control adds up, so that a list of them is a decentralised controller. The numbers of all
    blocks are searched together: from several starts the loop is made stable, then its norm is
    lowered along exact gradients. What is returned is a local minimum, certified.

    Parameters
    ----------
    plant : GeneralizedPlant
        Continuous, with disturbances w and performance outputs z; weights belong to it, see
        :func:`robustpolish.mixed_sensitivity`. :func:`robustpolish.tunable.static_gain` and
        :func:`robustpolish.tunable.fixed_order` take discrete plants too.
    blocks : TunableBlock or sequence of them
        Made by :func:`robustpolish.tunable.pid`, :func:`robustpolish.tunable.lead_lag`,
        :func:`robustpolish.tunable.notch`, :func:`robustpolish.tunable.low_pass`,
        :func:`robustpolish.tunable.static_gain` and :func:`robustpolish.tunable.fixed_order`;
        ``*`` puts them in
        series, ``rp.tunable.pid("x", control="F") * rp.tunable.notch()``, also
        with a number or a given filter.
    norm : {"hinf", "h2"}
        The norm from w to z.
    initial : Design or mapping of str to float, optional
        Numbers to start from by name, as ``details["blocks"].numbers`` of a design lists them, or
        such a design. They may be unstable. Others start where their block says.
    time_limit : float
        Safety net in s for search and certificate; the work of the search is limited otherwise. The
        status says if it was reached, an error if no certificate was complete in time.
    seed : int
        Of the random starts; the same seed gives the same result unless time runs out.
    gain_bound : float, optional
        Largest singular value of the controller at all frequencies, in the plant's units; not
        with integrators, whose gain has no bound.
    control_weight : float or array_like, shape (nu,), optional
        Price on u: ``control_weight`` times u joins z. In units of z per unit of u.
    measurement_noise : float or array_like, shape (ny,), optional
        Noise on y as additional disturbances, in units of y per unit of w.
    target : float
        Stop as soon as the norm is below, in the plant's units.

    Returns
    -------
    Design
        ``details["blocks"]`` holds the tuned numbers with their units:
        ``design.details["blocks"]["pid_x"]["Kp"]``. The states of its controller are named
        after the blocks. ``details["idle_integrals"]`` names integral gains that the norm drove
        to next to nothing.

    Raises
    ------
    InvalidInputError
        If a block does not fit the plant, its numbers contradict each other, nothing is free, or
        the plant has no w or no z.
    InfeasibleError
        If no numbers can do: a mode of the plant that the blocks do not reach, an integrator that
        stays at 0, or an H2 norm that the blocks' feedthrough makes infinite.
    SolverError
        If no stabilising numbers were found, which proves nothing.

    Notes
    -----
    Signs are those of the whole package, u = K y. ``rp.tunable.pid("x", sign=-1)`` writes the usual
    controller with negative feedback; gains are free in sign unless limits say otherwise.

    References
    ----------
    Apkarian and Noll, "Nonsmooth H-infinity synthesis", IEEE TAC 51 (2006), which ``hinfstruct``
    and ``systune`` are made of.

    Examples
    --------
    A PI controller for a lag, so that S keeps below 1 / W1 and K S below 20:

    >>> import control
    >>> import robustpolish as rp
    >>> G = control.tf([1.0], [1.0, 1.0], inputs="F", outputs="x")
    >>> plant = rp.mixed_sensitivity(G, performance=rp.weight(1e3, 0.5, 0.5), effort=0.05)
    >>> pi = rp.tunable.pid("x", kind="PI", sign=-1)
    >>> design = rp.structured_output_feedback(plant, [pi], target=0.6)
    >>> design.certificate.valid, design.certificate.achieved < 0.6
    (True, True)
    >>> print(design.details["blocks"]["pid_x"])
    pid_x: (Kp + Ki/s), with Kp = ..., Ki = ...
    """
    remedy = "Make one with rp.GeneralizedPlant or rp.mixed_sensitivity."
    instance_of("plant", plant, GeneralizedPlant, "a GeneralizedPlant", remedy)
    options = StructuredOptions.checked(norm, time_limit, seed, target)
    bound = checked_bound(gain_bound)
    whole = with_measurement_noise(with_control_penalty(plant, control_weight), measurement_noise)
    if not (whole.nw and whole.nz):
        raise invalid(
            "plant",
            described(f"{whole.nw} disturbances w and {whole.nz} performance outputs z"),
            "at least one of each, between which the norm is taken",
            "Name them with GeneralizedPlant.from_loop or rp.mixed_sensitivity.",
        )
    placement = place_blocks(blocks, whole)
    asked = BlockStructure(norm, placement, bound, _initial_structure(initial, placement))
    if bound is not None and any("integral" in stage.states for _, _, stage in placement.places):
        raise invalid(
            "gain_bound",
            described(f"{bound:g} for blocks with integrators"),
            "no bound where the gain has none",
            "Weigh u instead (control_weight, or effort= of mixed_sensitivity).",
        )
    design = design_structured(plant, whole, (whole_plant(whole),), asked, options)
    idle = ", ".join(design.details["idle_integrals"])
    if not idle:
        return design
    note = (
        f"{idle} went as near to 0 as the search goes: this norm asks for no integral action. "
        "Weigh slow errors (performance= of mixed_sensitivity), or leave the integrator out."
    )
    return replace(design, message=f"{design.message} {note}")


def _initial_structure(given: Any, placement: Placement) -> Mapping[str, float]:
    """Return numbers to start from, which have to be known and within their limits."""
    if given is None:
        return {}
    if isinstance(given, Design):
        tuned = given.details.get("blocks")
        given = tuned.numbers if isinstance(tuned, TunedBlocks) else None
    if not isinstance(given, Mapping):
        want = "numbers by name, or a design of tuned blocks"
        raise invalid("initial", given, want, "Pass {'pid_x.Kp': 2.0}.")
    known = {number.key: number for number in placement.numbers}
    for key, value in given.items():
        if key not in known:
            listed = ", ".join(known)
            raise invalid("initial", key, f"names among {listed}", "Leave out what is held.")
        limits = known[key].tunable
        real = isinstance(value, int | float | np.integer | np.floating)
        good = real and math.isfinite(value)
        if not good or not limits.low <= value <= limits.high:
            want = f"a number between {limits.low:g} and {limits.high:g}"
            raise invalid(("initial", key), value, want, "Start inside the limits.")
    return {key: float(value) for key, value in given.items()}
