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
        more = _scanned_anew(effect, kind)
        if more:  # where it makes the same force they make no difference, and no slope leads on
            firsts = {tuple(values[name] for name in more): values for values in reversed(begun)}
            begun = list(firsts.values())
        fits = [
            _fit_force(kind, values, seen, force, more)
            for values in (begun if more else begun[:_STARTS])
        ]
        if fits:
            left, values = min(fits, key=lambda pair: pair[0])
            if more:
                left, values = _nearest_to_data(model, at, kind, fits, prepared)
            found.append(ForceEquivalent(Effect.of(kind, there, values), left))
    return sorted(found, key=lambda mimic: mimic.left)


def is_richer(kind: EffectKind, effect: Effect) -> bool:
    """Return whether a kind has the fitted numbers of an effect, by name, and more."""
    own, names = effect.definition, {p.name for p in kind.parameters if p.fitted}
    return not own.over and names > {p.name for p in own.parameters if p.fitted}


def _scanned_anew(effect: Effect, kind: EffectKind) -> list[str]:
    """Return the scanned numbers that a richer kind has more than an effect."""
    own = {p.name for p in effect.definition.parameters}
    scanned = [scan.parameter for scan in kind.scan if scan.kept and scan.parameter not in own]
    return scanned if is_richer(kind, effect) else []


def _nearest_to_data(
    model: MechanicalModel,
    at: int,
    kind: EffectKind,
    fits: Sequence[tuple[float, dict[str, float]]],
    prepared: PreparedRecord,
) -> tuple[float, dict[str, float]]:
    """Return the values of a kind in the place of an effect that leave the smallest errors."""

    def left(found: tuple[float, dict[str, float]]) -> float:
        instead = Effect.of(kind, model.effects[at].at, found[1])
        effects = (*model.effects[:at], instead, *model.effects[at + 1 :])
        errors = free_run_rms(replace(model, effects=effects), prepared, prepared.windows)
        return float(np.mean(np.log(errors)))

    return fits[int(np.argmin(parallel_map(left, fits)))]


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
