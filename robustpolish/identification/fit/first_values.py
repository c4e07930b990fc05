"""What the fit of an effect begins with where slopes alone would lead it astray."""

from __future__ import annotations

import numpy as np

from robustpolish.effects import Effect
from robustpolish.identification.fit.homotopy import rms_over
from robustpolish.identification.fit.prepared import PreparedRecord
from robustpolish.models.mechanical import MechanicalModel

_AROUND = 4
"""Samples to either side of a first delay that are tried."""


def idle(effect: Effect) -> bool:
    """Return whether an effect makes no force."""
    sizes = _sizes(effect)
    return bool(sizes) and not any(effect.values[name] for name in sizes)


def _sizes(effect: Effect) -> list[str]:
    return [p.name for p in effect.definition.parameters if p.fitted and p.counts_force]


def sized(effect: Effect, share: float) -> Effect:
    """Return an effect with a share of its force."""
    sizes = _sizes(effect)
    return effect.with_values({k: share * v if k in sizes else v for k, v in effect.values.items()})


def timely(effect: Effect, model: MechanicalModel, prepared: PreparedRecord) -> Effect:
    """Return the delay of a held input that is right within a sample; other effects as they are.

    What an accelerometer shows of a held force jumps with it: whatever the delay within a sample,
    it sees the same, and no slope leads from one sample to the next.

    Parameters
    ----------
    effect : Effect
    model : MechanicalModel
        Without it.
    prepared : PreparedRecord
    """
    held = {e.at[0] for e in model.effects if e.kind == "input_hold" and e.values["order"] == 0.0}
    if effect.kind != "input_delay" or effect.at[0] not in held:
        return effect
    dt = prepared.record.dt
    first = int(effect.values["delay"] / dt)
    whole = {*range(_AROUND), *range(max(first - _AROUND, 0), first + _AROUND + 1)}
    tried = [effect.with_values({"delay": (samples + 0.5) * dt}) for samples in sorted(whole)]

    def left(late: Effect) -> float:
        delayed = model.with_effect(late.definition, late.at, late.values)
        return float(np.mean(np.log(rms_over(delayed, prepared, prepared.windows))))

    return min(tried, key=left)
