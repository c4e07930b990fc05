"""Screen every effect at every place for the one that makes the innovations white."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from robustpolish.arrays import Array
from robustpolish.effects import CONSTANT, Effect, kinds
from robustpolish.identification.fit.prepared import PreparedRecord
from robustpolish.identification.observer.kalman import FREE, Level
from robustpolish.identification.screening.candidates import Columns, columns_at, places
from robustpolish.identification.screening.filtered import FilteredRecord
from robustpolish.long_calls import on_all_cores
from robustpolish.models.mechanical import MechanicalModel


@dataclass(frozen=True, eq=False)
class ScreenedEffect:
    """An effect that might be missing, as far as screening can tell.

    Attributes
    ----------
    effect : Effect
        With first values of its parameters.
    score : float
        Half the fall of the Bayesian information criterion against no effect: log odds.
    fall : float
        Share by which the innovations fall at the level without effect.
    remark : str
        Why its signs or values cannot be physical, if they cannot.
    """

    effect: Effect
    score: float
    fall: float
    remark: str = ""

    @property
    def sensible(self) -> bool:
        """Whether signs and values are physical."""
        return not self.remark

    @property
    def place(self) -> tuple[str, tuple[str, ...]]:
        """Kind and place."""
        return self.effect.kind, self.effect.at

    @property
    def constant(self) -> bool:
        """Whether it never changes, as an offset or a preload."""
        return self.effect.definition.family == CONSTANT


@dataclass(frozen=True, eq=False)
class Screening:
    """All candidates, best first, and what the data says without any.

    Attributes
    ----------
    candidates : tuple of ScreenedEffect
        By their odds, the sensible ones first.
    finalists : tuple of Columns
        The shapes of the likeliest, and of those that are large, for a look at free runs; and all
        that have one shape only, for where the smoothed motion is poor (accelerometers with
        coloured noise) it names none.
    level : Level
        At which the model is likeliest without any.
    """

    candidates: tuple[ScreenedEffect, ...]
    finalists: tuple[Columns, ...]
    level: Level

    @property
    def lines(self) -> list[tuple[ScreenedEffect, float]]:
        """The forces from outside that have a line, and its frequency in Hz, the best first."""
        named = [(c, c.effect.definition.line) for c in self.candidates]
        return [(c, c.effect.values[name]) for c, name in named if name]

    @property
    def late(self) -> list[ScreenedEffect]:
        """What makes an input act late: delays and lags."""
        return [c for c in self.candidates if c.effect.definition.timing is not None]

    def shows(self, odds: float) -> bool:
        """Return whether any effect with physical signs and values has at least such log odds."""
        return any(c.sensible and c.score >= odds for c in self.candidates)

    def score(self, effect: Effect) -> float:
        """Return the log odds of an effect; none if it was no finalist."""
        there = (c.score for c in self.candidates if c.place == (effect.kind, effect.at))
        return next(there, 0.0)


def screen(
    model: MechanicalModel, prepared: PreparedRecord, allowed: Sequence[Effect] | None = None
) -> Screening:
    """Score every effect of the catalogue at every place it can act.

    Parameters
    ----------
    model : MechanicalModel
        With the effects found so far.
    prepared : PreparedRecord
    allowed : sequence of Effect, optional
        Effects to try, their parameters aside; all kinds at all places by default.
    """
    policy, record = prepared.policy, prepared.screened
    motion = prepared.motion(model, record)
    levels = policy.screening
    seen = on_all_cores(lambda at: FilteredRecord(model, prepared, record, at, motion), levels)
    filtered = dict(zip(levels, seen, strict=True))
    if not all(np.isfinite(f.errors).all() for f in filtered.values()):
        # along the smoothed motion an effect of the model diverges: nothing can be said beside it
        return Screening((), (), FREE)
    alone = on_all_cores(lambda f: f.null_scores(policy.noise_orders), seen)
    nulls = {
        (level, order): score
        for level, scores in zip(levels, alone, strict=True)
        for order, score in scores.items()
    }
    best_level = min(nulls, key=lambda key: nulls[key])[0]
    null = min(nulls.values())
    tried_at = [(e.definition, e.at) for e in allowed or ()]
    if allowed is None:
        tried_at = [(kind, at) for kind in kinds().values() for at in places(model, kind)]
    at_each = on_all_cores(lambda where: columns_at(model, *where, motion, record), tried_at)
    entries = [entry for found in at_each for entry in found]
    coarse = dict.fromkeys([best_level, *policy.coarse])
    hardly = dict.fromkeys(policy.hardly_led)
    rough, wide = _Looked(), _Looked()
    first = {level: filtered[level] for level in {**coarse, **hardly}}
    for entry, tried in zip(entries, _looked_at(first, entries, (0,)), strict=True):
        rough.add(entry, [(tried[level][0][0], tried[level][1]) for level in coarse])
        wide.add(
            entry, [(tried[level][0][0] - nulls[level, 0], tried[level][1]) for level in hardly]
        )
    found = []
    chosen: dict[int, Columns] = {}
    _choose(chosen, rough.right, policy.finalists, 2)
    _choose(chosen, wide.right, policy.further_finalists, 1)
    _choose(chosen, rough.wrong, policy.further_finalists, 1)
    finalists = list(chosen.values())
    looked = _looked_at(filtered, finalists, policy.noise_orders)
    for entry, tried in zip(finalists, looked, strict=True):
        right = {level: t for level, t in tried.items() if not _pulls_wrong(entry, t[1])}
        score, level = min(
            (
                (score, level)
                for level, (scores, _) in (right or tried).items()
                for score in scores.values()
            ),
            key=lambda o: o[0],
        )
        odds = (null - score) / 2
        found.append(_candidate(entry, odds, tried[level][1], filtered[level]))
    found.sort(key=lambda c: (-c.sensible, -c.score))
    shapes = Counter((entry.kind.kind, entry.at) for entry in entries)
    plain = [e for e in entries if id(e) not in chosen and shapes[e.kind.kind, e.at] == 1]
    return Screening(_best_of_each(found), (*finalists, *plain), best_level)


def _looked_at(
    filtered: Mapping[Level, FilteredRecord], entries: Sequence[Columns], orders: Sequence[int]
) -> list[dict[Level, tuple[dict[int, float], Array]]]:
    """Return for each entry what :func:`_try` finds at some levels."""
    return on_all_cores(
        lambda entry: {level: _try(f, entry, orders) for level, f in filtered.items()}, entries
    )


def _try(
    f: FilteredRecord, entry: Columns, orders: Sequence[int]
) -> tuple[dict[int, float], Array]:
    """Return the information criterion with an entry's columns, and their coefficients."""
    raw = f.respond(entry)
    bad = dict.fromkeys(orders, np.inf)
    if not np.isfinite(raw).all():
        return bad, np.full(len(raw), np.nan)
    rest, c = f.residual(f.weighted(raw))
    if not np.isfinite(c).all() or not entry.shape.valid(c) or too_heavy(entry, c, f.model):
        return bad, c
    samples = len(f.errors)
    scores = f.scores(rest, len(c), orders)
    if entry.kind.domain == "output":
        # scaling the data down makes every error smaller: the density of the data pays for it
        effect = Effect.of(entry.kind, entry.at, entry.shape.values(c))
        gain = entry.kind.signal_slope(effect.values).gain
        if abs(1 - 1 / gain) > f.policy.sensor_gain:
            return bad, c
        scores = {order: score + 2 * samples * np.log(gain) for order, score in scores.items()}
    return scores, c


