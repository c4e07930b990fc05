"""What free runs say of effects before any is fitted: by how much their errors would fall.

The model runs freely over windows; each candidate is added with a small size, and what it changes
is compared with the errors, after all that starts and the model's own numbers could do is taken out
of both. That is a score test (Rao 1948), on the errors that will judge in the end; it holds for
models with effects too, and tells which two effects help only together.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares, lsq_linear

from robustpolish.base.arrays import Array
from robustpolish.base.budget import parallel_map
from robustpolish.identification.fit.least_squares import (
    Fit,
    Residuals,
    fit,
    normal_of,
    windows_from_stage,
)
from robustpolish.identification.fit.parameters import free_parameters
from robustpolish.identification.fit.prepared import PreparedRecord
from robustpolish.identification.structure.screening import (
    CandidateColumns,
    candidate_columns,
    mutually_exclusive,
)
from robustpolish.machines.effects.effect import Effect, kinds
from robustpolish.machines.effects.evaluate import MOST_SUBSTEPS, force_with
from robustpolish.machines.effects.kind import EffectKind, Motion, Shape
from robustpolish.machines.mechanical.data import motion_at
from robustpolish.machines.mechanical.model import MechanicalModel

_TINY = 1e-4
"""Size of a candidate on trial, as a share of the forces."""
_DIVERGED = 1e100
"""Changes of the errors, in units of these, from which a run says nothing."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """What one effect or two would do to the errors of free runs.

    Attributes
    ----------
    entries : tuple of Columns
    effects : tuple of Effect
        With first values.
    fall : float
        Share of the error that they would take away.
    odds : float
        Half the fall of the Bayesian information criterion.
    """

    entries: tuple[CandidateColumns, ...]
    effects: tuple[Effect, ...]
    fall: float
    odds: float

    @property
    def places(self) -> tuple[tuple[str, tuple[str, ...]], ...]:
        """Kinds and places."""
        return tuple((e.kind, e.at) for e in self.effects)


def evidence(
    stage: Fit,
    prepared: PreparedRecord,
    entries: Sequence[CandidateColumns],
    span: int,
    in_part: bool = False,
) -> tuple[list[Evidence], list[Evidence]]:
    """Return what single effects and pairs would do to runs over windows, the best first.

    Parameters
    ----------
    stage : Fit
        The model as it is.
    prepared : PreparedRecord
    entries : sequence of Columns
        Candidates with shapes from screening.
    span : int
        Samples of the windows.
    in_part : bool, optional
        Whether a kind with a part that pulls the wrong way is judged by the rest of it; it is left
        out otherwise.
    """
    model = stage.model
    windows = windows_from_stage(model, prepared, prepared.trial, span, stage)
    free = free_parameters(model, prepared.scales.bandwidth, prepared.policy, model)
    runner = prepared.runner(model)
    sizes = prepared.sizes(model) if windows[0].start.vector.size else None
    settled = fit(Residuals(model, windows, runner, free, sizes), 3)
    if not (entries and np.isfinite(settled.cost)):
        return [], []
    here = free_parameters(settled.model, prepared.scales.bandwidth, prepared.policy, model)
    residuals = Residuals(settled.model, settled.pieces, runner, here, sizes)
    normal = normal_of(residuals, settled.errors, settled.sigma)
    rest = normal.without_nuisance((settled.errors / settled.sigma).ravel()[:, None])[:, 0]
    total = float(rest @ rest)
    force = float(np.mean(prepared.scales.force)) or 1.0

    def column(task: tuple[int, int]) -> Array:
        """Change of the errors for a unit of one coefficient."""
        entry, j = entries[task[0]], task[1]
        size = float(np.sqrt(np.mean(entry.shape.columns[j] ** 2)))
        target = force if entry.rows is not None else float(np.std(entry.shape.columns[j]))
        unit = np.zeros(len(entry.shape.columns))
        unit[j] = _TINY * target / size if size > 0 else 0.0
        if not unit[j]:
            return np.zeros(rest.size)
        values = entry.shape.values(unit)
        extended = settled.model.with_effect(entry.kind, entry.at, values)
        run = prepared.runner(extended).run(extended)
        pieces = prepared.with_propagated_memory(extended, settled.pieces)
        change = (run.all_errors(pieces) - settled.errors) / settled.sigma / unit[j]
        known = np.nan_to_num(change.ravel(), nan=0.0, posinf=0.0, neginf=0.0)
        return known if np.max(np.abs(known)) < _DIVERGED else np.zeros(rest.size)

    tasks = [(i, j) for i, entry in enumerate(entries) for j in range(len(entry.shape.columns))]
    raw = np.array(parallel_map(column, tasks)).reshape(len(tasks), -1).T
    C = normal.without_nuisance(raw)
    before, after = np.sum(raw**2, axis=0), np.sum(C**2, axis=0)
    hidden = after < 1e-6 * np.maximum(before, 1e-300)
    gram, target = C.T @ C, -C.T @ rest
    of: dict[int, list[int]] = {}
    for k, (i, _) in enumerate(tasks):
        if before[k] > 0:  # some coefficients are for screening only, no number follows from them
            of.setdefault(i, []).append(k)
    samples = rest.size

    def judged(which: tuple[int, ...]) -> Evidence | None:
        rows = [k for i in which for k in of.get(i, ())]
        if not all(i in of for i in which) or hidden[rows].any():
            return None
        signs = [entries[tasks[k][0]].shape.signs[tasks[k][1]] for k in rows]
        c = _coefficients(gram[np.ix_(rows, rows)], target[rows], signs)
        kept = any if in_part else all
        if not all(kept(c[rows.index(k)] != 0 for k in of[i]) for i in which):
            return None
        fall = float(c @ target[rows])
        effects = []
        for i in which:
            entry = entries[i]
            own = np.zeros(len(entry.shape.columns))
            for k in of[i]:
                own[tasks[k][1]] = c[rows.index(k)]
            values = dict(entry.shape.values(own))
            for name, value in values.items():
                parameter = entry.kind.parameter(name)
                values[name] = float(np.clip(value, parameter.lower, parameter.upper))
            effects.append(Effect.of(entry.kind, entry.at, values))
        left = max(total - fall, 1e-12 * total)
        odds = 0.5 * samples * np.log(total / left) - 0.5 * len(rows) * np.log(samples)
        share = 1 - float(np.sqrt(left / total))
        return Evidence(tuple(entries[i] for i in which), tuple(effects), share, float(odds))

    singles: dict[tuple[tuple[str, tuple[str, ...]], ...], tuple[int, Evidence]] = {}
    for i in range(len(entries)):
        found = judged((i,))
        if found is None:
            continue
        key = found.places
        if key not in singles or found.odds > singles[key][1].odds:
            singles[key] = (i, found)
    # a partner may do nothing alone, or pull the wrong way: its first shape stands for it
    chosen: dict[tuple[str, tuple[str, ...]], int] = {}
    for i, entry in enumerate(entries):
        chosen.setdefault((entry.kind.kind, entry.at), i)
    chosen |= {key[0]: i for key, (i, _) in singles.items()}
    pairs = [judged(couple) for couple in itertools.combinations(chosen.values(), 2)]
    ranked = sorted((found for _, found in singles.values()), key=lambda e: -e.odds)
    return ranked, sorted((pair for pair in pairs if pair is not None), key=lambda e: -e.odds)


def _coefficients(gram: Array, target: Array, signs: Sequence[int]) -> Array:
    """Return the coefficients of the required signs that take away most; 0 where a sign is wrong.

    What a friction has more at rest than in motion may pull the wrong way while there is no
    friction at all, or while its corners are too sharp; beside the other coefficients its kind may
    be the right one all the same.

    Parameters
    ----------
    gram : ndarray, shape (n, n)
    target : ndarray, shape (n,)
    signs : sequence of int
        +1, -1, or 0 for either.
    """
    size = np.sqrt(np.diag(gram))
    scaled = gram / np.outer(size, size)
    c = np.linalg.lstsq(scaled, target / size, rcond=1e-6)[0]
    if np.any(np.array(signs) * c < 0):
        values, vectors = np.linalg.eigh(scaled)
        kept = values > 1e-6 * values[-1]
        root = np.sqrt(values[kept])[:, None] * vectors[:, kept].T
        bounds = [(0.0 if s > 0 else -np.inf, 0.0 if s < 0 else np.inf) for s in signs]
        right = (vectors[:, kept].T @ (target / size)) / np.sqrt(values[kept])
        c = lsq_linear(root, right, bounds=tuple(np.transpose(bounds)), method="bvls").x
    return c / size


# Replacement by another kind, begun with the numbers that make the same force.
#
# Where a kind was found that is not quite the right one, the right one makes nearly the same force
# along the same motion. From there a fit has a short way, with all other numbers as they are; begun
# beside a machine without any such force, whose springs had to do its work, it may end elsewhere.

_STARTS, _EVALUATIONS, _STEP = 3, 30, 1e-4
"""Shapes of screening from which a fit of the force begins, its most runs, and its step."""
_MIMIC_DIVERGED = 1e3
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
    """Return the rivals of an effect of a fitted model, as near to its force as they get.

    Parameters
    ----------
    model : MechanicalModel
    at : int
        Where the effect stands.
    prepared : PreparedRecord

    Returns
    -------
    list of Mimic
        The nearest first; without what makes the effect's own force by another name.
    """
    effect = model.effects[at]
    bare = replace(model, effects=(*model.effects[:at], *model.effects[at + 1 :]))
    motion = prepared.motion(model, prepared.screened)
    if not np.isfinite(motion.q).all():  # which no observer can follow
        motion = prepared.motion(bare, prepared.screened)
    # a law that is stiffer than any step can follow is told that step, or its force overflows
    step = prepared.record.dt / MOST_SUBSTEPS
    here = motion_at(model, effect, prepared.screened.time, motion.q, motion.v, step)
    wanted = force_with(effect.definition, effect.values, here)
    if not wanted.any():
        return []
    found = []
    for kind, given in _alternative_kinds(effect, here):
        shapes = candidate_columns(bare, kind, effect.at, motion, prepared.screened)
        begun = _initial_values(
            kind, [entry.shape for entry in shapes], effect.at, given, here, wanted
        )
        fits = [_fit_force(kind, values, here, wanted) for values in begun[:_STARTS]]
        if fits:
            left, values = min(fits, key=lambda pair: pair[0])
            found.append(ForceEquivalent(Effect.of(kind, effect.at, values), left))
    return sorted(found, key=lambda mimic: mimic.left)


def _alternative_kinds(
    effect: Effect, here: Motion
) -> Iterator[tuple[EffectKind, Mapping[str, float]]]:
    """Yield the kinds that may stand for one, with every choice that no fit makes.

    What turns over gently goes on to do so.
    """
    own = effect.definition
    for kind in kinds().values():
        if kind.kind != own.kind and not mutually_exclusive(kind, own):
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
            left = float(np.sum((force_with(kind, values, here) - wanted) ** 2))
            found.append((left, values))
    return [values for _, values in sorted(found, key=lambda pair: pair[0])]


def _fit_force(
    kind: EffectKind, values: Mapping[str, float], here: Motion, wanted: Array
) -> tuple[float, dict[str, float]]:
    """Return the share of a force that a kind leaves at best, and its values."""
    numbers = [p for p in kind.parameters if p.fitted]
    first = np.array([values[p.name] for p in numbers])
    sizes = np.array([p.scale_from(values[p.name], values) for p in numbers])
    lower, upper = np.array([(p.lower, p.upper) for p in numbers]).T
    positive = (lower >= 0) & (first > 0)
    size = float(np.sqrt(np.mean(wanted**2)))

    def read(x: Array) -> dict[str, float]:
        """Return the first values, moved by x - 1: in logarithms, or in their sizes."""
        with np.errstate(over="ignore"):  # beyond doubles is beyond all bounds, too
            moved = np.where(positive, first * np.exp(x - 1), first + (x - 1) * sizes)
        told = np.clip(moved, lower, upper).tolist()
        return {**values, **dict(zip((p.name for p in numbers), told, strict=True))}

    def errors(x: Array) -> Array:
        off = (force_with(kind, read(x), here) - wanted).ravel() / size
        return np.clip(np.nan_to_num(off, nan=_MIMIC_DIVERGED), -_MIMIC_DIVERGED, _MIMIC_DIVERGED)

    # steps of the slopes are shares of x, so that x begins at 1
    found = least_squares(errors, np.ones(len(numbers)), diff_step=_STEP, max_nfev=_EVALUATIONS)
    return float(np.sqrt(2 * found.cost / wanted.size)), read(found.x)
