"""Screen every effect at every place for the one that makes the innovations white."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from robustpolish.effects import CONSTANT, Effect, kinds
from robustpolish.identification.discover.candidates import Columns, columns_at, places
from robustpolish.identification.discover.filtered import ORDERS, Filtered
from robustpolish.identification.observer.following import following
from robustpolish.identification.observer.kalman import Level, Scales
from robustpolish.identification.observer.missing_force import Smoothed, smooth
from robustpolish.identification.record import Record
from robustpolish.models.mechanical import MechanicalModel

Array = NDArray[np.float64]

LEVELS = (
    Level(3.0), Level(1.0), Level(0.3), Level(0.1), Level(0.03), Level(0.01), Level(0.002),
    Level(0.0), Level(0.0, 0.03), Level(0.0, 0.12),
)  # fmt: skip
# Where the error is far above the noise, the odds go to what explains its fine structure. What is
# large shows in runs that are hardly led.
HARDLY_LED = (Level(0.01), Level(0.0))


@dataclass(frozen=True, eq=False)
class Candidate:
    """An effect that might be missing, as far as screening can tell.

    Attributes
    ----------
    effect : Effect
        With first values of its parameters.
    score : float
        Half the fall of the Bayesian information criterion against no effect: log odds.
    fall : float
        Share by which the innovations fall at the level without effect.
    level : Level
        Level of guidance at which it does best: small if it explains everything.
    sensible : bool
        Whether signs and values are physical.
    """

    effect: Effect
    score: float
    fall: float
    level: Level
    sensible: bool = True
    remark: str = ""


@dataclass(frozen=True, eq=False)
class Screening:
    """All candidates, best first, and what the data says without any.

    Attributes
    ----------
    candidates : tuple of Candidate
        By their odds, the sensible ones first.
    large : tuple of Candidate
        The same effects as they come closest to runs that are hardly led, by the share of the
        error that they take away.
    level : Level
        At which the model is likeliest without any.
    order : int
        Of the noise there.
    motion : Smoothed
    levels : dict
        Information criterion without any, by level.
    """

    candidates: tuple[Candidate, ...]
    large: tuple[Candidate, ...]
    level: Level
    order: int
    motion: Smoothed
    levels: dict[Level, float] = field(default_factory=dict)


def screen(
    model: MechanicalModel,
    record: Record,
    scales: Scales,
    amplitude: float,
    allowed: Sequence[Effect] | None = None,
    finalists: int = 24,
) -> Screening:
    """Score every effect of the catalogue at every place it can act.

    Parameters
    ----------
    model : MechanicalModel
        With the effects found so far.
    record : Record
    scales : Scales
    amplitude : float
        Displacement amplitude, for the steps of effects in the model.
    allowed : sequence of Effect, optional
        Effects to try, their parameters aside; all kinds at all places by default.
    finalists : int
        How many are looked at with every level and noise colour.
    """
    time = np.asarray(record.data["time"].values, dtype=float)
    motion = smooth(model, record, following(model, record, scales), scales, amplitude)
    filtered = {level: Filtered(model, record, level, scales, motion, time) for level in LEVELS}
    nulls = {
        (level, order): score
        for level, f in filtered.items()
        for order, score in f.scores(f.residual(None)[0], 0).items()
    }
    best_level, best_order = min(nulls, key=lambda key: nulls[key])
    null = nulls[best_level, best_order]
    tried_at = [(e.definition, e.at) for e in allowed or ()]
    if allowed is None:
        tried_at = [(kind, at) for kind in kinds().values() for at in places(model, kind)]
    entries = [
        c for kind, at in tried_at for c in columns_at(model, kind, at, motion, time, record.dt)
    ]
    coarse = dict.fromkeys([best_level, Level(0.3), Level(0.01)])
    hardly = dict.fromkeys(HARDLY_LED)
    rough: list[tuple[float, Columns]] = []
    wide: list[tuple[float, Columns]] = []
    for entry in entries:
        scores = {level: _try(filtered[level], entry, (0,))[0][0] for level in {**coarse, **hardly}}
        rough.append((min(scores[level] for level in coarse), entry))
        wide.append((min(scores[level] - nulls[level, 0] for level in hardly), entry))
    found, large = [], []
    for entry in _finalists(rough, wide, finalists):
        tried = {level: _try(f, entry, ORDERS) for level, f in filtered.items()}
        score, level = min(
            ((score, level) for level, (scores, _) in tried.items() for score in scores.values()),
            key=lambda o: o[0],
        )
        found.append(_candidate(entry, (null - score) / 2, level, tried, filtered))
        for level in HARDLY_LED:
            if np.isfinite(tried[level][0][0]):
                large.append(_candidate(entry, (null - score) / 2, level, tried, filtered))
    found.sort(key=lambda c: (-c.sensible, -c.score))
    large.sort(key=lambda c: (-c.sensible, -c.fall))
    levels = {level: min(nulls[level, o] for o in ORDERS) for level in LEVELS}
    return Screening(
        _best_of_each(found), _best_of_each(large), best_level, best_order, motion, levels
    )


def _try(f: Filtered, entry: Columns, orders: Sequence[int]) -> tuple[dict[int, float], Array]:
    """Return the information criterion with an entry's columns, and their coefficients."""
    raw = f.respond(entry)
    bad = dict.fromkeys(orders, np.inf)
    if not np.isfinite(raw).all():
        return bad, np.full(len(raw), np.nan)
    rest, c = f.residual(f.weighted(raw))
    if not np.isfinite(c).all() or not entry.shape.valid(c):
        return bad, c
    samples = len(f.errors)
    scores = f.scores(rest, len(c), orders)
    if entry.kind.kind == "sensor_gain":
        # scaling the data down makes every error smaller: the density of the data pays for it
        if abs(c[0]) > 0.6:
            return bad, c
        jacobian = -2 * samples * np.log(1.0 - float(c[0]))
        scores = {order: score + jacobian for order, score in scores.items()}
    return scores, c


