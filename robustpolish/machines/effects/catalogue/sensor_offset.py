"""A sensor that does not show zero at zero."""

from __future__ import annotations

from collections.abc import Mapping

from robustpolish.base.arrays import Array
from robustpolish.machines.effects.kind import CONSTANT, EffectKind, Parameter, unchanged_signal


def _on_signal(u: Array, time: Array, values: Mapping[str, float]) -> Array:
    return u + values["offset"]


KIND = EffectKind(
    kind="sensor_offset",
    title="Offset of a sensor",
    domain="output",
    parameters=(Parameter("offset", "signal", "shown when there is nothing"),),
    on_signal=_on_signal,
    linear_signal=unchanged_signal,
    linear_in=("offset",),
    family=CONSTANT,
    looks_like="This channel's residual has a mean, from the first sample on.",
    checks=("Zero of the sensor and of its amplifier, drift with temperature.",),
    references=("Ljung (1999), System Identification, section 14.1, Prentice Hall",),
)
