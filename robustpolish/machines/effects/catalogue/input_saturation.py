"""An actuator that cannot do more than its limit."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robustpolish.base.arrays import Array
from robustpolish.machines.effects.kind import (
    EffectKind,
    Motion,
    Parameter,
    Shape,
    unchanged_signal,
)

_TRIED = (0.92, 0.8, 0.65, 0.5, 0.35)
"""Limits as shares of the largest force that is asked for."""
_MORE = 1.5
"""How much deeper than a limit that was tried the signal may be cut, in what was cut off."""


def _shapes(motion: Motion) -> list[Shape]:
    peak = float(np.max(np.abs(motion.q[0])))
    return [_at(motion, peak, share * peak) for share in _TRIED] if peak else []


def _at(motion: Motion, peak: float, limit: float) -> Shape:
    column = np.clip(motion.q[0], -limit, limit) - motion.q[0]

    def values(c: Array) -> dict[str, float]:
        return {"limit": peak - float(np.clip(c[0], 0.0, _MORE)) * (peak - limit)}

    return Shape(column[None, None], values, (1,))


def _on_signal(u: Array, time: Array, values: Mapping[str, float]) -> Array:
    return np.clip(u, -values["limit"], values["limit"])


KIND = EffectKind(
    kind="input_saturation",
    title="Limit of an input (saturation)",
    domain="input",
    parameters=(
        Parameter("limit", "signal", "largest force to either side", lower=0.0, default=np.inf),
    ),
    on_signal=_on_signal,
    linear_signal=unchanged_signal,  # below the limit
    shapes=_shapes,
    looks_like="A residual in phase with the largest forces alone: the machine answers small "
    "commands as it should and large ones too weakly.",
    checks=(
        "Current limit of the amplifier, supply voltage, pressure of the supply of a valve.",
        "Measure the force instead of the command, or drive with less.",
    ),
    references=("Hippe (2006), Windup in Control, chapter 1, Springer",),
)