class _Looked:
    """What a first look found: shapes that pull the right way somewhere, and those that never do.

    A shape that pulls the wrong way may well fit best of all shapes of its effect: the place of the
    best right one is not to be taken by it.
    """

    def __init__(self) -> None:
        self.right: list[tuple[float, Columns]] = []
        self.wrong: list[tuple[float, Columns]] = []

    def add(self, entry: Columns, tried: Sequence[tuple[float, Array]]) -> None:
        """Add a shape with its scores and coefficients at some levels."""
        right = [score for score, c in tried if not _pulls_wrong(entry, c)]
        where = self.right if right else self.wrong
        where.append((min(right or [score for score, _ in tried]), entry))


def _pulls_wrong(entry: Columns, c: Array) -> bool:
    return any(s * v < 0 for s, v in zip(entry.shape.signs, c, strict=True))


def too_heavy(entry: Columns, c: Array, model: MechanicalModel) -> bool:
    """Return whether a mass that an effect attaches would outweigh all that it is attached to.

    A mass that hardly moves turns its spring into one to ground, which another effect is.
    """
    names = [p.name for p in entry.kind.parameters if p.dimension == "M"]
    if not names:
        return False
    values = entry.shape.values(c)
    turning = {dof.name: dof.rotational for dof in model.dofs}
    most = sum(dof.mass for dof in model.dofs if dof.rotational == turning[entry.at[0]])
    return any(abs(values[name]) > most for name in names)


def _choose(
    chosen: dict[int, Columns], scored: list[tuple[float, Columns]], most: int, shapes: int
) -> None:
    """Add the best shapes of each effect and place, the best places first, no two much alike."""
    seen: dict[tuple[str, tuple[str, ...]], list[Columns]] = {}
    for score, entry in sorted(scored, key=lambda item: item[0]):
        key = (entry.kind.kind, entry.at)
        full = len(seen) >= most if key not in seen else len(seen[key]) >= shapes
        if full or not np.isfinite(score) or any(_alike(entry, s) for s in seen.get(key, [])):
            continue
        seen.setdefault(key, []).append(entry)
        chosen[id(entry)] = entry


_ALIKE = 0.95
"""Cosine of two shapes from which the second would tell nothing that the first does not."""


def _alike(one: Columns, other: Columns) -> bool:
    a, b = one.shape.columns[0].ravel(), other.shape.columns[0].ravel()
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return abs(float(a @ b)) > _ALIKE * size


def _candidate(entry: Columns, score: float, c: Array, f: FilteredRecord) -> ScreenedEffect:
    """Return an entry at one level, with the coefficients that it has there."""
    remark = "its force has the wrong sign" if _pulls_wrong(entry, c) else ""
    values = dict(entry.shape.values(c)) if np.isfinite(c).all() else {}
    for name, value in values.items():
        parameter = entry.kind.parameter(name)
        values[name] = float(np.clip(value, parameter.lower, parameter.upper))
    effect = Effect.of(entry.kind, entry.at, values)
    before = _size(f.residual(None)[0], entry)
    after = _size(f.residual(f.weighted(f.respond(entry)))[0], entry)
    return ScreenedEffect(effect, score, float(1 - np.min(after / before)), remark)


def _size(errors: Array, entry: Columns) -> Array:
    """Return the size of errors; their mean is the business of constants alone."""
    if entry.kind.family == CONSTANT:
        return np.sqrt(np.mean(errors**2, axis=0))
    return np.std(errors, axis=0)


def _best_of_each(found: list[ScreenedEffect]) -> tuple[ScreenedEffect, ...]:
    best: dict[tuple[str, tuple[str, ...]], ScreenedEffect] = {}
    for candidate in found:
        best.setdefault(candidate.place, candidate)
    return tuple(best.values())
