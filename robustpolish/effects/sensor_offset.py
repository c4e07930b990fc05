"""A sensor that does not show zero at zero."""

from __future__ import annotations

import numpy as np

from robustpolish.effects.base import CONSTANT, EffectKind, Parameter
from robustpolish.effects.shapes import Motion, Shape


def _shapes(motion: Motion) -> list[Shape]:
    return [Shape(np.ones((1, *motion.q.shape)), lambda c: {"offset": float(c[0])}, (0,))]


KIND = EffectKind(
    kind="sensor_offset",
    title="Offset of a sensor",
    domain="output",
    parameters=(Parameter("offset", "signal", "shown when there is nothing"),),
    shapes=_shapes,
    family=CONSTANT,
    looks_like="This channel's residual has a mean, from the first sample on.",
    checks=("Zero of the sensor and of its amplifier, drift with temperature.",),
    references=("Ljung (1999), System Identification, section 14.1, Prentice Hall",),
)
