"""Dry friction of constant size against the sliding velocity."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robustpolish.machines.effects.kind import EffectKind, Parameter, Scan


def _law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]  # compiled by Numba
    width = max(p[2], abs(p[0]) * p[3])
    direction = np.tanh(v[0] / width) if width > 0.0 else np.sign(v[0])
    f[0] = -p[0] * direction - p[1] * direction * direction


def _gains(values: Mapping[str, float], q: float, v: float) -> tuple[float, float, float]:
    return 0.0, values["force"] / values["width"] if values["width"] > 0 else 0.0, 0.0


KIND = EffectKind(
    kind="coulomb_friction",
    title="Coulomb friction",
    domain="pair",
    parameters=(
        Parameter("force", "F", "sliding friction force", lower=0.0),
        Parameter("asymmetry", "F", "half the difference between the directions", fitted=False),
        Parameter("width", "L/T", "speed over which the force turns over", lower=0.0, fitted=False),
    ),
    law=_law,
    linear_in=("force",),
    scan=(Scan("width", "speed", (0.02,), kept=False),),
    gains=_gains,
    family="dry friction",
    sharp=True,
    turns_over="width",
    context=("mobility",),
    looks_like="A square wave with the sign of the velocity; relatively larger at small "
    "amplitudes, with flat spots at reversals.",
    checks=(
        "Guides, seals, cable chains and bearings at this place: preload, lubrication, dirt.",
        "Move slowly in both directions at constant speed: the drive force changes by twice "
        "the friction.",
    ),
    references=("Armstrong-Helouvry, Dupont, Canudas de Wit (1994), Automatica 30(7), 1083-1138",),
)
