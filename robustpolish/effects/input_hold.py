"""What an input does between its samples; no effect of the machine but of the record.

The simulation takes inputs as linear between samples. A zero-order hold, or a smooth signal
with content near the sampling rate, is the linear interpolation of a filtered record; short
filters match the frequency responses.
"""

from __future__ import annotations

from robustpolish.effects.base import EffectKind, Parameter

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
    looks_like="Half a sample of delay (order 0), or an error that grows with the square of the "
    "frequency (order 3).",
    checks=("Whether the input was written by a controller (held) or measured (smooth).",),
    references=("Pintelon and Schoukens (2012), System Identification, section 13.2, Wiley",),
)
