"""Dry friction that is larger at low speed."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robustpolish.machines.effects.kind import EffectKind, Parameter, Scan

# Exponent beyond which nothing of an exponential is left beside 1; near its end exp is slow.
_NOTHING_LEFT = 700.0


def _law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]  # compiled by Numba
    fast = (v[0] / p[2]) ** 2
    more = np.exp(-fast) if fast < _NOTHING_LEFT else 0.0
    size = p[0] + (p[1] - p[0]) * more
    width = max(p[3], max(p[0], p[1]) * p[4])
    direction = np.tanh(v[0] / width) if width > 0.0 else np.sign(v[0])
    f[0] = -size * direction


def implausible(values: Mapping[str, float]) -> str | None:
    """Say why static and sliding friction cannot be those of a machine, or return None."""
    if values["static_force"] < (1 - 1e-9) * values["force"]:
        return "the static friction is below the sliding friction"
    if values["static_force"] > 6 * values["force"]:
        return "the static friction is many times the sliding friction"
    return None


def _near_velocity(values: Mapping[str, float]) -> tuple[float, float]:
    # A corner much sharper than the data shows is none.
    velocity = values["velocity"]
    return (0.2 * velocity, 6 * velocity) if velocity > 0 else (0.0, np.inf)


STATIC_FORCE = Parameter("static_force", "F", "friction force at rest", lower=0.0, at_least="force")
VELOCITY = Parameter(
    "velocity", "L/T", "speed over which it falls", 0.0, default=1.0, fit_bounds=_near_velocity
)


def _gains(values: Mapping[str, float], q: float, v: float) -> tuple[float, float, float]:
    more = abs(values["static_force"] - values["force"])
    width = values["width"]
    slope = max(values["static_force"], values["force"]) / width if width > 0 else 0.0
    return 0.0, max(slope, more / max(values["velocity"], 1e-300)), 0.0


KIND = EffectKind(
    kind="stribeck_friction",
    title="Stribeck friction",
    domain="pair",
    parameters=(
        Parameter("force", "F", "sliding friction force at high speed", lower=0.0),
        STATIC_FORCE,
        VELOCITY,
        Parameter("width", "L/T", "speed over which the force turns over", lower=0.0, fitted=False),
    ),
    law=_law,
    linear_in=(("force", "static_force"), "static_force"),
    scan=(
        Scan("velocity", "speed", (0.06, 0.15, 0.4)),
        Scan("width", "speed", (0.02,), kept=False),
    ),
    gains=_gains,
    implausible=implausible,
    context=("mobility",),
    family="dry friction",
    sharp=True,
    turns_over="width",
    looks_like="A square wave with the sign of the velocity and peaks at reversals.",
    checks=(
        "Lubricated guides and seals at low speed; stick-slip at slow feed.",
        "Measure the drive force at several constant speeds, slow ones too.",
    ),
    references=("Armstrong-Helouvry, Dupont, Canudas de Wit (1994), Automatica 30(7), 1083-1138",),
)
