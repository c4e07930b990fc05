"""Laws that no catalogue holds, learned as curves.

At every place a curve over the displacement, one over the velocity, both, and a surface over the
two, or a stiffness and a damping that vary with time, are fitted to the innovations of an observer.
The columns of B-splines along the smoothed motion go through the same filter as every candidate of
a screening. Their second differences are expected to be normal; how large they are is what makes
the innovations likeliest (restricted maximum likelihood, as for the variances of a mixed model:
Ruppert, Wand, Carroll 2003, Semiparametric Regression, chapter 4). The likeliest laws go into the
model as effects like any other, are refitted by free runs, and compared by the score of every set.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from robustpolish.base.arrays import Array
from robustpolish.identification.fit.least_squares import short_window_log_error
from robustpolish.identification.fit.prepared import PreparedRecord
from robustpolish.identification.observer.starts import SmoothedMotion, motion_of
from robustpolish.identification.policy import STRONG
from robustpolish.identification.record import Record
from robustpolish.identification.search.score import ScoredModel, nats, simplest_of_best
from robustpolish.identification.search.screening import FilteredRecord, places
from robustpolish.identification.search.search import EffectSearch
from robustpolish.machines.effects.effect import Effect, lookup
from robustpolish.machines.effects.spline_law import (
    Over,
    coefficients_of,
    learned_name,
    smoothness_prior,
    spline_basis,
    spline_centres,
)
from robustpolish.machines.mechanical.data import port_row
from robustpolish.machines.mechanical.model import MechanicalModel

LawKinds = tuple[Over | Literal["dry"], ...]
CURVES: tuple[LawKinds, ...] = (
    ("stiffness",),
    ("damping",),
    ("stiffness", "dry"),
    ("stiffness", "damping"),
)
"""What is tried at every place: one curve or two. Dry friction stands beside one over the
displacement because no smooth curve jumps as it does."""
KINDS: tuple[LawKinds, ...] = (*CURVES, ("force",))
"""All of these, and a force over displacement and velocity at once, which can be anything."""
OVER_TIME: tuple[LawKinds, ...] = (("varying_stiffness",), ("varying_damping",))
"""What is tried where no law of the motion explains what is left."""

_COEFFICIENTS, _ACROSS, _MOST = 11, 7, 60
"""Coefficients of a curve, of a surface in each direction, and of a curve at most."""
_ODDS, _NEAR, _REFITS = 12.0, 0.6, 4
"""Log odds from which a law is worth a refit, share of the best odds below which it is no rival,
and laws that are refitted at most: one with twenty coefficients costs seconds."""
_SHARES = (1.0, 0.5, 0.25, 0.0)
"""Of a curve with which its refit may begin: free runs of a steep one may diverge."""
_NARROW = 0.05
"""Share of a range by which the ends of knots may be off it."""
_DRY, _TURNS_OVER = "coulomb_friction", 0.02
"""Dry friction, and the share of the speed over which it turns over, as screening has it."""
_PENALTY_GRID = np.geomspace(1e-9, 1e3, 37)
"""What is tried for the price of bending, in units in which data and bending weigh alike."""
_HOLD = 1e-9
"""Share of the information that holds what neither data nor bending determines."""


def learn(run: EffectSearch, kinds: Sequence[LawKinds], noise: Array) -> ScoredModel | None:
    """Learn the law that explains best what the refitted model leaves.

    Parameters
    ----------
    run : EffectSearch
    kinds : sequence of tuple
        What is tried at every place: `KINDS`, `CURVES` or `OVER_TIME`.
    noise : ndarray, shape (ny,)
        Of each output, of whatever colour.

    Returns
    -------
    ScoredModel or None
        The model with the laws, one or two at one place. Its springs and dampers stay as they were
        given where a law contains them. None if no law is better by very strong evidence.
    """
    at_floor = replace(run.prepared, scales=replace(run.prepared.scales, noise=noise))
    ranked = _rank_laws(run, at_floor, kinds)
    least = max(_ODDS, _NEAR * ranked[0].odds) if ranked else np.inf
    found: list[ScoredModel] = []
    for law in [law for law in ranked if law.odds >= least][:_REFITS]:
        names = " and ".join(e.definition.title for e in law.effects)
        run.say(f"refit with a learned law: {names} at {', '.join(law.effects[0].at)}")
        fitted = _refitted(run, law)
        if fitted is not None and nats(fitted, run.base) > STRONG:
            found.append(fitted)
    return _with_suitable_knots(run, simplest_of_best(found, run.base)) if found else None


class _RankedLaw(NamedTuple):
    """Laws at a place, their log odds, and the model beside which they are likeliest."""

    odds: float
    effects: tuple[Effect, ...]
    beside: MechanicalModel


def _rank_laws(
    run: EffectSearch, prepared: PreparedRecord, kinds: Sequence[LawKinds]
) -> list[_RankedLaw]:
    """Return laws by their log odds, the best of each place and kind, the best first.

    They are tried beside the refitted numbers and beside those that were given: without the law, a
    fit may have bent them far off.
    """
    policy, record, found = prepared.policy, prepared.screened, []
    looks = []
    for model in (run.base.model, run.reference):
        motion = prepared.motion(model, record)
        seen = [FilteredRecord(model, prepared, record, at, motion) for at in policy.shape_levels]
        looks.append((model, motion, seen))
    null = min(
        min(f.null_scores(policy.noise_orders).values()) for _, _, seen in looks for f in seen
    )
    for at in places(run.reference, lookup("cubic_stiffness")):
        for over in kinds:
            tried = []
            for model, motion, seen in looks:
                blocks = [_columns(model, at, each, motion, record) for each in over]
                made = [b for b in blocks if b is not None]
                if len(made) == len(blocks):
                    row = port_row(model, at)
                    tried += [(*_fit_curves(f, row, made), model) for f in seen]
            # dry friction does not push
            sound = [
                t for t in tried if np.isfinite(t[0]) and all(_pulls(effect) for effect in t[1])
            ]
            if sound:
                score, effects, model = min(sound, key=lambda t: t[0])
                found.append(_RankedLaw((null - score) / 2, effects, model))
    return sorted(found, key=lambda law: -law.odds)


def _pulls(effect: Effect) -> bool:
    return effect.kind != _DRY or effect.values["force"] > 0


@dataclass(frozen=True, eq=False)
class LawColumns:
    """The splines of one law along a motion.

    Attributes
    ----------
    effect : Effect
        With its knots, and a coefficient of 0 for every spline.
    columns : ndarray, shape (coefficients, 1, samples)
        Force on the first coordinate for a unit of each coefficient.
    bending : ndarray, shape (rows, coefficients)
    """

    effect: Effect
    columns: Array
    bending: Array


def _columns(
    model: MechanicalModel,
    at: tuple[str, ...],
    over: Over | Literal["dry"],
    motion: SmoothedMotion,
    record: Record,
) -> LawColumns | None:
    """Return the splines of a law at a place, None if nothing moves there or a law is there."""
    row = port_row(model, at)
    q, v = row @ motion.q, row @ motion.v
    if not (np.ptp(q) > 0 and np.ptp(v) > 0 and np.isfinite(q + v).all()):
        return None
    here = [e for e in model.effects if set(e.at) == set(at)]
    if over == "dry":
        width = _TURNS_OVER * float(np.percentile(np.abs(v), 95))
        if any(e.kind == _DRY for e in here) or not width > 0:
            return None
        effect = Effect(_DRY, at, {"force": 0.0, "width": width})
        return LawColumns(effect, -np.tanh(v / width)[None, None], np.zeros((0, 1)))
    count = _ACROSS if over == "force" else _COEFFICIENTS
    varies = over in ("varying_stiffness", "varying_damping")
    x = record.time if varies else v if over == "damping" else q
    seen = record.times if varies else x  # what changes along the record does so over all of it
    knots = {"low": float(seen.min()), "high": float(seen.max())}
    basis = spline_basis(x, knots["low"], knots["high"], count, over not in ("stiffness", "force"))
    if over == "force":
        knots |= {"slow": float(v.min()), "fast": float(v.max())}
        across = spline_basis(v, knots["slow"], knots["fast"], count, True)
        basis = (basis[:, None] * across).reshape(count * count, -1)
    elif varies:
        basis = basis * (q if over == "varying_stiffness" else v)
    effect = Effect(learned_name(over, count), at, knots)
    if any({*e.definition.over} & {*effect.definition.over} for e in here):
        return None
    bending = smoothness_prior({**effect.values, "roughness": 1.0})
    return LawColumns(effect, -basis[:, None, :], bending)


def _fit_curves(
    f: FilteredRecord, row: Array, blocks: Sequence[LawColumns]
) -> tuple[float, tuple[Effect, ...]]:
    """Fit laws at one place to the innovations of one level.

    Parameters
    ----------
    f : FilteredRecord
    row : ndarray, shape (coordinates,)
        Of the place.
    blocks : sequence of LawColumns

    Returns
    -------
    score : float
        The information criterion; every coefficient counts as far as the data determine it.
    effects : tuple of Effect
    """
    columns = np.concatenate([b.columns for b in blocks])
    X = f.weighted(f.observer.respond(row[None], [blocks[0].effect.at], columns))
    NX = f.N @ X.T
    A = X @ X.T - NX.T @ f.factor @ NX
    b = X @ f.e - NX.T @ f.factor @ f.Ne
    total = float(f.e @ f.e - f.Ne @ f.factor @ f.Ne)
    weights, price = _bending_penalty(A, b, total, len(f.e), [block.bending for block in blocks])
    V = np.linalg.inv(A + price)
    c = V @ b
    rest = f.e - f.N.T @ (f.factor @ (f.Ne - NX @ c)) - X.T @ c
    rest = rest.reshape(f.errors.shape) * f.sigma
    score = min(f.scores(rest, f.policy.noise_orders).values())
    score += float(np.trace(V @ A)) * np.log(len(rest))
    variance = float(np.mean((rest / f.sigma) ** 2))
    effects, first = [], 0
    for item, weight in zip(blocks, weights, strict=True):
        last = first + item.bending.shape[1]
        law = _with_coefficients(item.effect, c[first:last])
        if len(item.bending):
            law = law.with_parameters(roughness=float(np.sqrt(variance / weight)))
        effects.append(law)
        first = last
    return float(score), tuple(effects)


def _bending_penalty(
    A: Array, b: Array, total: float, samples: int, bending: Sequence[Array]
) -> tuple[list[float], Array]:
    """Return the weight of bending of each law that makes the data likeliest, and its matrix."""
    n = len(b)
    hold = _HOLD * float(np.trace(A)) / n * np.eye(n)
    grams, ranks, units, first = [], [], [], 0
    for rows in bending:
        here = slice(first, first + rows.shape[1])
        gram = np.zeros((n, n))
        gram[here, here] = rows.T @ rows
        grams.append(gram)
        ranks.append(int(np.linalg.matrix_rank(rows)) if rows.size else 0)
        units.append(float(np.trace(A[here, here]) / (np.trace(gram) or 1.0)))
        first += rows.shape[1]

    def price(weights: Sequence[float]) -> Array:
        return hold + sum(w * gram for w, gram in zip(weights, grams, strict=True))

    def unlikely(weights: Sequence[float]) -> float:
        V = A + price(weights)
        left = max(total - float(b @ np.linalg.solve(V, b)), 1e-300)
        known = sum(r * np.log(w) for r, w in zip(ranks, weights, strict=True))
        return samples * np.log(left) + float(np.linalg.slogdet(V)[1]) - known

    weights = [unit * _PENALTY_GRID[-1] for unit in units]  # straight lines to begin with
    for _ in range(3 if len(grams) > 1 else 1):
        for k, unit in ((k, unit) for k, unit in enumerate(units) if ranks[k]):
            tried = [[*weights[:k], unit * share, *weights[k + 1 :]] for share in _PENALTY_GRID]
            weights = min(tried, key=unlikely)
    return weights, price(weights)


# Refits of models with learned laws.


def _refitted(run: EffectSearch, law: _RankedLaw) -> ScoredModel | None:
    """Return the model with laws, fitted by free runs that grow longer.

    Where the record hardly saw a curve, the whole of it may be too much for a run: it begins with
    the share of it that predicts best.
    """
    starts = []
    for share in _SHARES:
        scaled = [
            e if e.kind == _DRY else _with_coefficients(e, share * coefficients_of(e.values))
            for e in law.effects
        ]
        bare, laws = _absorb_own_parameters(scaled, law.beside, run.reference)
        begun = replace(bare, effects=(*bare.effects, *laws))
        starts.append((short_window_log_error(begun, run.prepared), bare, laws))
    _, bare, laws = min(starts, key=lambda start: start[0])
    return run.fits.grown(bare, laws)


def _absorb_own_parameters(
    effects: Sequence[Effect], model: MechanicalModel, reference: MechanicalModel
) -> tuple[MechanicalModel, tuple[Effect, ...]]:
    """Return a model whose springs and dampers at the place of laws are as they were, and the laws.

    What a fit has made of these numbers moves into the laws: the force stays the same, and the
    curves tell what the model as it was given lacks.
    """
    known, changes, moved = reference.parameters, {}, []
    for effect in effects:
        contains, place = effect.definition.contains, set(effect.at)
        springs = {
            f"spring[{i}].stiffness": s.stiffness
            for i, s in enumerate(model.springs)
            if "spring" in contains and set(s.between) == place
        }
        dampers = {
            f"damper[{i}].damping": d.damping
            for i, d in enumerate(model.dampers)
            if "damper" in contains and set(d.between) == place
        }
        k, c = (sum(v - known.get(key, v) for key, v in m.items()) for m in (springs, dampers))
        changes |= {key: known[key] for key in (*springs, *dampers) if key in known}
        moved.append(_steeper(effect, k, c) if contains else effect)
    return model.with_parameters(changes), tuple(moved)


def _steeper(effect: Effect, stiffness: float, damping: float) -> Effect:
    """Return a law with the force of a spring and of a damper added."""
    values, kind = effect.values, effect.definition
    ends = list(values.values())
    c = coefficients_of(values)
    if c.ndim == 2:
        along, across = (spline_centres(ends[n], ends[n + 1], len(c)) for n in (0, 2))
        return _with_coefficients(effect, c + stiffness * along[:, None] + damping * across)
    slope = stiffness if "spring" in kind.contains else damping
    varies = kind.over == ("time",)
    added = slope * (1.0 if varies else spline_centres(ends[0], ends[1], len(c)))
    return _with_coefficients(effect, c + added)


def _with_coefficients(effect: Effect, c: Array) -> Effect:
    """Return a law with other fitted numbers."""
    names = [p.name for p in effect.definition.parameters if p.fitted]
    return effect.with_parameters(**dict(zip(names, c.ravel().tolist(), strict=True)))


def _with_suitable_knots(run: EffectSearch, scored: ScoredModel) -> ScoredModel:
    """Return a model whose curves have their knots where it moves, as close as the data ask for.

    Before the law was known, a place may have seemed to move farther than it does: what a curve
    does there nobody has seen. What a curve leaves whose knots are too far apart looks like noise
    of some colour, so knots are halved as long as the score rises.
    """
    there = _with_other_knots(run, scored, 1)
    if there is not None and nats(scored, there) < STRONG:
        scored = there
    while not run.at_noise_floor(scored):
        finer = _with_other_knots(run, scored, 2)
        if finer is None or nats(finer, scored) <= 0:
            break
        scored = finer
    return scored


def _with_other_knots(run: EffectSearch, scored: ScoredModel, times: int) -> ScoredModel | None:
    """Return a model with its curves' knots so many times as close, over the motion of its own.

    None if no knot is another one, or no fit ended well.
    """
    prepared, model, effects = run.prepared, scored.model, list(scored.model.effects)
    pieces = prepared.everything if scored.fitted.reproducible else prepared.windows
    own, started = prepared.run_with_fitted_starts(model, pieces)
    signals = np.concatenate([own.runner.inputs(model, piece.record) for piece in started])
    motion = motion_of(model, own.over_all(started, keep=True).states, signals)
    for i, effect in enumerate(effects):
        over = effect.definition.over
        if len(over) == 1:
            q, v = (port_row(model, effect.at) @ part for part in motion)
            x = {"displacement": q, "velocity": v}.get(over[0], prepared.record.times)
            effects[i] = _resampled(effect, float(x.min()), float(x.max()), times)
    if all(new is old for new, old in zip(effects, model.effects, strict=True)):
        return None
    return run.fits.near(replace(model, effects=tuple(effects)))


def _resampled(effect: Effect, low: float, high: float, times: int) -> Effect:
    """Return a curve with knots so many times as close over a range; itself if that is none."""
    values = effect.values
    c, off = coefficients_of(values), _NARROW * (high - low)
    count = times * (c.size - 3) + 3
    same = abs(values["low"] - low) <= off and abs(values["high"] - high) <= off
    if not high > low or count > _MOST or (times == 1 and same):
        return effect
    stays = effect.definition.over != ("displacement",)
    grid = np.linspace(low, high, 8 * count)
    curve = c @ spline_basis(grid, values["low"], values["high"], c.size, stays)
    basis = spline_basis(grid, low, high, count, stays)
    finer = np.asarray(np.linalg.lstsq(basis.T, curve, rcond=None)[0], dtype=float)
    step = (high - low) / (count - 3) / ((values["high"] - values["low"]) / (c.size - 3))
    knots = {"low": low, "high": high, "roughness": values["roughness"] * step}
    kind = f"{effect.kind.rpartition('_')[0]}_{count}"
    return _with_coefficients(Effect(kind, effect.at, knots), finer)
