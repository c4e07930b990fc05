"""What an input does between its samples; no effect of the machine but of the record.

Runs take each step by itself, see ``simulation/between.py``. As a record of its own, a zero-order
hold, or a smooth signal with content near the sampling rate, is the linear interpolation of a
filtered one; short filters match the frequency responses.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robustpolish.base.arrays import Array
from robustpolish.machines.effects.kind import EffectKind, Parameter, Timing


def _on_signal(u: Array, time: Array, values: Mapping[str, float]) -> Array:
    """Return the record whose linear interpolation acts like `u` with another hold."""
    order = values["order"]
    if order == 1.0:
        return u
    padded = np.concatenate([u[:1], u[:1], u, u[-1:], u[-1:]])
    far, last, now, later, farther = (padded[i : i + u.size] for i in range(5))
    if order == 0.0:
        return (7 * (now + last) - later - far) / 12
    second = last - 2 * now + later
    fourth = far - 4 * last + 6 * now - 4 * later + farther
    return now - second / 12 + fourth / 90


def _timing(values: Mapping[str, float]) -> Timing:
    return Timing(values["order"])


KIND = EffectKind(
    kind="input_hold",
    title="Behaviour of an input between its samples",
    domain="input",
    parameters=(
        Parameter(
            "order",
            "1",
            "0: held until the next sample, 1: linear, 3: smooth (band-limited)",
            lower=0.0,
            upper=3.0,
            default=1.0,
            fitted=False,
        ),
    ),
    on_signal=_on_signal,
    timing=_timing,
    looks_like="Half a sample of delay (order 0), or an error that grows with the square of the "
    "frequency (order 3).",
    checks=("Whether the input was written by a controller (held) or measured (smooth).",),
    references=("Pintelon and Schoukens (2012), System Identification, section 13.2, Wiley",),
)
