"""Springs across two axes, as of seals, fluid films or tilted supports."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robustpolish.machines.effects.kind import EffectKind, Motion, Parameter, Shape


def _law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]  # compiled by Numba
    f[0] = -p[0] * q[1]
    f[1] = -p[1] * q[0]


def _shapes(motion: Motion) -> list[Shape]:
    none = np.zeros_like(motion.q[0])
    columns = np.array([[-motion.q[1], none], [none, -motion.q[0]]])
    skew = np.array([[-motion.q[1], motion.q[0]]])
    tilted = np.array([[-motion.q[1], -motion.q[0]]])
    return [
        Shape(skew, lambda c: _values(c[0], -c[0]), (0,)),
        Shape(tilted, lambda c: _values(c[0], c[0]), (0,)),
        Shape(columns, lambda c: _values(c[0], c[1]), (0, 0)),
    ]


def _values(xy: float, yx: float) -> Mapping[str, float]:
    return {"stiffness_xy": float(xy), "stiffness_yx": float(yx)}


def _gains(values: Mapping[str, float], q: float, v: float) -> tuple[float, float, float]:
    return max(abs(values["stiffness_xy"]), abs(values["stiffness_yx"])), 0.0, 0.0


KIND = EffectKind(
    kind="cross_stiffness",
    title="Cross-coupled stiffness",
    domain="axes",
    parameters=(
        Parameter("stiffness_xy", "F/L", "first axis' force over second axis' displacement"),
        Parameter("stiffness_yx", "F/L", "second axis' force over first axis' displacement"),
    ),
    law=_law,
    shapes=_shapes,
    gains=_gains,
    looks_like="Each axis' residual follows the other axis' displacement. Opposite signs feed "
    "energy into a whirl, equal signs are a tilted spring.",
    checks=(
        "Seals, journal bearings and aerostatic films (opposite signs); mounts and sensors "
        "that are not aligned with the axes (equal signs).",
    ),
    references=("Genta (2005), Dynamics of Rotating Systems, chapter 6, Springer",),
)
