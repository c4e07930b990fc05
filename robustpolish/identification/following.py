"""How closely an observer has to follow the data to show the motion best."""

from __future__ import annotations

import numpy as np

from robustpolish.identification.linear_observer import LinearObserver
from robustpolish.identification.observer import Level, Scales
from robustpolish.identification.record import Record
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.simulation.signals import raw_outputs, signals

FOLLOWING = (Level(10.0), Level(3.0), Level(1.0), Level(0.3), Level(0.1))


def following(model: MechanicalModel, record: Record, scales: Scales) -> Level:
    """Return the level whose innovations are smallest: it shows the motion best."""
    W = signals(model, record.data)
    Y = raw_outputs(model, record.Y, record.data["time"].values)
    best, least = FOLLOWING[0], np.inf
    for level in FOLLOWING:
        observer = LinearObserver(model, record.dt, level, scales)
        _, errors = observer.innovations(Y, W, None)
        tail = errors[len(errors) // 20 :]
        score = float(np.sum(np.log(np.mean(tail**2, axis=0))))
        if score < least:
            best, least = level, score
    return best
