"""An actuator that follows its input with a first-order lag."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robustpolish.base.arrays import Array
from robustpolish.machines.effects.evaluate import first_order_lag
from robustpolish.machines.effects.kind import EffectKind, Motion, Parameter, Shape, Timing

_TRIED = 6
_TIMES = (0.5, 2.0)
"""Of the time constant that was tried, within which the force is nearly linear in it."""


def _shapes(motion: Motion) -> list[Shape]:
    """Try time constants from a sample to the time in which the input itself changes."""
    step = float(motion.time[1] - motion.time[0])
    speed = motion.speed
    longest = max(2 * motion.amplitude / speed if speed else 0.0, 8 * step)
    return [_at(motion, float(lag)) for lag in np.geomspace(step, longest, _TRIED)]


def _at(motion: Motion, lag: float) -> Shape:
    column = _on_signal(motion.q[0], motion.time, {"lag": lag}) - motion.q[0]

    def values(c: Array) -> dict[str, float]:
        return {"lag": lag * float(np.clip(c[0], *_TIMES))}

    return Shape(column[None, None], values, (1,))


def _on_signal(u: Array, time: Array, values: Mapping[str, float]) -> Array:
    step = float(time[-1] - time[0]) / (time.size - 1)
    return first_order_lag(u, np.concatenate([u[1:], u[-1:]]), step, values["lag"])


def _timing(values: Mapping[str, float]) -> Timing:
    return Timing(lag=values["lag"])


KIND = EffectKind(
    kind="input_lag",
    title="Lag of an input (actuator)",
    domain="input",
    parameters=(Parameter("lag", "T", "time constant of the actuator", lower=0.0),),
    on_signal=_on_signal,
    timing=_timing,
    shapes=_shapes,
    looks_like="A residual in quadrature that grows with frequency, as of a delay, and a response "
    "that is too large at high frequencies.",
    checks=(
        "Bandwidth of the current loop, amplifier or valve: measure the force, not the command.",
        "Inductance over resistance of a coil that is driven with a voltage.",
    ),
    references=("Franklin, Powell, Emami-Naeini (2019), Feedback Control, section 2.3, Pearson",),
)
