"""A plant with other numbers in the place of the one that a design was made for."""

from __future__ import annotations

import control
import numpy as np

from robustpolish.analysis import h2_norm, hinf_norm, stability
from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.certificate.quick_norm import quick_norm
from robustpolish.validation import described, invalid


def in_place_of(nominal: GeneralizedPlant, other: GeneralizedPlant) -> GeneralizedPlant:
    """Return `other` with the signals that a synthesis added to `nominal`, in the same order.

    Prices on u and noise on y do not depend on the machine.

    Parameters
    ----------
    nominal : GeneralizedPlant
        The plant of a design.
    other : GeneralizedPlant

    Returns
    -------
    GeneralizedPlant
    """
    if nominal.measurement_names != other.measurement_names:
        every = other.with_full_state()
        if nominal.measurement_names == every.measurement_names:
            other = every
    _check("states", nominal.states, other.states)
    _check("controls", nominal.control_names, other.control_names)
    _check("measurements", nominal.measurement_names, other.measurement_names)
    _check("disturbances", nominal.disturbance_names, other.disturbance_names, some=True)
    _check("performance outputs", nominal.performance_names, other.performance_names, some=True)
    old, new = nominal.system, other.system
    inputs = [old.input_labels.index(name) for name in new.input_labels]
    outputs = [old.output_labels.index(name) for name in new.output_labels]
    B, C, D = (np.array(M, dtype=float) for M in (old.B, old.C, old.D))
    B[:, inputs] = new.B
    C[outputs] = new.C
    D[np.ix_(outputs, inputs)] = new.D
    nw, nz = nominal.nw, nominal.nz
    return nominal.replace(
        A=new.A, B1=B[:, :nw], B2=B[:, nw:], C1=C[:nz], C2=C[nz:],
        D11=D[:nz, :nw], D12=D[:nz, nw:], D21=D[nz:, :nw], D22=D[nz:, nw:],
    )  # fmt: skip


def _check(what: str, wanted: tuple[str, ...], found: tuple[str, ...], some: bool = False) -> None:
    """Refuse other names than those of the design's plant, or than `some` of them."""
    fits = set(found) <= set(wanted) if some else found == wanted
    if not fits:
        raise invalid(
            "plant_of",
            described(f"{what} {', '.join(found)}"),
            f"those of the design's plant: {', '.join(wanted)}",
            "Linearise as the design's plant was: the same controls, actuation and measured.",
        )


def loop_norm(loop: control.StateSpace, norm: str) -> float:
    """Return the norm of a loop, infinite if it is not stable."""
    if not stability(loop):
        return np.inf
    if norm == "h2":
        return float(h2_norm(loop))
    if loop.dt == 0 and loop.nstates:
        A, B, C, D = (np.asarray(M, dtype=float) for M in (loop.A, loop.B, loop.C, loop.D))
        found = quick_norm(A, B, C, D)
        if found.settled:
            return found.value
    return float(hinf_norm(loop))
