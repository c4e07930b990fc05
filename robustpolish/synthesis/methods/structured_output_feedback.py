"""Controllers of tunable blocks: PID, filters, gains and small state spaces, wired as they are."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from robustpolish.long_calls import same_bits
from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.blocks.block import TunableBlock
from robustpolish.synthesis.blocks.placement import Placement, placed
from robustpolish.synthesis.blocks.tuned import TunedBlocks
from robustpolish.synthesis.design.design import Design
from robustpolish.synthesis.methods.structured_design import (
    Orders,
    checked_bound,
    design_structured,
)
from robustpolish.synthesis.problem.decoupling import undivided
from robustpolish.synthesis.problem.preflight import noisy, priced
from robustpolish.synthesis.structured_search.block_structure import BlockStructure
from robustpolish.synthesis.structured_search.policy import TIME_LIMIT
from robustpolish.synthesis.structured_search.structure import Norm
from robustpolish.validation import described, instance_of, invalid


@same_bits
def structured_output_feedback(
    plant: GeneralizedPlant,
    blocks: TunableBlock | Sequence[TunableBlock],
    norm: Norm = "hinf",
    *,
    initial: Design | Mapping[str, float] | None = None,
    time_limit: float = TIME_LIMIT,
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
        :func:`robustpolish.mixed_sensitivity`. :func:`robustpolish.static_gain` and
        :func:`robustpolish.fixed_order` take discrete plants too.
    blocks : TunableBlock or sequence of them
        Made by :func:`robustpolish.pid`, :func:`robustpolish.lead_lag`,
        :func:`robustpolish.notch`, :func:`robustpolish.low_pass`,
        :func:`robustpolish.static_gain` and :func:`robustpolish.fixed_order`; ``*`` puts them in
        series, ``rp.pid("x", control="F") * rp.notch()``, also with a number or a given filter.
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
    Signs are those of the whole package, u = K y. ``rp.pid("x", sign=-1)`` writes the usual
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
    >>> pi = rp.pid("x", kind="PI", sign=-1)
    >>> design = rp.structured_output_feedback(plant, [pi], target=0.6)
    >>> design.certificate.valid, design.certificate.achieved < 0.6
    (True, True)
    >>> print(design.details["blocks"]["pid_x"])
    pid_x: (Kp + Ki/s), with Kp = ..., Ki = ...
    """
    remedy = "Make one with rp.GeneralizedPlant or rp.mixed_sensitivity."
    instance_of("plant", plant, GeneralizedPlant, "a GeneralizedPlant", remedy)
    orders = Orders.checked(norm, time_limit, seed, target)
    bound = checked_bound(gain_bound)
    whole = noisy(priced(plant, control_weight), measurement_noise)
    if not (whole.nw and whole.nz):
        raise invalid(
            "plant",
            described(f"{whole.nw} disturbances w and {whole.nz} performance outputs z"),
            "at least one of each, between which the norm is taken",
            "Name them with GeneralizedPlant.from_loop or rp.mixed_sensitivity.",
        )
    placement = placed(blocks, whole)
    asked = BlockStructure(norm, placement, bound, _initial(initial, placement))
    if bound is not None and any(stage.integrators for _, _, stage in placement.places):
        raise invalid(
            "gain_bound",
            described(f"{bound:g} for blocks with integrators"),
            "no bound where the gain has none",
            "Weigh u instead (control_weight, or effort= of mixed_sensitivity).",
        )
    design = design_structured(plant, whole, (undivided(whole),), asked, norm, orders)
    idle = ", ".join(design.details["idle_integrals"])
    if not idle:
        return design
    note = (
        f"{idle} went as near to 0 as the search goes: this norm asks for no integral action. "
        "Weigh slow errors (performance= of mixed_sensitivity), or leave the integrator out."
    )
    return replace(design, message=f"{design.message} {note}")


def _initial(given: Any, placement: Placement) -> Mapping[str, float]:
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
