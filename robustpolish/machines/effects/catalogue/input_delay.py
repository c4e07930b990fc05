"""A measured input that acts later than it says."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.interpolate import CubicSpline

from robustpolish.base.arrays import Array
from robustpolish.machines.effects.kind import EffectKind, Motion, Parameter, Shape, Timing


def _shapes(motion: Motion) -> list[Shape]:
    return [_at(motion, samples) for samples in (1, 2, 4, 8)]


def _at(motion: Motion, samples: int) -> Shape:
    delay = samples * (motion.time[1] - motion.time[0])
    late = np.concatenate([motion.q[0, :1].repeat(samples), motion.q[0, :-samples]])
    return Shape(
        (late - motion.q[0])[None, None],
        lambda c: {"delay": delay * float(np.clip(c[0], 0.0, 3.0))},
        (1,),
    )


def _on_signal(u: Array, time: Array, values: Mapping[str, float]) -> Array:
    if not values["delay"]:
        return u
    return CubicSpline(time, u)(np.maximum(time - values["delay"], time[0]))


def _timing(values: Mapping[str, float]) -> Timing:
    return Timing(delay=values["delay"])


KIND = EffectKind(
    kind="input_delay",
    title="Delay of an input",
    domain="input",
    parameters=(Parameter("delay", "T", "time from the record to the force", lower=0.0),),
    on_signal=_on_signal,
    timing=_timing,
    shapes=_shapes,
    looks_like="A residual in quadrature, growing with frequency; it looks like negative "
    "damping at every mode.",
    checks=("Bus and filter delays, sample-and-hold, clocks of two recorders.",),
    references=("Ljung (1999), System Identification, section 10.5, Prentice Hall",),
)
