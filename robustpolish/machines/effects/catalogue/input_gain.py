"""A measured input that acts with another size than it says."""

from __future__ import annotations

from collections.abc import Mapping

from robustpolish.base.arrays import Array
from robustpolish.machines.effects.kind import EffectKind, Parameter


def _on_signal(u: Array, time: Array, values: Mapping[str, float]) -> Array:
    return u * values["gain"]


KIND = EffectKind(
    kind="input_gain",
    title="Gain of an input",
    domain="input",
    parameters=(Parameter("gain", "1", "true over measured", default=1.0),),
    on_signal=_on_signal,
    linear_in=("gain",),
    looks_like="A residual that is a scaled copy of the simulated output, at all frequencies.",
    checks=("Calibration of the force sensor or amplifier, lever ratios, units of the column.",),
    references=("Ljung (1999), System Identification, section 14.1, Prentice Hall",),
)
