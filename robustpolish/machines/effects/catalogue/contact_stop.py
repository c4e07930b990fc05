"""A stiff stop on one side, after a gap."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robustpolish.machines.effects.kind import EffectKind, Parameter, Scan


def _law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]  # compiled by Numba
    # the sign of the gap is the side on which the stop stands
    depth = q[0] - p[0]
    if (p[0] >= 0.0 and depth > 0.0) or (p[0] < 0.0 and depth < 0.0):
        f[0] = -p[1] * depth
    else:
        f[0] = 0.0


def _on_its_side(values: Mapping[str, float]) -> tuple[float, float]:
    return (0.0, np.inf) if values["gap"] >= 0 else (-np.inf, 0.0)


KIND = EffectKind(
    kind="contact_stop",
    title="Contact with a stop",
    domain="pair",
    parameters=(
        Parameter(
            "gap",
            "L",
            "displacement at which it touches; its sign is the side",
            fit_bounds=_on_its_side,
        ),
        Parameter("stiffness", "F/L", "stiffness of the stop", lower=0.0),
    ),
    law=_law,
    linear_in=("stiffness",),
    scan=(Scan("gap", "percentile", (60, 70, 80, 88, 94, 97.5)),),
    sharp=True,
    looks_like="Short pushes back on one side only; displacements cut off, bursts of the high "
    "modes.",
    checks=(
        "End stops, covers, cables and neighbours that are touched at this displacement.",
        "Put a thin sheet or a contact indicator into the gap.",
    ),
    references=("Shaw and Holmes (1983), J. Sound Vib. 90(1), 129-155",),
)
