"""Smooth hysteresis with a yield force."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robustpolish.effects.kind import EffectKind, Parameter
from robustpolish.effects.shapes import Scan


def _law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]  # compiled by Numba
    # z is the hysteretic force, p: yield force, stiffness, exponent, share of the sign term
    towards = np.sign(v[0] * z[0])
    level = abs(z[0]) / max(p[0], 1e-300)
    dz[0] = p[1] * v[0] * (1.0 - (p[3] * towards + 1.0 - p[3]) * level ** p[2])
    f[0] = -z[0]


def _gains(values: Mapping[str, float], q: float, v: float) -> tuple[float, float, float]:
    rate = values["exponent"] * abs(values["stiffness"]) * v / max(values["force"], 1e-300)
    return abs(values["stiffness"]), 0.0, rate


def _implausible(values: Mapping[str, float]) -> str | None:
    if values["exponent"] > 12:
        return "its exponent is that of an elastic Coulomb element"
    return None


def _state_sizes(values: Mapping[str, float], q: float, v: float) -> tuple[float, ...]:
    return (values["force"],)


KIND = EffectKind(
    kind="bouc_wen_hysteresis",
    title="Bouc-Wen hysteresis",
    domain="pair",
    parameters=(
        Parameter("force", "F", "yield force", lower=0.0),
        Parameter("stiffness", "F/L", "hysteretic stiffness at small motion", lower=0.0),
        Parameter("exponent", "1", "sharpness of yielding", lower=0.5, upper=20.0, default=1.0),
        Parameter("beta", "1", "share of the sign term", 0.0, 1.0, default=0.5, fitted=False),
    ),
    law=_law,
    linear_in=("force",),
    scan=(
        Scan("stiffness", "per slip", (0.05, 0.15, 0.4, 0.8)),
        Scan("exponent", "1", (1.0, 2.0)),
    ),
    gains=_gains,
    implausible=_implausible,
    state_sizes=_state_sizes,
    states=1,
    family="dry friction",
    sharp=True,
    looks_like="Rounded loops of residual force over displacement that do not depend on speed.",
    checks=(
        "Rubber mounts, wire ropes, joints in micro-slip, magnetostrictive or piezo parts.",
        "Cycle slowly at several amplitudes: the loops are nested and rounded.",
    ),
    references=("Ismail, Ikhouane, Rodellar (2009), Arch. Comput. Methods Eng. 16, 161-188",),
)
