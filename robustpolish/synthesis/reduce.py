"""A design of loop shaping with a shorter controller: the gamma of its shaped loop decides."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import control
import numpy as np

from robustpolish.base.budget import single_threaded_blas
from robustpolish.base.checks import described, invalid, is_whole, misfit, positive
from robustpolish.errors import InfeasibleError, SolverError
from robustpolish.implementation.reduction import ReducedCandidate, Reducer
from robustpolish.linear.norms.h2 import h2_norm
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.plants.blocks import matrices_of
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.certificate import Certificate, certify, norm_in_words
from robustpolish.synthesis.problem.matrices import Controller, balanced
from robustpolish.synthesis.problem.preflight import named_controller

# A design with a shorter controller: which one, its certified loop decides.

DEFAULT_TOLERANCE = 0.05
"""What a shorter controller may cost where nothing else is said."""

SENSITIVITY_RISE = 0.1
"""A rise of the largest sensitivity worth a sentence: with it goes a tenth of the modulus margin.

A norm in physical units can be nearly all K S; then a controller of half a decibel of disk margin
is as good to it as one of seven, which happened with a levitated ball."""


class ReducedController(NamedTuple):
    """A shorter controller with its certificate, and what is to be told of it."""

    controller: control.StateSpace
    certificate: Certificate
    message: str
    details: Mapping[str, Any]


@single_threaded_blas
def reduce_controller(
    plant: GeneralizedPlant,
    controller: control.StateSpace,
    before: Certificate,
    order: int | None,
    tolerance: float | None,
    *,
    figure: str = "",
    kept: int = 0,
) -> ReducedController:
    """Shorten a controller; see `Design.reduce`.

    Parameters
    ----------
    plant : GeneralizedPlant
    controller : control.StateSpace
    before : Certificate
        Of the loop with the whole controller.
    order : int or None
    tolerance : float or None
    figure : str, optional
        What the norm is called that is judged.
    kept : int, optional
        States of a fixed part, such as weights, beside which the controller stands; orders and
        words count them.

    Returns
    -------
    ReducedController
    """
    n = controller.nstates + kept
    if order is not None and tolerance is not None:
        given = described(f"order={order!r} and tolerance={tolerance!r}")
        raise invalid("order", given, "one of the two", "Leave one of them out.")
    if n == kept:
        remedy = "There is nothing to reduce; discretise or export it as it is."
        raise misfit("controller", "a static gain", "a controller with states", remedy)
    reducer = Reducer(plant, controller)
    name = figure or f"{norm_in_words(before.norm)} norm"
    limit, part = math.inf, 0.0
    if order is None:
        part = DEFAULT_TOLERANCE
        if tolerance is not None:
            part = positive("tolerance", tolerance, zero=True)
        limit, orders = before.achieved * (1 + part), range(n - kept)
    elif not is_whole(order) or not 0 <= order < n:
        want = f"a whole number from 0 to {n - 1}, below the {n} states of the controller"
        raise invalid("order", order, want, "Pass tolerance=0.05 to have it chosen.")
    elif order < kept:
        raise InfeasibleError(
            f"order: a controller of {order} states has no room for the {kept} states of the "
            f"weights, which are a part of it: ask for {kept} or more. To let the weights go too, "
            "reduce rp.given_controller(design.plant, design.controller), which the norm of its "
            "loop judges."
        )
    else:
        orders = [int(order) - kept]
    shorter = (_best(plant, reducer, k, before, limit) for k in orders)
    found = next((best for best in shorter if best is not None), None)
    if found is None and order is not None:
        others = (k for k in range(n - kept) if k != order - kept)
        known = (k for k in others if _best(plant, reducer, k, before, math.inf) is not None)
        least = next(known, None)
        remedy = (
            "No order below it does: design with fewer states from the start, with order= of "
            "rp.static_output_feedback."
        )
        if least is not None:
            remedy = f"Order {least + kept} does."
        finite = "" if before.norm == "hinf" else " and its norm finite"
        raise InfeasibleError(
            f"order: no controller of {order} states was found that keeps the loop stable{finite}. "
            f"{remedy}"
        )
    if found is None:
        way, k, K, after = "none", n, controller, before
        message = (
            f"No controller of fewer than {n} states was found that keeps the "
            f"{name} within {100 * part:.3g} %; it stays as it is. Allow more with tolerance=."
        )
    else:
        candidate, after = found
        way, K = candidate.name, candidate.controller
        k = K.nstates + kept
        change = 100 * (after.achieved / before.achieved - 1) if before.achieved > 0 else 0.0
        message = (
            f"Reduced from {n} to {k} states ({way}): the {name} goes from "
            f"{before.achieved:.6g} to {after.achieved:.6g} ({change:+.3g} %)."
        ) + _sensitivity_sentence(plant, controller, K)
    told = {
        "reduction": way,
        "order_before": n,
        "order_after": k,
        "norm_before": before.achieved,
        "norm_after": after.achieved,
        "hankel_singular_values": MappingProxyType(dict(reducer.hankel)),
    }
    return ReducedController(K, after, message, MappingProxyType(told))


def _best(
    plant: GeneralizedPlant, reducer: Reducer, order: int, before: Certificate, limit: float
) -> tuple[ReducedCandidate, Certificate] | None:
    """Return the candidate of an order whose certified norm is least, and within the limit."""
    judged = []
    for candidate in reducer.of_order(order):
        loop = plant.closed_loop(candidate.controller)
        poles: Any = np.linalg.eigvals(np.asarray(loop.A))
        if not (np.abs(poles) < 1 if plant.is_discrete else poles.real < 0).all():
            continue
        hinf = before.norm == "hinf"
        value = float(hinf_norm(loop, tolerance=1e-6, exact=False) if hinf else h2_norm(loop))
        if value <= limit * (1 + 1e-6):
            judged.append((value, len(judged), candidate))
    for _, _, candidate in sorted(judged):
        certificate = certify(plant, candidate.controller, before.norm)
        if certificate.valid and certificate.achieved <= limit:
            return candidate, certificate
    return None


def _sensitivity_sentence(
    plant: GeneralizedPlant, whole: control.StateSpace, short: control.StateSpace
) -> str:
    """Say so if the largest sensitivity rises, whether the norm counts it or not.

    It is the largest norm of S at an output or T at an input, the other loops closed: one signal at
    a time these have no units; singular values of several would have.
    """
    sizes = []
    for K in (whole, short):
        loop = GeneralizedPlant.from_loop(plant.without_delays()).closed_loop(K)
        each = (loop[i, i] for i in range(plant.ny + plant.nu))
        sizes.append(max(float(hinf_norm(S, tolerance=1e-4, exact=False)) for S in each))
    before, after = sizes
    if after <= (1 + SENSITIVITY_RISE) * before:
        return ""
    return (
        f" The largest sensitivity rises from {before:.3g} to {after:.3g}, and margins fall: see "
        "rp.loop_analysis, and allow less, or weigh the plant so that its norm counts them."
    )


_NEEDED = ("W1", "W2", "shaped_plant", "shaped_controller")


def is_shaped(details: Mapping[str, Any]) -> bool:
    """Tell whether a design says by which weights its loop was shaped."""
    return all(isinstance(details.get(key), control.StateSpace) for key in _NEEDED)


def reduced_shaping(
    plant: GeneralizedPlant, details: Mapping[str, Any], order: int | None, tolerance: float | None
) -> ReducedController:
    """Shorten the controller Ks of a shaped plant in K = W1 Ks W2.

    The norm of the loop in the units of the plant says nothing of what was designed for; gamma
    does, whose inverse is the margin of the normalised coprime factors of the shaped loop.

    Parameters
    ----------
    plant : GeneralizedPlant
        Of the design.
    details : mapping
        Of the design.
    order : int or None
        Of K, the states of the weights counted.
    tolerance : float or None
        By which part gamma may rise.

    Returns
    -------
    ReducedController
        K with the certificate of its loop. Details hold ``gamma``, ``ncf_margin``,
        ``shaped_controller`` and ``shaped_certificate`` of the shorter one. Where none is found
        the controller is the Ks that was given.

    Raises
    ------
    SolverError
        If the loop with the weights in the controller could not be certified.
    """
    W1, Ks, W2 = (details[key] for key in ("W1", "shaped_controller", "W2"))
    loop = GeneralizedPlant.from_loop(details["shaped_plant"])
    kept = W1.nstates + W2.nstates
    before = certify(loop, Ks, "hinf")
    found = reduce_controller(
        loop, Ks, before, order, tolerance, figure="gamma of the shaped loop", kept=kept
    )
    if found.details["reduction"] == "none":
        return found
    inner, proof = found.controller, found.certificate
    K = named_controller(plant, *balanced(Controller(*matrices_of(W1 * inner * W2))))
    certificate = certify(plant, K, "hinf")
    if not certificate.valid:
        reasons = "; ".join(certificate.reasons)
        raise SolverError(
            f"The shorter controller is certified for the shaped plant, but not with the weights "
            f"in it: {reasons}. Reduce less."
        )
    # What was measured of the loop with the whole controller only goes.
    own = {key: value for key, value in details.items() if key != "target_factor"}
    new = {
        "gamma": proof.achieved,
        "ncf_margin": 1 / proof.achieved,
        "shaped_controller": inner,
        "shaped_certificate": proof,
    }
    told = MappingProxyType({**own, **found.details, **new})
    return ReducedController(K, certificate, found.message, told)
