"""A measured input that acts with another size than it says."""

from __future__ import annotations

from collections.abc import Mapping

from robustpolish.effects.kind import Array, EffectKind, Parameter
from robustpolish.effects.shapes import Motion, Shape


def _shapes(motion: Motion) -> list[Shape]:
    return [Shape(motion.q[None], lambda c: {"gain": 1.0 + float(c[0])}, (0,))]


def _on_signal(u: Array, time: Array, values: Mapping[str, float]) -> Array:
    return u * values["gain"]


KIND = EffectKind(
    kind="input_gain",
    title="Gain of an input",
    domain="input",
    parameters=(Parameter("gain", "1", "true over measured", default=1.0),),
    on_signal=_on_signal,
    shapes=_shapes,
    looks_like="A residual that is a scaled copy of the simulated output, at all frequencies.",
    checks=("Calibration of the force sensor or amplifier, lever ratios, units of the column.",),
    references=("Ljung (1999), System Identification, section 14.1, Prentice Hall",),
)
