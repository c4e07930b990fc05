"""Other effects that make nearly the force of one that was found.

Where a kind was found that is not quite the right one, the right one makes nearly the same force
along the same motion. From there a fit has a short way, with all other numbers as they are; begun
beside a machine without any such force, whose springs had to do its work, it may end elsewhere.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from robustpolish.base.arrays import Array
from robustpolish.base.budget import parallel_map
from robustpolish.identification.fit.least_squares import free_run_rms
from robustpolish.identification.fit.prepared import PreparedRecord
from robustpolish.identification.record import most_active_part
from robustpolish.identification.search.screening import (
    candidate_columns,
    mutually_exclusive,
    places,
)
from robustpolish.machines.effects.effect import Effect, kinds
from robustpolish.machines.effects.evaluate import MOST_SUBSTEPS, force_with
from robustpolish.machines.effects.kind import EffectKind, Motion, Shape
from robustpolish.machines.mechanical.data import motion_at
from robustpolish.machines.mechanical.model import MechanicalModel

_SAMPLES, _STARTS, _EVALUATIONS, _STEP = 1500, 2, 12, 1e-4
"""Samples along which forces are compared, shapes from which a fit begins, its runs and step."""
_REACH = 5.0
"""How far a number may move, as a logarithm: a friction stiffer than any step is a jump."""
_SAME = 1e-6
"""Share by which errors differ at most where a number makes no difference."""
_DIVERGED = 1e3
"""Error, in sizes of the force, that stands for all larger ones."""


class ForceEquivalent(NamedTuple):
    """An effect that makes nearly the force of another.

    Attributes
    ----------
    effect : Effect
    left : float
        Share of that force which it leaves along the motion, root mean square.
    """

    effect: Effect
    left: float


def find_force_equivalents(
    model: MechanicalModel, at: int, prepared: PreparedRecord
) -> list[ForceEquivalent]:
    """Return what makes nearly the force of an effect: other kinds there, its kind elsewhere.

    In place of a learned curve every kind that acts between two coordinates is tried. Elsewhere is
    where one of its coordinates moves against another one.

    Parameters
    ----------
    model : MechanicalModel
        Fitted.
    at : int
        Where the effect stands.
    prepared : PreparedRecord

    Returns
    -------
    list of ForceEquivalent
        The nearest first; without what makes the effect's own force by another name.
    """
    effect = model.effects[at]
    bare = replace(model, effects=(*model.effects[:at], *model.effects[at + 1 :]))
    record = most_active_part(prepared.screened, _SAMPLES)
    motion = prepared.motion(model, record)
    if not np.isfinite(motion.q).all():  # which no observer can follow
        motion = prepared.motion(bare, record)
    # a law that is stiffer than any step can follow is told that step, or its force overflows
    step = prepared.record.dt / MOST_SUBSTEPS

    def moving(there: tuple[str, ...]) -> Motion:
        like = replace(effect, at=there)
        return motion_at(model, like, record.time, motion.q, motion.v, step)

    here = moving(effect.at)
    wanted = force_with(effect.definition, effect.values, here)
    with np.errstate(over="ignore"):  # along a motion that diverges
        if not 0 < np.sum(wanted**2) < np.inf:
            return []
    tried = [(kind, given, effect.at, 1.0) for kind, given in _alternative_kinds(effect, here)]
    tried += [(effect.definition, {}, *place) for place in _other_places(model, effect)]
    found = []
    for kind, given, there, sign in tried:
        seen, force = here if there == effect.at else moving(there), sign * wanted
        shapes = candidate_columns(bare, kind, there, motion, record)
        begun = _initial_values(kind, [entry.shape for entry in shapes], there, given, seen, force)
        fits = [_fit_force(kind, values, seen, force) for values in begun[:_STARTS]]
        if fits:
            left, values = min(fits, key=lambda pair: pair[0])
            found.append(ForceEquivalent(Effect.of(kind, there, values), left))
    return sorted(found, key=lambda mimic: mimic.left)


def richer_kinds(model: MechanicalModel, at: int, prepared: PreparedRecord) -> list[Effect]:
    """Return the kinds of more numbers that begin nearer to the data in the place of an effect.

    Where such a kind makes the same force, its further numbers make no difference, and no slope
    leads on. So they are scanned, with all others fitted to the force, and run. Of kinds that
    contain each other only the nearest are tried.

    Parameters
    ----------
    model : MechanicalModel
        Fitted.
    at : int
        Where the effect stands.
    prepared : PreparedRecord
    """
    effect = model.effects[at]
    if effect.definition.domain != "pair" or effect.definition.over:
        return []
    bare = replace(model, effects=(*model.effects[:at], *model.effects[at + 1 :]))
    record = most_active_part(prepared.screened, _SAMPLES)
    motion = prepared.motion(model, record)
    if not np.isfinite(motion.q).all():
        return []
    step = prepared.record.dt / MOST_SUBSTEPS
    here = motion_at(model, effect, record.time, motion.q, motion.v, step)
    wanted = force_with(effect.definition, effect.values, here)
    own = _fitted(effect.definition)
    richer = {k: g for k, g in _alternative_kinds(effect, here) if _fitted(k) > own}
    nearest = [k for k in richer if not any(_fitted(k) > _fitted(other) for other in richer)]

    def left(tried: Effect) -> float:
        effects = (*model.effects[:at], tried, *model.effects[at + 1 :])
        errors = free_run_rms(replace(model, effects=effects), prepared, prepared.windows)
        return float(np.mean(np.log(errors)))

    now, found = left(effect), []
    for kind in nearest:
        shapes = [e.shape for e in candidate_columns(bare, kind, effect.at, motion, record)]
        begun = _initial_values(kind, shapes, effect.at, richer[kind], here, wanted)
        held = [s.parameter for s in kind.scan if s.kept and s.parameter not in effect.values]
        firsts = {tuple(values[name] for name in held): values for values in reversed(begun)}
        fits = [_fit_force(kind, values, here, wanted, held)[1] for values in firsts.values()]
        tried = [Effect.of(kind, effect.at, values) for values in fits]
        errors = parallel_map(left, tried)
        if errors and min(errors) < now - _SAME:
            found.append(tried[int(np.argmin(errors))])
    return found


def _fitted(kind: EffectKind) -> set[str]:
    return {p.name for p in kind.parameters if p.fitted}


def _other_places(
    model: MechanicalModel, effect: Effect
) -> Iterator[tuple[tuple[str, ...], float]]:
    """Yield places that share a coordinate that moves, and the sign of a force there."""
    for there in places(model, effect.definition) if effect.definition.domain == "pair" else ():
        if set(there) == set(effect.at):
            continue
        for one, other in itertools.product(effect.at, there):
            if one == other != "ground":
                at, k = model.frame, model.frame.coordinates.index(model.frame.multiples[one][0])
                yield there, at.row(effect.at)[k] / at.row(there)[k]


def _alternative_kinds(
    effect: Effect, here: Motion
) -> Iterator[tuple[EffectKind, Mapping[str, float]]]:
    """Yield the kinds that may stand for one, with every choice that no fit makes.

    What turns over gently goes on to do so.
    """
    own = effect.definition
    for kind in kinds().values():
        exclusive = mutually_exclusive(kind, own) or (own.over and kind.domain == own.domain)
        if kind.kind != own.kind and not exclusive:
            continue
        turn = {n: effect.values[n] for n in [kind.turns_over] if n in effect.values}
        asked = [p for p in kind.parameters if p.choices and here.context.get(p.matters_with)]
        for chosen in itertools.product(*(p.choices for p in asked)):
            given = dict(zip((p.name for p in asked), chosen, strict=True))
            if kind.kind != own.kind or any(effect.values[n] != v for n, v in given.items()):
                yield kind, turn | given


def _initial_values(
    kind: EffectKind,
    shapes: Sequence[Shape],
    at: tuple[str, ...],
    given: Mapping[str, float],
    here: Motion,
    wanted: Array,
) -> list[dict[str, float]]:
    """Return the values of the shapes of screening that are nearest to a force, nearest first."""
    found = []
    for shape in shapes:
        columns = shape.columns.reshape(len(shape.columns), -1).T
        sizes = np.linalg.lstsq(columns, wanted.ravel(), rcond=None)[0].astype(float)
        # what pulls the wrong way for now may be needed beside other values
        sizes = np.where(np.array(shape.signs) * sizes < 0, 0.0, sizes)
        if sizes.any():
            values = {**Effect.of(kind, at, shape.values(sizes)).values, **given}
            with np.errstate(over="ignore"):
                left = float(np.sum((force_with(kind, values, here) - wanted) ** 2))
            found.append((left, values))
    return [values for _, values in sorted(found, key=lambda pair: pair[0])]


def _fit_force(
    kind: EffectKind,
    values: Mapping[str, float],
    here: Motion,
    wanted: Array,
    held: Sequence[str] = (),
) -> tuple[float, dict[str, float]]:
    """Return the share of a force that a kind leaves at best, and its values."""
    numbers = [p for p in kind.parameters if p.fitted and p.name not in held]
    first = np.array([values[p.name] for p in numbers])
    sizes = np.array([p.scale_from(values[p.name], values) for p in numbers])
    lower, upper = np.array([(p.lower, p.upper) for p in numbers]).T
    positive = (lower >= 0) & (first > 0)
    size = float(np.sqrt(np.mean(wanted**2)))

    def read(x: Array) -> dict[str, float]:
        """Return the first values, moved by x - 1: in logarithms, or in their sizes."""
        moved = np.where(positive, first * np.exp(x - 1), first + (x - 1) * sizes)
        told = np.clip(moved, lower, upper).tolist()
        return {**values, **dict(zip((p.name for p in numbers), told, strict=True))}

    def errors(x: Array) -> Array:
        off = (force_with(kind, read(x), here) - wanted).ravel() / size
        return np.clip(np.nan_to_num(off, nan=_DIVERGED), -_DIVERGED, _DIVERGED)

    # steps of the slopes are shares of x, so that x begins at 1
    begin = np.ones(len(numbers))
    found = least_squares(
        errors,
        begin,
        diff_step=_STEP,
        max_nfev=_EVALUATIONS,
        bounds=(begin - _REACH, begin + _REACH),
    )
    return float(np.sqrt(2 * found.cost / wanted.size)), read(found.x)
