"""Loop shaping by normalised coprime factors, after McFarlane and Glover."""

from __future__ import annotations

import math
from collections.abc import Sequence
from types import MappingProxyType
from typing import Any

import control
import numpy as np
from scipy import linalg

from robustpolish.errors import SolverError
from robustpolish.long_calls import Budget, same_bits
from robustpolish.models import GeneralizedPlant
from robustpolish.models.plant.blocks import named_system
from robustpolish.models.plant.elements import single_filter
from robustpolish.models.plant.given_system import as_state_space
from robustpolish.synthesis.certificate.certificate import Certificate, certify
from robustpolish.synthesis.design.design import Design
from robustpolish.synthesis.loop_shaping.coprime import (
    Coprime,
    arrays_of,
    cayley_back,
    coprime,
    in_series,
    loop_plant,
)
from robustpolish.synthesis.loop_shaping.reduced import reduced
from robustpolish.synthesis.loop_shaping.target import WantedLoop
from robustpolish.synthesis.loop_shaping.target_weight import limits_in_words, target_weight
from robustpolish.synthesis.problem.decoupling import named_controller
from robustpolish.synthesis.problem.matrices import Controller, SystemMatrices, balanced
from robustpolish.validation import described, invalid, is_whole, positive

Weight = control.StateSpace | control.TransferFunction | float
Weights = Weight | Sequence[Weight | None] | None


