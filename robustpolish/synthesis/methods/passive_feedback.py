"""Springs and dampers instead of a controller: what a force actuation means physically."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from robustpolish.long_calls import same_bits
from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.design.design import Design
from robustpolish.synthesis.methods.structured_design import Orders, design_structured
from robustpolish.synthesis.problem.decoupling import decoupled_parts
from robustpolish.synthesis.problem.passive_element import Place
from robustpolish.synthesis.problem.preflight import priced
from robustpolish.synthesis.structured_search.passive_structure import (
    GROUND,
    Mechanics,
    PassiveStructure,
)
from robustpolish.synthesis.structured_search.policy import TIME_LIMIT
from robustpolish.synthesis.structured_search.structure import Norm
from robustpolish.validation import described, invalid, positive


@same_bits
def passive_feedback(
    plant: GeneralizedPlant,
    springs: Sequence[Place] = (),
    dampers: Sequence[Place] = (),
    norm: Norm = "hinf",
    *,
    stiffness_bound: float | Mapping[Place, float] | None = None,
    damping_bound: float | Mapping[Place, float] | None = None,
    control_weight: ArrayLike | None = None,
    time_limit: float = TIME_LIMIT,
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
    orders = Orders.checked(norm, time_limit, seed)
    if plant.is_discrete:
        raise invalid(
            "plant",
            described(f"a discrete plant, dt = {plant.dt}"),
            "a continuous plant",
            "Springs and dampers act without a sampler: pass the continuous model.",
        )
    whole = priced(plant, control_weight).with_full_state()
    mechanics = Mechanics.of(plant)
    wanted = [("spring", _place("springs", p, mechanics)) for p in springs]
    wanted += [("damper", _place("dampers", p, mechanics)) for p in dampers]
    if not wanted or len(set(wanted)) != len(wanted):
        raise invalid("springs", wanted, "different places, at least one", "Name them once each.")
    bounds = {
        "spring": ("stiffness_bound", stiffness_bound),
        "damper": ("damping_bound", damping_bound),
    }
    limits = [_limit(*bounds[kind], place) for kind, place in wanted]
    structure = PassiveStructure(norm, mechanics, wanted, np.array(limits))
    parts = decoupled_parts(whole, structure.joined)
    return design_structured(whole, whole, parts, structure, norm, orders)


def _place(argument: str, place: Place, mechanics: Mechanics) -> Place:
    known = [n for n in mechanics.plant.states if n in mechanics.force]
    pair: list[str] = [place] if isinstance(place, str) else list(place)
    good = len(pair) == 2 and pair[0] != pair[1] and all(n in (*known, GROUND) for n in pair)
    if not good:
        raise invalid(
            argument,
            place,
            f"two different places out of {', '.join(known) or 'none'} and {GROUND}",
            "A place is a displacement state with a force on it: choose actuation='force'.",
        )
    return (pair[0], pair[1])


def _limit(argument: str, bound: float | Mapping[Place, float] | None, place: Place) -> float:
    if isinstance(bound, Mapping):
        bound = bound.get(place, bound.get((place[1], place[0])))
    return np.inf if bound is None else positive(argument, bound)
