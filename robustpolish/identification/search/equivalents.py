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
from robustpolish.identification.fit.least_squares import windows_log_error
from robustpolish.identification.fit.parameters import has_smoothing, with_effects_at
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
from robustpolish.machines.mechanical.data import motion_at, port_rows
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
    along = _Along(model, at, prepared)
    here, wanted = along.here, along.force
    if not along.usable:
        return []
    tried = [(kind, given, effect.at, 1.0) for kind, given in _alternative_kinds(effect, here)]
    tried += [(effect.definition, {}, *place) for place in _other_places(model, effect)]
    found = []
    for kind, given, there, sign in tried:
        seen, force = here if there == effect.at else along.moving(there), sign * wanted
        begun = _initial_values(kind, along.shapes(kind, there), there, given, seen, force)
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
    along = _Along(model, at, prepared)
    if not along.usable:
        return []
    here, wanted = along.here, along.force
    own = _fitted(effect.definition)
    richer = {k: g for k, g in _alternative_kinds(effect, here) if _fitted(k) > own}
    nearest = [k for k in richer if not any(_fitted(k) > _fitted(other) for other in richer)]
    now, found = windows_log_error(model, prepared), []
    for kind in nearest:
        shapes = along.shapes(kind, effect.at)
        begun = _initial_values(kind, shapes, effect.at, richer[kind], here, wanted)
        held = [s.parameter for s in kind.scan if s.kept and s.parameter not in effect.values]
        firsts = {tuple(values[name] for name in held): values for values in reversed(begun)}
        fits = [_fit_force(kind, values, here, wanted, held)[1] for values in firsts.values()]
        tried = [Effect.of(kind, effect.at, values) for values in fits]
        errors = _errors_with(model, at, tried, prepared)
        if errors and min(errors) < now - _SAME:
            found.append(tried[int(np.argmin(errors))])
    return found


class RoundedTurn(NamedTuple):
    """A model with a friction that turns over gently; whether no sharper turn was tried."""

    model: MechanicalModel
    sharpest: bool


def with_rounded_turn(
    model: MechanicalModel, at: int, prepared: PreparedRecord
) -> RoundedTurn | None:
    """Return a model in which a friction turns over within the speed that suits the data best.

    Where the turn is far wider than the true one, the other numbers are bent by it, and where it is
    far sharper, it makes no difference: from neither do slopes lead to the true one. So a ladder of
    speeds is run through, all other numbers held.

    Parameters
    ----------
    model : MechanicalModel
    at : int
        Where the effect stands.
    prepared : PreparedRecord

    Returns
    -------
    RoundedTurn or None
        None for an effect that has no turn, or a rounded one.
    """
    effect = model.effects[at]
    name = effect.definition.turns_over
    if not name or has_smoothing(effect):
        return None
    motion = prepared.motion(model, prepared.screened)
    speed = float(np.sqrt(np.mean((port_rows(model, effect) @ motion.v)[0] ** 2)))
    if not speed > 0:
        return None

    # the sharpest first: it takes the most steps
    tried = [
        effect.with_values({**effect.parameters, name: share * speed})
        for share in prepared.policy.smoothing_shares[::-1]
    ]
    best = int(np.argmin(_errors_with(model, at, tried, prepared)))
    return RoundedTurn(with_effects_at(model, at, tried[best]), best == 0)


def _errors_with(
    model: MechanicalModel, at: int, tried: Sequence[Effect], prepared: PreparedRecord
) -> list[float]:
    """Return what a model leaves of the record with each of some effects in place of one."""
    models = [with_effects_at(model, at, effect) for effect in tried]
    return parallel_map(lambda each: windows_log_error(each, prepared), models)


class _Along:
    """The motion of the most active part of a record, and the force of an effect along it.

    Parameters
    ----------
    model : MechanicalModel
    at : int
        Where the effect stands.
    prepared : PreparedRecord
    """

    def __init__(self, model: MechanicalModel, at: int, prepared: PreparedRecord) -> None:
        self.model, self.effect = model, model.effects[at]
        self.bare = with_effects_at(model, at)
        self.record = most_active_part(prepared.screened, _SAMPLES)
        self.motion = prepared.motion(model, self.record)
        if not np.isfinite(self.motion.q).all():  # which no observer can follow
            self.motion = prepared.motion(self.bare, self.record)
        # a law that is stiffer than any step can follow is told that step, or its force overflows
        self.step = prepared.record.dt / MOST_SUBSTEPS
        self.here = self.moving(self.effect.at)
        self.force = force_with(self.effect.definition, self.effect.values, self.here)

    def moving(self, there: tuple[str, ...]) -> Motion:
        """Return the motion at a place."""
        like, motion = replace(self.effect, at=there), self.motion
        return motion_at(self.model, like, self.record.time, motion.q, motion.v, self.step)

    def shapes(self, kind: EffectKind, there: tuple[str, ...]) -> list[Shape]:
        """Return the forces of a kind at a place, with the effect taken out."""
        found = candidate_columns(self.bare, kind, there, self.motion, self.record)
        return [entry.shape for entry in found]

    @property
    def usable(self) -> bool:
        """Whether there is a force, and the motion does not diverge."""
        with np.errstate(over="ignore"):
            return bool(0 < np.sum(self.force**2) < np.inf)


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