@same_bits
def loop_shaping(
    plant: GeneralizedPlant | control.StateSpace | control.TransferFunction,
    W1: Weights = None,
    W2: Weights = None,
    *,
    target: Weight | None = None,
    band_hz: Sequence[float] | None = None,
    factor: float = 1.1,
    order: int | None = None,
) -> Design:
    r"""Design a controller by H-infinity loop shaping.

    Weights give the loop its gain, which is then made as robust as it can be. The plant that they
    shape, Gs = W2 G W1, is stabilised by the controller Ks for which

    .. math:: \gamma = \left\| \begin{bmatrix} I \\ K_s \end{bmatrix} (I - G_s K_s)^{-1}
              \begin{bmatrix} I & G_s \end{bmatrix} \right\|_\infty

    is within `factor` of its minimum, which two Riccati equations give without a search. What
    goes onto the machine is K = W1 Ks W2. A gamma below 4 says that the gains that were asked for
    go together with good margins; 1 / gamma is :func:`robustpolish.ncf_margin` of the shaped loop.

    Parameters
    ----------
    plant : GeneralizedPlant, control.StateSpace or control.TransferFunction
        G. Of a generalised plant, the part from its controls to its measurements, with delays,
        limits and units; its disturbances and performance outputs are left out.
    W1, W2 : system, number or sequence of them, optional
        Weights before and behind the plant: one of one input and one output that stands for all
        channels, one per channel, or a system of as many inputs and outputs as there are channels.
        Integrators are welcome: ``rp.weight(np.inf, crossover_hz, high)``.
    target : control.StateSpace or control.TransferFunction, optional
        The open-loop gain that is wanted, in place of W1, which is then found: a stable W1 for
        which the singular values of W2 G W1 are those of the target. One of one input and output
        stands for all loops; otherwise it has as many of both as the plant has controls or
        measurements, whichever are fewer. Only its gain counts. Integrators are welcome:
        ``2 * pi * f / s`` crosses 1 at f in Hz.
    band_hz : (float, float), optional
        Where the gain has to be that of the target, in Hz; by default from a hundredth of its
        first crossover to ten times its last. Above the band W1 no longer inverts the plant, and
        the loop falls off faster than the target.
    factor : float, optional
        How far above its minimum gamma may lie; above 1. Close to 1 the controller gets a very
        fast pole.
    order : int, optional
        Number of states of Ks, which has as many as the shaped plant by default: the normalised
        coprime factors of Ks are then balanced and truncated. What that costs is told: `gamma` is
        that of the shorter controller.

    Returns
    -------
    Design
        Its controller is K, of as many states as the plant and twice the weights. Its plant is
        ``GeneralizedPlant.from_loop(plant)``, whose norm the certificate proves in the units of the
        plant; without weights that norm is gamma. ``details`` hold the ``gamma`` achieved and
        certified for the shaped loop, the ``optimal_gamma``, the ``ncf_margin``, the
        ``shaped_plant``, the ``shaped_controller`` with its ``shaped_certificate``, and the weights
        ``W1`` and ``W2`` as systems. With a target also the ``band_hz``, the ``shape_factor``
        within which the singular values of the shaped plant W2 G W1 are those of the target, and
        the ``target_factor``: those of the loop W2 G W1 Ks are at least the target over it where
        the target is above 1, and at most the target times it below 1; both at 300 frequencies of
        the band, no proof between.

    Raises
    ------
    InfeasibleError
        If a mode that is not stable is not controllable or not observable in the shaped plant, such
        as an integrator in a weight that a zero of the plant cancels.
    SolverError
        If the controller could not be certified.
    InvalidInputError
        If an argument does not fit.

    See Also
    --------
    ncf_margin, nu_gap : how robust a loop is, and how far plants are apart.

    Notes
    -----
    The sign is that of the package, u = K y, as in MATLAB's ``ncfsyn``; its ``loopsyn`` uses
    u = -K y. The weight that a target asks for inverts the plant within the band, the mirror
    images of its unstable poles and zeros included. What those forbid (a bandwidth up to half of a
    zero in the right half plane, from twice an unstable pole on) no weight gives: gamma rises,
    and the message names the zero or pole. Resonances that W1 cancels are still seen by
    disturbances at the plant's input. Of a plant with more controls than measurements W1 drives the
    combinations of controls that have most gain at the first crossover.

    McFarlane, Glover, "A loop shaping design procedure using H-infinity synthesis",
    IEEE Trans. Automatic Control 37 (1992) 759-769; Glover, McFarlane, "Robust stabilization of
    normalized coprime factor plant descriptions with H-infinity-bounded uncertainty", IEEE Trans.
    Automatic Control 34 (1989) 821-830; Le, Safonov, "Rational matrix GCD's and the design of
    squaring-down compensators", IEEE Trans. Automatic Control 37 (1992) 384-392, for targets.

    Examples
    --------
    Skogestad and Postlethwaite, example 9.3, with 2.34 as the smallest gamma:

    >>> import control
    >>> import robustpolish as rp
    >>> s = control.tf("s")
    >>> G = 200 / ((10 * s + 1) * (0.05 * s + 1) ** 2)
    >>> design = rp.loop_shaping(G, W1=(s + 2) / s)
    >>> round(design.details["optimal_gamma"], 2), round(design.details["gamma"], 2)
    (2.34, 2.55)
    >>> design.certificate.valid
    True

    The same plant for an open loop of 10 / s, which crosses 1 at 10 rad/s:

    >>> design = rp.loop_shaping(G, target=10 / s)
    >>> round(design.details["gamma"], 2), round(design.details["target_factor"], 1)
    (1.61, 1.3)
    """
    clock = Budget()
    number = positive("factor", factor)
    if number <= 1:
        remedy = "1.1 is the usual choice; 1.001 comes close to the minimum."
        raise invalid("factor", factor, "a number above 1", remedy)
    G = loop_plant("plant", plant)
    behind = _matrix_weight("W2", W2, G.ny, G.dt)
    part = in_series(SystemMatrices(G.A, G.B2, G.C2, G.D22), behind)
    wanted = _wanted(target, W1, band_hz, G)
    before = target_weight(part, wanted) if wanted else _matrix_weight("W1", W1, G.nu, G.dt)
    whole = in_series(before, part)
    inputs = list(G.control_names)
    if whole.D.shape[1] != G.nu:
        inputs = [f"v[{i}]" for i in range(whole.D.shape[1])]
    names = (inputs, list(G.measurement_names))
    states = [f"x{i + 1}" for i in range(len(whole.A))]
    shaped = named_system(whole, G.dt, *names, states)
    loop = GeneralizedPlant.from_loop(shaped)
    if order is not None and (not is_whole(order) or not 0 <= order <= loop.nx):
        want = f"a whole number from 0 to {loop.nx}, the states of the shaped plant"
        raise invalid("order", order, want, "Leave it out for the full order.")
    solved = coprime(loop)
    optimal = solved.optimal_gamma
    claim = optimal * number
    inner, proof = _certified(loop, solved, claim)
    if order is not None and order < inner.nstates:
        inner, proof = _shorter(loop, inner, int(order), proof)
    K = in_series(in_series(behind, arrays_of(inner)), before)
    real = GeneralizedPlant.from_loop(G)
    controller = named_controller(real, *balanced(Controller(*K)))
    weighted = any(given is not None for given in (W1, W2, target))
    certificate = certify(real, controller, "hinf")
    if not certificate.valid:
        raise SolverError(
            "The shaped loop is certified, the loop with the weights in the controller is not: "
            + "; ".join(certificate.reasons)
            + ". Do not cancel slow or unstable modes of the plant by the weights."
        )
    near, told = _near(wanted, whole, part, inner) if wanted else ({}, "")
    return Design(
        plant=real,
        controller=controller,
        closed_loop=real.closed_loop(controller),
        norm="hinf",
        status="suboptimal",
        message=_message(proof, optimal, weighted) + told,
        certificate=certificate,
        method="loop shaping",
        backend="scipy",
        elapsed=clock.elapsed,
        details=MappingProxyType(
            {
                "gamma": proof.achieved,
                "optimal_gamma": optimal,
                "ncf_margin": 1 / proof.achieved,
                "shaped_plant": shaped,
                "shaped_controller": inner,
                "shaped_certificate": proof,
                "W1": control.StateSpace(*before, G.dt),
                "W2": control.StateSpace(*behind, G.dt),
                **near,
            }
        ),
        lower_bound=None if weighted else optimal,
    )


