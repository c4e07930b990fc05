"""Dry friction with bristles: presliding, Stribeck effect and memory."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robustpolish.machines.effects.catalogue.dahl_friction import gains
from robustpolish.machines.effects.catalogue.stribeck_friction import (
    STATIC_FORCE,
    VELOCITY,
    implausible,
)
from robustpolish.machines.effects.kind import EffectKind, Parameter, Scan


def _law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]  # compiled by Numba
    # z is the force in the bristles
    # p: sliding and static force, velocity, stiffness, damping, step
    size = max(p[0] + (p[1] - p[0]) * np.exp(-((v[0] / p[2]) ** 2)), 1e-300)
    stiffness = p[3] / max(1.0, p[3] * abs(v[0]) / size * p[5])
    dz[0] = stiffness * (v[0] - abs(v[0]) * z[0] / size)
    f[0] = -z[0] - p[4] / max(p[3], 1e-300) * dz[0]


def _gains(values: Mapping[str, float], q: float, v: float) -> tuple[float, float, float]:
    stiffness, _, rate = gains(values, q, v)
    return stiffness, abs(values["damping"]), rate


def _state_sizes(values: Mapping[str, float], q: float, v: float) -> tuple[float, ...]:
    return (values["force"],)


KIND = EffectKind(
    kind="lugre_friction",
    title="LuGre friction",
    domain="pair",
    parameters=(
        Parameter("force", "F", "sliding friction force at high speed", lower=0.0),
        STATIC_FORCE,
        VELOCITY,
        Parameter("stiffness", "F/L", "stiffness of the bristles", lower=0.0),
        Parameter("damping", "F*T/L", "damping of the bristles", lower=0.0, fitted=False),
    ),
    law=_law,
    linear_in=("force",),
    scan=(
        Scan("stiffness", "per slip", (0.01, 0.04, 0.12, 0.35)),
        Scan("velocity", "speed", (0.06, 0.25)),
        Scan("static_force", "1", (1.3, 2.0)),
    ),
    gains=_gains,
    state_sizes=_state_sizes,
    implausible=implausible,
    states=1,
    context=("step",),
    family="dry friction",
    sharp=True,
    looks_like="Like Stribeck friction, with rounded loops after each reversal.",
    checks=(
        "Lubricated guides and preloaded bearings; micrometre motion before it breaks away.",
        "Move to and fro by a few micrometres: force follows displacement like a spring.",
    ),
    references=(
        "Canudas de Wit, Olsson, Astrom, Lischinsky (1995), IEEE Trans. Automatic Control "
        "40(3), 419-425",
    ),
)
