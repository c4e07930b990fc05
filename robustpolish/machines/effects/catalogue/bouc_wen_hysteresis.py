"""Smooth hysteresis.

The force z follows ``z' = k (v - (beta |v| sign(z) + gamma v) |z / F|^n)``. With beta + gamma = 1
the reference force F is the yield force; where beta + gamma is not positive nothing yields, and the
loops stiffen. In the usual notation the coefficients are ``k beta / F^n`` and ``k gamma / F^n``.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robustpolish.machines.effects.kind import EffectKind, Parameter, Scan


def _law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]  # compiled by Numba
    # z is the hysteretic force, p: reference force, stiffness, exponent, beta, gamma, step
    level = max(abs(z[0]) / max(p[0], 1e-300), 1e-12)
    bends = level ** p[2]
    rate = p[1] * abs(v[0]) * p[2] * abs(p[3]) * bends / (level * max(p[0], 1e-300))
    stiffness = p[1] / max(1.0, rate * p[5])
    dz[0] = stiffness * (v[0] - (p[3] * abs(v[0]) * np.sign(z[0]) + p[4] * v[0]) * bends)
    f[0] = -z[0]


def _gains(values: Mapping[str, float], q: float, v: float) -> tuple[float, float, float]:
    steepest = values["exponent"] * (abs(values["beta"]) + abs(values["gamma"]))
    rate = steepest * abs(values["stiffness"]) * v / max(values["force"], 1e-300)
    return abs(values["stiffness"]), 0.0, rate


def _implausible(values: Mapping[str, float]) -> str | None:
    if values["exponent"] > 12:
        return "its exponent is that of an elastic Coulomb element"
    if values["beta"] <= 0:
        return "its loops would feed energy into the motion"
    return None


def _bend(values: Mapping[str, float]) -> float:
    """Return the size that beta and gamma share: one of them may be near 0."""
    return max(abs(values["beta"]), abs(values["gamma"])) or 1.0


def _state_sizes(values: Mapping[str, float], q: float, v: float) -> tuple[float, ...]:
    return (values["force"],)


KIND = EffectKind(
    kind="bouc_wen_hysteresis",
    title="Bouc-Wen hysteresis",
    domain="pair",
    parameters=(
        Parameter("force", "F", "force that beta and gamma refer to", lower=0.0, fitted=False),
        Parameter("stiffness", "F/L", "hysteretic stiffness at small motion", lower=0.0),
        Parameter("exponent", "1", "sharpness of yielding", lower=0.5, upper=20.0, default=1.0),
        Parameter(
            "beta", "1", "of the term with the sign of the velocity", default=0.5, fit_size=_bend
        ),
        Parameter(
            "gamma",
            "1",
            "of the term without, negative if it stiffens",
            default=0.5,
            fit_size=_bend,
        ),
    ),
    law=_law,
    linear_in=("force",),
    scan=(
        Scan("stiffness", "per slip", (0.01, 0.05, 0.15, 0.4, 0.8)),
        Scan("exponent", "1", (1.0, 2.0)),
        Scan("gamma", "1", (0.5, -0.5)),
    ),
    gains=_gains,
    implausible=_implausible,
    state_sizes=_state_sizes,
    states=1,
    context=("step",),
    family="dry friction",
    sharp=True,
    looks_like="Rounded loops of residual force over displacement that do not depend on speed.",
    checks=(
        "Rubber mounts, wire ropes, joints in micro-slip, magnetostrictive or piezo parts.",
        "Cycle slowly at several amplitudes: the loops are nested and rounded.",
    ),
    references=("Ismail, Ikhouane, Rodellar (2009), Arch. Comput. Methods Eng. 16, 161-188",),
)
