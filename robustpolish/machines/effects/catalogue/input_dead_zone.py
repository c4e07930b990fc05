"""An actuator that does nothing about small commands."""

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

_TRIED = (0.02, 0.06, 0.15, 0.3)
"""Half widths as shares of the largest force that is asked for."""
_TIMES = 2.0
"""Of the half width that was tried, up to which the force is nearly linear in it."""


def _shapes(motion: Motion) -> list[Shape]:
    peak = float(np.max(np.abs(motion.q[0])))
    return [_at(motion, share * peak) for share in _TRIED] if peak else []


def _at(motion: Motion, width: float) -> Shape:
    column = -np.clip(motion.q[0], -width, width)

    def values(c: Array) -> dict[str, float]:
        return {"width": width * float(np.clip(c[0], 0.0, _TIMES))}

    return Shape(column[None, None], values, (1,))


def _on_signal(u: Array, time: Array, values: Mapping[str, float]) -> Array:
    return np.asarray(u - np.clip(u, -values["width"], values["width"]))


KIND = EffectKind(
    kind="input_dead_zone",
    title="Dead zone of an input",
    domain="input",
    parameters=(
        Parameter("width", "signal", "command to either side that does nothing", lower=0.0),
    ),
    on_signal=_on_signal,
    linear_signal=unchanged_signal,  # beyond it, changes act in full
    shapes=_shapes,
    looks_like="A residual against the sign of the command, where dry friction's is against the "
    "sign of the velocity: small commands do nothing, large ones too little.",
    checks=(
        "Overlap of a valve, a dead band in the controller or the amplifier, a loose coupling "
        "before the force.",
        "Give a slow ramp of the command with the machine clamped, and measure the force.",
    ),
    references=(
        "Tao and Kokotovic (1996), Adaptive Control of Systems with Actuator and Sensor "
        "Nonlinearities, chapter 2, Wiley",
    ),
)
