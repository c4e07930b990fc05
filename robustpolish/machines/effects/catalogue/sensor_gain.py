"""A sensor that shows another size than there is."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robustpolish.base.arrays import Array
from robustpolish.machines.effects.kind import EffectKind, Motion, Parameter, Shape


def _shapes(motion: Motion) -> list[Shape]:
    return [Shape(motion.q[None], _values, (0,))]


def _on_signal(u: Array, time: Array, values: Mapping[str, float]) -> Array:
    return u * values["gain"]


def _values(c: Array) -> Mapping[str, float]:
    return {"gain": 1.0 / (1.0 - float(np.clip(c[0], -0.9, 0.9)))}


KIND = EffectKind(
    kind="sensor_gain",
    title="Gain of a sensor",
    domain="output",
    parameters=(Parameter("gain", "1", "shown over true", default=1.0),),
    on_signal=_on_signal,
    shapes=_shapes,
    looks_like="This channel's residual is a scaled copy of the channel; the others fit.",
    checks=("Calibration of the sensor, its amplifier range, units of the column.",),
    references=("ISO 16063-21:2003, Vibration calibration by comparison",),
)
