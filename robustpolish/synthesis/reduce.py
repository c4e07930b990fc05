"""A design of loop shaping with a shorter controller: the gamma of its shaped loop decides."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import control
import numpy as np

from robustpolish.base.budget import single_threaded_blas
from robustpolish.base.checks import described, invalid, is_whole, positive
from robustpolish.errors import InfeasibleError, SolverError
from robustpolish.implementation.reduction import ReducedCandidate, Reducer
from robustpolish.linear.norms.h2 import h2_norm
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.plants.blocks import matrices_of
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.certificate import Certificate, certify
from robustpolish.synthesis.problem.matrices import Controller, balanced
from robustpolish.synthesis.problem.scaling import named_controller

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
        shown = described("a static gain")
        remedy = "There is nothing to reduce; discretise or export it as it is."
        raise invalid("controller", shown, "a controller with states", remedy)
    reducer = Reducer(plant, controller)
    name = figure or ("H-infinity norm" if before.norm == "hinf" else "H2 norm")
    if order is not None:
        order = _checked_order(order, n)
        if order < kept:
            raise InfeasibleError(_order_below_weights(order, kept))
        found = _best(plant, reducer, order - kept, before, math.inf)
        if found is None:
            raise InfeasibleError(_order_error(plant, reducer, order, n, before, kept))
    else:
        part = (
            DEFAULT_TOLERANCE if tolerance is None else positive("tolerance", tolerance, zero=True)
        )
        limit = before.achieved * (1 + part)
        shorter = (_best(plant, reducer, k, before, limit) for k in range(n - kept))
        found = next((best for best in shorter if best is not None), None)
        if found is None:
            message = (
                f"No controller of fewer than {n} states was found that keeps the "
                f"{name} within {100 * part:.3g} %; it stays as it is. Allow more with tolerance=."
            )
            return ReducedController(
                controller,
                before,
                message,
                _reduction_message(reducer, "none", n, n, before, before),
            )
    candidate, certificate = found
    k = candidate.controller.nstates + kept
    change = 100 * (certificate.achieved / before.achieved - 1) if before.achieved > 0 else 0.0
    message = (
        f"Reduced from {n} to {k} states ({candidate.name}): the {name} goes from "
        f"{before.achieved:.6g} to {certificate.achieved:.6g} ({change:+.3g} %)."
    )
    message += _sensitivity_sentence(plant, controller, candidate.controller)
    told = _reduction_message(reducer, candidate.name, n, k, before, certificate)
    return ReducedController(candidate.controller, certificate, message, told)


def _best(
    plant: GeneralizedPlant, reducer: Reducer, order: int, before: Certificate, limit: float
) -> tuple[ReducedCandidate, Certificate] | None:
    """Return the candidate of an order whose certified norm is least, and within the limit."""
    judged = []
    for candidate in reducer.of_order(order):
        value = _unproven_norm(plant, candidate.controller, before.norm)
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
    """Say so if the largest sensitivity rises, whether the norm counts it or not."""
    before, after = (_largest_sensitivity(plant, K) for K in (whole, short))
    if after <= (1 + SENSITIVITY_RISE) * before:
        return ""
    return (
        f" The largest sensitivity rises from {before:.3g} to {after:.3g}, and margins fall: see "
        "rp.loop_analysis, and allow less, or weigh the plant so that its norm counts them."
    )


def _largest_sensitivity(plant: GeneralizedPlant, controller: control.StateSpace) -> float:
    """Return the largest norm of S at an output or T at an input, the other loops closed.

    One signal at a time these have no units; singular values of several would have.
    """
    loop = GeneralizedPlant.from_loop(plant.without_delays()).closed_loop(controller)
    each = (loop[i, i] for i in range(plant.ny + plant.nu))
    return max(float(hinf_norm(part, tolerance=1e-4, exact=False)) for part in each)


def _unproven_norm(plant: GeneralizedPlant, controller: control.StateSpace, norm: str) -> float:
    loop = plant.closed_loop(controller)
    poles: Any = np.linalg.eigvals(np.asarray(loop.A))
    inside = np.abs(poles) < 1 if plant.is_discrete else poles.real < 0
    if not inside.all():
        return math.inf
    return float(hinf_norm(loop, tolerance=1e-6, exact=False) if norm == "hinf" else h2_norm(loop))


def _checked_order(order: Any, n: int) -> int:
    if not is_whole(order) or not 0 <= order < n:
        want = f"a whole number from 0 to {n - 1}, below the {n} states of the controller"
        raise invalid("order", order, want, "Pass tolerance=0.05 to have it chosen.")
    return int(order)


def _order_error(
    plant: GeneralizedPlant, reducer: Reducer, order: int, n: int, before: Certificate, kept: int
) -> str:
    orders = range(kept, n)
    found = (k for k in orders if _best(plant, reducer, k - kept, before, math.inf) is not None)
    least = next((k for k in found if k != order), None)
    if least is None:
        remedy = "No order below it does: design with fewer states from the start, with order= of "
        remedy += "rp.static_output_feedback."
    else:
        remedy = f"Order {least} does."
    finite = "" if before.norm == "hinf" else " and its norm finite"
    none = f"order: no controller of {order} states was found that keeps the loop stable"
    return f"{none}{finite}. {remedy}"


def _order_below_weights(order: int, kept: int) -> str:
    return (
        f"order: a controller of {order} states has no room for the {kept} states of the weights, "
        f"which are a part of it: ask for {kept} or more. To let the weights go too, reduce "
        "rp.given_controller(design.plant, design.controller), which the norm of its loop judges."
    )


def _reduction_message(
    reducer: Reducer, way: str, n: int, k: int, before: Certificate, after: Certificate
) -> Mapping[str, Any]:
    return MappingProxyType(
        {
            "reduction": way,
            "order_before": n,
            "order_after": k,
            "norm_before": before.achieved,
            "norm_after": after.achieved,
            "hankel_singular_values": MappingProxyType(dict(reducer.hankel)),
        }
    )


_NEEDED = ("W1", "W2", "shaped_plant", "shaped_controller")
_OF_THE_WHOLE = ("target_factor",)
"""What was measured of the loop with the whole controller only."""


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
    own = {key: value for key, value in details.items() if key not in _OF_THE_WHOLE}
    new = {
        "gamma": proof.achieved,
        "ncf_margin": 1 / proof.achieved,
        "shaped_controller": inner,
        "shaped_certificate": proof,
    }
    told = MappingProxyType({**own, **found.details, **new})
    return ReducedController(K, certificate, found.message, told)
