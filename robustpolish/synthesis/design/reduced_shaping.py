"""A design of loop shaping with a shorter controller: the gamma of its shaped loop decides."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import control

from robustpolish.errors import SolverError
from robustpolish.models import GeneralizedPlant
from robustpolish.models.plant.blocks import matrices_of
from robustpolish.synthesis.certificate.certificate import certify
from robustpolish.synthesis.design.reduced import Reduced, reduced
from robustpolish.synthesis.problem.decoupling import named_controller
from robustpolish.synthesis.problem.matrices import Controller, balanced

_NEEDED = ("W1", "W2", "shaped_plant", "shaped_controller")
_OF_THE_WHOLE = ("target_factor",)
"""What was measured of the loop with the whole controller only."""


def is_shaped(details: Mapping[str, Any]) -> bool:
    """Tell whether a design says by which weights its loop was shaped."""
    return all(isinstance(details.get(key), control.StateSpace) for key in _NEEDED)


def reduced_shaping(
    plant: GeneralizedPlant, details: Mapping[str, Any], order: int | None, tolerance: float | None
) -> Reduced:
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
    Reduced
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
    found = reduced(
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
    return Reduced(K, certificate, found.message, told)