def _finalists(
    rough: list[tuple[float, Columns]], wide: list[tuple[float, Columns]], count: int
) -> list[Columns]:
    """Return the best shapes of each effect and place, the best places first.

    Parameters
    ----------
    rough, wide : list of tuple
        All entries with their information criterion: at any level, and hardly led.
    count : int
        Most places by the first; a quarter as many are added by the second.
    """
    chosen: dict[int, Columns] = {}
    for scored, most, shapes in ((rough, count, 2), (wide, count // 4, 1)):
        seen: dict[tuple[str, tuple[str, ...]], int] = {}
        for score, entry in sorted(scored, key=lambda item: item[0]):
            key = (entry.kind.kind, entry.at)
            full = key not in seen and len(seen) >= most
            if seen.get(key, 0) >= shapes or full or not np.isfinite(score):
                continue
            seen[key] = seen.get(key, 0) + 1
            chosen[id(entry)] = entry
    return list(chosen.values())


def _candidate(
    entry: Columns,
    score: float,
    level: Level,
    tried: dict[Level, tuple[dict[int, float], Array]],
    filtered: dict[Level, Filtered],
) -> Candidate:
    remark, c = "", tried[level][1]
    for sign, value in zip(entry.shape.signs, c, strict=True):
        if sign * value < 0:
            remark = "its force has the wrong sign"
    values = dict(entry.shape.values(c)) if np.isfinite(c).all() else {}
    for name, value in values.items():
        parameter = entry.kind.parameter(name)
        values[name] = float(np.clip(value, parameter.lower, parameter.upper))
    effect = Effect(entry.kind.kind, entry.at, values)
    f = filtered[level]
    before = _size(f.residual(None)[0], entry)
    after = _size(f.residual(f.weighted(f.respond(entry)))[0], entry)
    fall = float(1 - np.min(after / before))
    return Candidate(effect, score, fall, level, not remark, remark)


def _size(errors: Array, entry: Columns) -> Array:
    """Return the size of errors; their mean is the business of constants alone."""
    if entry.kind.family == CONSTANT:
        return np.sqrt(np.mean(errors**2, axis=0))
    return np.std(errors, axis=0)


def _best_of_each(found: list[Candidate]) -> tuple[Candidate, ...]:
    best: dict[tuple[str, tuple[str, ...]], Candidate] = {}
    for candidate in found:
        best.setdefault((candidate.effect.kind, candidate.effect.at), candidate)
    return tuple(best.values())
