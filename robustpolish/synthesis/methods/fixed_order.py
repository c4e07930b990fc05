"""Dynamic output feedback with few states: what `output_feedback(order=)` does."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import control

from robustpolish.errors import InfeasibleError, SolverError
from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.design.design import Design
from robustpolish.synthesis.methods.structured_design import Orders, design_structured
from robustpolish.synthesis.problem.decoupling import decoupled_parts, undivided
from robustpolish.synthesis.structured_search.reduced_starts import padded
from robustpolish.synthesis.structured_search.static_structure import StaticStructure
from robustpolish.synthesis.structured_search.structure import Norm
from robustpolish.validation import described, invalid, is_whole


def checked_order(order: Any) -> int:
    """Return a number of states, which has to be a whole one."""
    if not is_whole(order) or order < 0:
        raise invalid("order", order, "a whole number of at least 0", "0 is static feedback.")
    return int(order)


def refuse_beside_order(method: str, gamma: Any) -> None:
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


def design_of_order(
    plant: GeneralizedPlant,
    whole: GeneralizedPlant,
    order: int,
    full: Design | None,
    norm: Norm,
    tolerance: float,
    orders: Orders,
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
    orders : Orders

    Returns
    -------
    Design
    """
    short = None if full is None else _shortened(full, order)
    enough = _bound(full) * (1 + tolerance)
    if full is not None and short is not None and short.certificate.achieved <= enough:
        return _told(short, full, order, tolerance)
    start = None if short is None else _start(short, order)
    parts = decoupled_parts(whole)
    if order and len(parts) > 1:
        parts = (undivided(whole.without_delays()),)  # the limit counts the states of all parts
    asked = StaticStructure(norm, order, initial=start)
    try:
        design = design_structured(plant, whole, parts, asked, norm, replace(orders, target=enough))
    except SolverError:
        if short is None:
            raise
        design = short
    if short is not None and short.certificate.achieved < design.certificate.achieved:
        design = short
    return _told(design, full, order, tolerance)


def _shortened(full: Design, order: int) -> Design | None:
    """Return the full-order design, reduced if it has to be; None if no reduction is stable."""
    if full.controller.nstates <= order:
        return full
    try:
        return full.reduce(order=order)
    except (InfeasibleError, SolverError):
        return None


def _start(design: Design, order: int) -> control.StateSpace:
    M = padded(design.controller, order)
    return control.StateSpace(
        M[:order, :order],
        M[:order, order:],
        M[order:, :order],
        M[order:, order:],
        design.controller.dt,
        remove_useless_states=False,
    )


def _bound(full: Design | None) -> float:
    return 0.0 if full is None or full.lower_bound is None else full.lower_bound


def _told(design: Design, full: Design | None, order: int, tolerance: float) -> Design:
    """Say how far a design is from what any number of states reaches."""
    achieved, bound = design.certificate.achieved, _bound(full)
    if full is None:
        return design
    states = design.controller.nstates
    if full is design:
        more = f"It has {states} of the {order} states asked for at most."
        return replace(design, message=f"{design.message} {more}")
    count = f"{states} state{'' if states == 1 else 's'}"
    if bound > 0:
        above = f"{achieved / bound:.4g} times {bound:.6g}, below which no controller comes"
    else:
        above = f"{achieved / full.certificate.achieved:.4g} times that of full order"
    more = f"With {count} the norm is {achieved:.6g}, {above}."
    good = bound > 0 and achieved <= bound * (1 + tolerance)
    return replace(
        design,
        status="optimal" if good and design.status != "time_limit" else design.status,
        message=f"{more} {design.message}",
        lower_bound=bound if bound > 0 else design.lower_bound,
    )
