"""Records whose motion dies: which they are, and where to cut them to predict the end."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robustpolish.arrays import Array
from robustpolish.identification.record import Record, least_samples
from robustpolish.models.mechanical import MechanicalModel

_PUSHED = 0.99
"""Share of an input's energy after which the machine is left to itself."""
_LEFT = 0.5
"""Share of a record that it is left to itself at least."""
_FALL = 1.5
"""Times by which the motion falls at least: laws of damping differ in how they go with it."""
_OVER = 0.05
"""Share of the largest motion that has to be left: what comes after may be nothing but noise."""
_EARLY = 0.6
"""Share of the time to fit to."""


class Cut(NamedTuple):
    """Parts of decays: what is fitted to predict how they go on, and what is predicted."""

    early: list[Record]
    late: list[Record]


def cut_decays(model: MechanicalModel, record: Record) -> Cut | None:
    """Return the early and the late parts of records all of which are free decays, or None.

    Parameters
    ----------
    model : MechanicalModel
        Its inputs, if it has any, have to be over early, as a blow is.
    record : Record

    Returns
    -------
    Cut or None
        Of each record; the early part with what moved it.
    """
    early, late = [], []
    inputs = record.signals(model)
    for part in record.parts:
        alone = _left_alone(part.own(inputs))
        size = _motion(part)[alone:]
        tenth = size.size // 10
        if size.size < _LEFT * part.samples or not tenth:
            return None
        first, last = (float(np.sqrt(np.mean(x**2))) for x in (size[:tenth], size[-tenth:]))
        end = int(np.flatnonzero(size >= _OVER * size.max())[-1]) + 1
        cut = round(_EARLY * end)
        if first < _FALL * last or min(cut, end - cut) < least_samples(model):
            return None
        early.append(part.part(0, alone + cut))
        late.append(part.part(alone + cut, alone + end))
    return Cut(early, late)


def _left_alone(inputs: Array) -> int:
    """Return the sample from which inputs have done what they do."""
    energy = np.cumsum((inputs - np.median(inputs, axis=0)) ** 2, axis=0)
    moving = energy[:, energy[-1] > 0]
    if not moving.size:
        return 0
    return int(max(np.searchsorted(e, _PUSHED * e[-1]) for e in moving.T)) + 1


def _motion(part: Record) -> Array:
    """Return how far the outputs are from where they end, each by its size, shape (samples,)."""
    away = np.abs(part.Y - part.Y[-max(1, part.samples // 10) :].mean(axis=0))
    largest = away.max(axis=0)
    return np.sum(away / np.where(largest > 0, largest, 1.0), axis=1)
