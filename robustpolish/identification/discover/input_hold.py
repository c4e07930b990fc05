"""Find out what the inputs do between their samples.

A record made with a zero-order hold and read as linear looks like half a sample of delay; a
smooth one with content near the sampling rate like an error of every model. Neither is a
missing effect of the machine.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from robustpolish.identification.discover.filtered import Filtered
from robustpolish.identification.observer.following import following
from robustpolish.identification.observer.kalman import Level
from robustpolish.identification.observer.missing_force import smooth
from robustpolish.models.mechanical import MechanicalModel

if TYPE_CHECKING:
    from robustpolish.identification.fit.prepared import Setting

_LEVELS = (Level(1.0), Level(0.1), Level(0.01))
_ORDERS = (0.0, 3.0)
_LEAST_ODDS = 20.0
_DELAYS = (1, 2, 4)


def with_holds(model: MechanicalModel, setting: Setting) -> MechanicalModel:
    """Return the model with the holds of its force inputs, where they are not linear.

    All inputs are taken to be of one kind. The linear model's innovations judge, its own
    numbers being corrected at the same time.
    """
    names = [i.name for i in model.inputs if i.imposes is None]
    if not names or any(e.kind == "input_hold" for e in model.effects):
        return model
    tried = {1.0: model}
    for order in _ORDERS:
        held = model
        for name in names:
            held = held.with_effect("input_hold", (name,), {"order": order})
        tried[order] = held
    scores = {order: null_score(candidate, setting) for order, candidate in tried.items()}
    best = min(scores, key=lambda order: scores[order])
    if scores[1.0] - scores[best] <= 2 * _LEAST_ODDS:
        return model
    if best == 0.0 and _late(model, names, setting) < scores[best]:
        return model  # a longer delay, of which a hold would take half a sample
    return tried[best]


def _late(model: MechanicalModel, names: list[str], setting: Setting) -> float:
    """Return the best score with one input late by some whole samples."""
    late = [
        model.with_effect("input_delay", (name,), {"delay": samples * setting.dt})
        for name in names
        for samples in _DELAYS
    ]
    return min(null_score(candidate, setting) for candidate in late)


def null_score(model: MechanicalModel, setting: Setting) -> float:
    """Return the information criterion of a model without more effects, at its best level."""
    record = setting.screened
    time = np.asarray(record.data["time"].values, dtype=float)
    level = following(model, record, setting.scales)
    motion = smooth(model, record, level, setting.scales, setting.amplitude)
    scores = []
    for level in _LEVELS:
        seen = Filtered(model, record, level, setting.scales, motion, time)
        scores.append(min(seen.scores(seen.residual(None)[0], 0, (0, 1)).values()))
    return float(min(scores))