def _wanted(target: Any, W1: Weights, band_hz: Any, plant: GeneralizedPlant) -> WantedLoop | None:
    """Return the loop that is wanted, if weights are not."""
    if target is None:
        if band_hz is not None:
            shown = described("a band without a target")
            raise invalid("band_hz", shown, "a band of target=", "Leave it out.")
        return None
    if W1 is not None:
        shown = described("a target besides W1")
        raise invalid("target", shown, "one of them", "The target finds W1; W2 may be given.")
    if isinstance(target, list | tuple):
        shown, want = described(f"a {type(target).__name__}"), "one system"
        raise invalid("target", shown, want, "Pass a diagonal system for a gain per control.")
    channels = min(plant.nu, plant.ny)
    system = _matrix_weight("target", target, channels, plant.dt)
    return WantedLoop.checked(system, plant.dt, band_hz)


def _near(
    wanted: WantedLoop, shaped: SystemMatrices, part: SystemMatrices, inner: control.StateSpace
) -> tuple[dict[str, Any], str]:
    """Return how near the shaped plant and the loop come to the target, and say it."""
    shape, _ = wanted.distance_of(shaped)
    factor, worst = wanted.shortfall_of(in_series(arrays_of(inner), shaped))
    low, high, where = (omega / (2 * math.pi) for omega in (*wanted.band, worst))
    found = {
        "target_factor": factor,
        "shape_factor": shape,
        "band_hz": (low, high),
    }
    text = (
        f" From {low:.4g} to {high:.4g} Hz the loop keeps the target within a factor of "
        f"{factor:.3g}, farthest at {where:.4g} Hz: at least the target over it where that is "
        f"above 1, at most the target times it below. The shaped plant has the target's gain "
        f"within {shape:.4g} (at {len(wanted.frequencies)} frequencies, no proof between)."
    )
    return found, text + limits_in_words(part, wanted)


def _certified(
    loop: GeneralizedPlant, solved: Coprime, claim: float
) -> tuple[control.StateSpace, Certificate]:
    """Return the shaped plant's controller with its certificate for gamma."""
    found = solved.controller(claim)
    if loop.is_discrete:
        found = cayley_back(found)
    # What was solved for has no further units: the plant's states were scaled, its signals not.
    inner = named_controller(loop, *balanced(Controller(*found)))
    proof = certify(loop, inner, "hinf", claim)
    if not proof.valid:
        raise SolverError(
            f"The controller for gamma {claim:.6g} could not be certified: "
            + "; ".join(proof.reasons)
            + ". Scale the plant so that a unit of u and of y mean as much, or raise factor=."
        )
    return inner, proof


def _shorter(
    loop: GeneralizedPlant, inner: control.StateSpace, order: int, full: Certificate
) -> tuple[control.StateSpace, Certificate]:
    """Return the controller with fewer states, certified."""
    short = named_controller(loop, *balanced(Controller(*reduced(inner, order))))
    proof = certify(loop, short, "hinf")
    if not proof.valid:
        raise SolverError(
            f"A controller of order {order} could not be certified: {'; '.join(proof.reasons)}. "
            f"That of order {inner.nstates} has gamma {full.achieved:.4g}; ask for more states."
        )
    return short, proof


def _matrix_weight(argument: str, given: Any, count: int, dt: float | bool) -> SystemMatrices:
    """Return a weight of as many inputs and outputs as there are channels."""
    if given is None:
        given = 1.0
    if isinstance(given, list | tuple):
        if len(given) != count:
            shown = described(f"{len(given)} weights")
            raise invalid(argument, shown, f"{count}, one per channel", "Write None for 1.")
        each = [
            arrays_of(single_filter(f"{argument}[{i}]", 1.0 if one is None else one, dt))
            for i, one in enumerate(given)
        ]
        return SystemMatrices(*(_diagonal([weight[k] for weight in each]) for k in range(4)))
    system = as_state_space(argument, given, dt)
    if (system.ninputs, system.noutputs) == (1, 1):
        return _matrix_weight(argument, [given] * count, count, dt)
    if (system.ninputs, system.noutputs) != (count, count):
        shown = described(f"{system.ninputs} inputs and {system.noutputs} outputs")
        want = f"one of each, or {count}"
        raise invalid(argument, shown, want, "Pass a number, a weight, or one per channel.")
    if system.nstates and system.dt is not None and system.dt != dt:
        shown = described(f"sampling time {system.dt}")
        raise invalid(argument, shown, f"{dt} like the plant", "Discretise it.")
    return arrays_of(system)


def _diagonal(blocks: Sequence[np.ndarray]) -> np.ndarray:
    return np.asarray(linalg.block_diag(*blocks)).reshape(
        sum(len(block) for block in blocks), sum(block.shape[1] for block in blocks)
    )


def _message(proof: Certificate, optimal: float, weighted: bool) -> str:
    shaped = "of the shaped loop " if weighted else ""
    text = (
        f"Gamma {shaped}is {proof.achieved:.6g}, proven to be at most {proof.bound:.6g}; no "
        f"controller comes below {optimal:.6g}, by two Riccati equations. The margin of the "
        f"normalised coprime factors is {1 / proof.achieved:.3g}"
    )
    if optimal > 4:
        return text + ": too small. The gains that are asked for do not suit the plant."
    return text + "."
