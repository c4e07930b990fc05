"""What of records is held out to judge fits: whole records, or blocks of each."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robustpolish.identification.record import Record, least_samples
from robustpolish.models.mechanical import MechanicalModel

# Two held-out pieces, 30 % of the record, between those for estimation; free decays keep their
# beginning, where the amplitude is, for estimation.
_MARKS = (0.0, 0.4, 0.55, 0.85, 1.0)
_MARKS_OF_DECAYS = (0.0, 0.35, 0.65, 0.9, 1.0)

_OVER = 1e-3
"""Share of the motion's power that is left where a free decay is over: 3 % of the amplitude."""
_UNEVEN = 0.15
"""Share of the motion by which it may be ahead of the time in a record that moves steadily."""
_AS_MUCH = 2.0
"""Times the amplitude up to which records move alike: a cubic spring does four times as much."""


def sides(model: MechanicalModel, record: Record) -> tuple[list[Record], list[Record]]:
    """Return what is fitted to and what is held out.

    Of records that move alike some are held out as a whole. One that has not its like is cut into
    blocks: a law is not to be judged where nothing of it was seen, nor left unjudged where alone
    it shows, as friction in the smallest motion.

    Parameters
    ----------
    model : MechanicalModel
        Its inputs say which of them a record moves.
    record : Record

    Returns
    -------
    kept, judges : list of Record
        In order.
    """
    kept, judges = [], []
    for group in _alike(model, record.parts):
        held = _whole_judges(group)
        for i, part in enumerate(group):
            if held:
                (judges if i in held else kept).append(part)
                continue
            a, b, c, d, e = _blocks(model, part, several=len(record.parts) > 1)
            kept += [part.part(a, b), part.part(c, d)]
            judges += [part.part(b, c), part.part(d, e)]
    return sorted(kept, key=lambda part: part.first), sorted(judges, key=lambda part: part.first)


def _alike(model: MechanicalModel, parts: Sequence[Record]) -> list[list[Record]]:
    """Return records in groups that move alike: by the same inputs, and about as much."""
    size = np.sqrt(np.mean([np.var(part.Y, axis=0) for part in parts], axis=0))
    size = np.where(size > 0, size, 1.0)
    amplitude = [float(np.mean(np.std(part.Y, axis=0) / size)) for part in parts]
    moved = [tuple(np.ptp(p.own(p.signals(model)), axis=0) > 0) for p in parts]
    groups: list[list[int]] = []
    for i in sorted(range(len(parts)), key=lambda i: (moved[i], amplitude[i])):
        first = groups[-1][0] if groups else i
        if groups and moved[i] == moved[first] and amplitude[i] <= _AS_MUCH * amplitude[first]:
            groups[-1].append(i)
        else:
            groups.append([i])
    return [[parts[i] for i in group] for group in groups]


def _whole_judges(group: Sequence[Record]) -> list[int]:
    """Return which of a group of records, the smallest motion first, judge as a whole.

    A third of them, and half of their samples at most; those in the middle first.
    """
    middle, total = (len(group) - 1) / 2, sum(part.samples for part in group)
    held: list[int] = []
    for i in sorted(range(len(group)), key=lambda i: abs(i - middle)):
        tried = [*held, i]
        enough = len(tried) > max(1, round(len(group) / 3))
        if not enough and 2 * sum(group[k].samples for k in tried) <= total:
            held = tried
    return held


def _blocks(model: MechanicalModel, part: Record, several: bool) -> list[int]:
    """Return where the blocks of a record begin, and its end.

    They are shares of its time where it moves steadily, and of one free decay, whose end shows what
    is small. In the long quiet ends of blows nothing could be judged, nor where a decay was over
    long before, and a sweep passes its resonances in a moment, where alone a stop may be met: of
    those they are shares of the motion.
    """
    marks = _MARKS if model.inputs else _MARKS_OF_DECAYS
    of_time = [round(part.samples * mark) for mark in marks]
    away = np.abs(part.Y - part.Y.mean(axis=0))
    motion = np.cumsum(np.sum(away / np.maximum(away.max(axis=0), 1e-300), axis=1))
    if model.inputs:
        uneven = np.max(np.abs(motion / motion[-1] - np.linspace(0, 1, motion.size))) > _UNEVEN
    else:
        power = np.sum(away**2 / np.maximum(np.sum(away**2, axis=0), 1e-300), axis=1)
        uneven = np.sum(power[of_time[1] :]) < _OVER * np.sum(power)
    if not several and not uneven:
        return of_time
    inner = np.searchsorted(motion, np.array(marks[1:-1]) * motion[-1])
    found = [0, *inner.tolist(), part.samples]
    enough = np.min(np.diff(found)) >= least_samples(model)
    return found if enough else of_time
