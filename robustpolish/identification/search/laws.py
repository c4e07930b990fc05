"""Laws that no catalogue holds, learned as curves."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
import xarray as xr

from robustpolish.base.arrays import Array
from robustpolish.identification.diagnosis.findings import learned_laws_of
from robustpolish.identification.fit.least_squares import (
    EvaluatedFit,
    Fit,
    best_stage,
    covariance_of,
    free_run_rms,
    free_run_rms_checked,
    homotopy,
    short_window_rms,
)
from robustpolish.identification.fit.prepared import PreparedRecord
from robustpolish.identification.observer.missing_force import SmoothedMotion, motion_of
from robustpolish.identification.record import Record
from robustpolish.identification.residual_tests import residual_noise_floor
from robustpolish.identification.search.screening import FilteredRecord, places
from robustpolish.machines.effects.effect import Effect, lookup
from robustpolish.machines.effects.learned_law import LearnedLaw
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

# Penalised splines in the innovations of an observer.
#
# The columns of B-splines along the smoothed motion go through the same filter as every candidate
# of a screening. Their second differences are expected to be normal; how large they are is what
# makes the innovations likeliest (restricted maximum likelihood, as for the variances of a mixed
# model: Ruppert, Wand, Carroll 2003, Semiparametric Regression, chapter 4).

_PENALTY_GRID = np.geomspace(1e-9, 1e3, 37)
"""What is tried for the price of bending, in units in which data and bending weigh alike."""
DRY = "coulomb_friction"
_TURNS_OVER = 0.02
"""Share of the speed over which dry friction turns over, as screening has it."""
_HOLD = 1e-9
"""Share of the information that holds what neither data nor bending determines."""


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


@dataclass(frozen=True, eq=False)
class CurveFit:
    """Laws at one place, as the innovations of one level show them.

    Attributes
    ----------
    effects : tuple of Effect
    score : float
        The information criterion; every coefficient counts as far as the data determine it.
    freedom : float
        How many coefficients that are.
    fall : float
        Share by which the innovations fell.
    """

    effects: tuple[Effect, ...]
    score: float
    freedom: float
    fall: float

    @property
    def at(self) -> tuple[str, ...]:
        """The place."""
        return self.effects[0].at

    @property
    def laws(self) -> tuple[Effect, ...]:
        """Those that are curves."""
        return tuple(e for e in self.effects if e.kind != DRY)

    @property
    def others(self) -> tuple[Effect, ...]:
        """Dry friction beside them, if any."""
        return tuple(e for e in self.effects if e.kind == DRY)

    def within(self, other: CurveFit) -> bool:
        """Return whether the laws of another one at the same place are these, and more."""
        these, those = ({e.definition.over for e in each.effects} for each in (self, other))
        return self.at == other.at and these < those

    @property
    def sensible(self) -> bool:
        """Whether dry friction does not push."""
        return all(e.values["force"] > 0 for e in self.others)


def dry_friction_block(
    model: MechanicalModel, at: tuple[str, ...], motion: SmoothedMotion
) -> LawColumns | None:
    """Return dry friction at a place as a law with one coefficient, None if nothing moves there.

    Parameters
    ----------
    model : MechanicalModel
    at : tuple of str
    motion : SmoothedMotion
    """
    v = port_row(model, at) @ motion.v
    width = _TURNS_OVER * float(np.percentile(np.abs(v), 95))
    if not (width > 0 and np.isfinite(width)):
        return None
    effect = Effect(DRY, at, {"force": 0.0, "width": width})
    return LawColumns(effect, -np.tanh(v / width)[None, None], np.zeros((0, 1)))


def block(
    model: MechanicalModel,
    at: tuple[str, ...],
    over: Over,
    count: int,
    motion: SmoothedMotion,
    record: Record,
) -> LawColumns | None:
    """Return the splines of a law at a place, None if nothing moves there.

    Parameters
    ----------
    model : MechanicalModel
    at : tuple of str
    over : {"stiffness", "damping", "force", "varying_stiffness", "varying_damping"}
    count : int
        Of coefficients, in each direction.
    motion : SmoothedMotion
    record : Record
        The part that moved so: what changes along the record does so over the whole of it.
    """
    row = port_row(model, at)
    q, v = row @ motion.q, row @ motion.v
    if not (np.ptp(q) > 0 and np.ptp(v) > 0 and np.isfinite(q + v).all()):
        return None
    varies = over in ("varying_stiffness", "varying_damping")
    x = record.time if varies else v if over == "damping" else q
    seen = record.times if varies else x
    knots = {"low": float(seen.min()), "high": float(seen.max())}
    basis = spline_basis(x, knots["low"], knots["high"], count, over not in ("stiffness", "force"))
    if over == "force":
        knots |= {"slow": float(v.min()), "fast": float(v.max())}
        across = spline_basis(v, knots["slow"], knots["fast"], count, True)
        basis = (basis[:, None] * across).reshape(count * count, -1)
    elif over == "varying_stiffness":
        basis = basis * q
    elif over == "varying_damping":
        basis = basis * v
    effect = Effect(learned_name(over, count), at, knots)
    bending = smoothness_prior({**effect.values, "roughness": 1.0})
    return LawColumns(effect, -basis[:, None, :], bending)


def fit_curves(f: FilteredRecord, row: Array, blocks: Sequence[LawColumns]) -> CurveFit:
    """Fit laws at one place to the innovations of one level.

    Parameters
    ----------
    f : FilteredRecord
    row : ndarray, shape (coordinates,)
        Of the place.
    blocks : sequence of LawColumns
    """
    columns = np.concatenate([b.columns for b in blocks])
    at = blocks[0].effect.at
    X = f.weighted(f.observer.respond(row[None], [at], columns))
    NX = f.N @ X.T
    A = X @ X.T - NX.T @ f.factor @ NX
    b = X @ f.e - NX.T @ f.factor @ f.Ne
    total = float(f.e @ f.e - f.Ne @ f.factor @ f.Ne)
    priced = _select_bending_penalty(A, b, total, len(f.e), [block.bending for block in blocks])
    V = np.linalg.inv(A + priced.price)
    c = V @ b
    freedom = float(np.trace(V @ A))
    rest = f.e - f.N.T @ (f.factor @ (f.Ne - NX @ c)) - X.T @ c
    rest = rest.reshape(f.errors.shape) * f.sigma
    before = f.residual(None)[0]
    scores = f.scores(rest, 0, f.policy.noise_orders)
    score = min(scores.values()) + freedom * np.log(len(rest))
    fall = 1 - float(np.min(np.std(rest, axis=0) / np.std(before, axis=0)))
    variance = float(np.mean((rest / f.sigma) ** 2))
    effects, first = [], 0
    for item, weight in zip(blocks, priced.weights, strict=True):
        last = first + item.bending.shape[1]
        law = with_coefficients(item.effect, c[first:last])
        if len(item.bending):
            law = law.with_parameters(roughness=float(np.sqrt(variance / weight)))
        effects.append(law)
        first = last
    return CurveFit(tuple(effects), float(score), freedom, fall)


@dataclass(frozen=True, eq=False)
class _BendingPenalty:
    weights: tuple[float, ...]
    price: Array


def _select_bending_penalty(
    A: Array, b: Array, total: float, samples: int, bending: Sequence[Array]
) -> _BendingPenalty:
    """Return the price of bending that makes the data likeliest, one weight for each law."""
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
    return _BendingPenalty(tuple(weights), price(weights))


def absorb_own_parameters(
    effects: Sequence[Effect], model: MechanicalModel, reference: MechanicalModel
) -> tuple[MechanicalModel, tuple[Effect, ...]]:
    """Return a model whose springs and dampers at the place of laws are as they were, and the laws.

    What a fit has made of these numbers moves into the laws: the force stays the same, and the
    curves tell what the model as it was given lacks.

    Parameters
    ----------
    effects : sequence of Effect
        Learned laws at one place.
    model, reference : MechanicalModel
        Fitted, and before any fit.
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
        moved.append(_steeper(effect, k, c))
    return model.with_parameters(changes), tuple(moved)


def _steeper(effect: Effect, stiffness: float, damping: float) -> Effect:
    """Return a law with the force of a spring and of a damper added."""
    values, kind = effect.values, effect.definition
    ends = list(values.values())
    c = coefficients_of(values)
    if c.ndim == 2:
        along, across = (spline_centres(ends[n], ends[n + 1], len(c)) for n in (0, 2))
        added = c + stiffness * along[:, None] + damping * across
    else:
        slope = stiffness if "spring" in kind.contains else damping
        varies = kind.over == ("time",)
        added = c + slope * (1.0 if varies else spline_centres(ends[0], ends[1], len(c)))
    return with_coefficients(effect, added.ravel())


def with_coefficients(effect: Effect, c: Array) -> Effect:
    """Return a law with other fitted numbers."""
    names = [p.name for p in effect.definition.parameters if p.fitted]
    return effect.with_parameters(**dict(zip(names, c.tolist(), strict=True)))


# Refits of models with learned laws, over windows that grow, with closer knots.


@dataclass(frozen=True)
class LearnPolicy:
    """What the learning of laws goes by.

    Attributes
    ----------
    first : int
        Coefficients of a curve at the first look at every place.
    counts : tuple of int
        What is tried at the best places: a law with corners needs closer knots, and the price of
        bending keeps smooth ones smooth.
    across : tuple of int
        The same in each direction of a surface, whose coefficients are as many as the square.
    samples : int
        Least samples for each coefficient: fewer say nothing about it.
    odds : float
        Log odds from which a law is worth a refit, as of a named effect.
    refits : int
        Most laws that are refitted: a refit with twenty coefficients costs seconds.
    near : float
        Share of the best odds below which a law is no rival.
    simpler : float
        Log odds that closer knots have to bring.
    better : float
        Log of the held-out error that a law has to bring to stand before one with higher odds.
    steps : int
        Most steps of a stage, each of which runs the model once for every coefficient.
    shares : tuple of float
        Of a curve with which its refit may begin: free runs of a steep one may diverge ("saturating
        spring, accelerations").
    rest : float
        Times the noise up to which white noise alone is left. Above it closer knots are tried: a
        regression on the smoothed motion does not see corners that a free run feels ("dead zone and
        friction").
    closest : int
        Most coefficients of a curve.
    narrow : float
        Share of a range by which the ends of knots may be off it.
    fall : float
        Share by which the held-out error has to fall for a law to earn its place.
    explains : float
        Times the noise up to which a law explains what was left.
    """

    first: int = 11
    counts: tuple[int, ...] = (8, 15, 25)
    across: tuple[int, ...] = (7,)
    samples: int = 20
    odds: float = 12.0
    refits: int = 3
    near: float = 0.6
    simpler: float = 6.0
    better: float = 0.02
    steps: int = 7
    shares: tuple[float, ...] = (1.0, 0.5, 0.25, 0.0)
    rest: float = 1.1
    closest: int = 60
    narrow: float = 0.05
    fall: float = 0.1
    explains: float = 1.5


LEARNING = LearnPolicy()
"""What `learn` goes by."""


def mean_log_error(error: Array) -> float:
    """Return the mean log of the errors of all outputs: what a fit makes small."""
    return float(np.mean(np.log(error)))


def held_out(model: MechanicalModel, prepared: PreparedRecord) -> Array:
    """Return the held-out error of a model, of short runs where whole ones judge nothing."""
    error, predictable = free_run_rms_checked(model, prepared, prepared.held_out)
    if predictable:
        return error
    return short_window_rms(model, prepared, prepared.held_out)


def fit_with_laws(
    model: MechanicalModel,
    curves: CurveFit,
    prepared: PreparedRecord,
    reference: MechanicalModel,
) -> EvaluatedFit | None:
    """Return the model with the laws, fitted by free runs that grow longer.

    Where the record hardly saw a curve, the whole of it may be too much for a run: it begins with
    the share of it that predicts best.
    """
    spans = prepared.spans(prepared.trial, prepared.policy.growth)
    starts = []
    for share in LEARNING.shares:
        effects = [
            with_coefficients(e, share * coefficients_of(e.values).ravel()) for e in curves.laws
        ]
        start, laws = absorb_own_parameters(effects, model, reference)
        extended = replace(start, effects=(*start.effects, *laws, *curves.others))
        error = short_window_rms(extended, prepared, prepared.trial)
        starts.append((float(np.sum(np.log(np.nan_to_num(error, nan=np.inf)))), share, extended))
    extended = min(starts, key=lambda item: (item[0], -item[1]))[2]
    stages = homotopy(extended, prepared, prepared.trial, reference, spans, LEARNING.steps)
    return best_stage(stages, prepared) if stages else None


def refine_knots(
    stage: EvaluatedFit,
    first: int,
    prepared: PreparedRecord,
    reference: MechanicalModel,
    white: Array,
) -> EvaluatedFit:
    """Return a stage with twice as close knots, over the motion that its model now shows.

    As long as more than white noise is left and the held-out error falls: what a curve leaves
    whose knots are too far apart looks like noise of some colour.

    Parameters
    ----------
    stage : EvaluatedFit
    first : int
        From which effect on laws are concerned.
    prepared : PreparedRecord
    reference : MechanicalModel
    white : ndarray, shape (ny,)
        Noise of the sensors if it has no colour.
    """
    while np.any(stage.error > LEARNING.rest * white):
        finer = _with_other_knots(stage, first, with_halved_spacing, prepared, reference, 2)
        if (
            finer is None
            or mean_log_error(finer.error) > mean_log_error(stage.error) - LEARNING.better
        ):
            break
        stage = finer
    return stage


def with_knots_over_motion(
    stage: EvaluatedFit, first: int, prepared: PreparedRecord, reference: MechanicalModel
) -> EvaluatedFit:
    """Return a stage whose curves have their knots where its model moves.

    Before it was known, a place may have seemed to move farther than it does: what a curve does
    there nobody has seen. As many knots, if they do as well.

    Parameters
    ----------
    stage : EvaluatedFit
    first, prepared, reference
        As of :func:`refine_knots`.
    """

    def as_many(effect: Effect, low: float, high: float) -> Effect:
        values, narrow = effect.values, LEARNING.narrow * (high - low)
        if abs(values["low"] - low) <= narrow and abs(values["high"] - high) <= narrow:
            return effect
        return resampled_spline(effect, low, high, coefficients_of(values).size)

    other = _with_other_knots(stage, first, as_many, prepared, reference, 1)
    if other is None or mean_log_error(other.error) > mean_log_error(stage.error) + LEARNING.better:
        return stage
    return other


def _simulated_motion(stage: EvaluatedFit, prepared: PreparedRecord) -> tuple[Array, Array]:
    """Return displacements and velocities of a model's own runs, shape (coordinates, samples)."""
    model, pieces = stage.model, prepared.everything if stage.reproducible else prepared.windows
    run, started = prepared.run_with_fitted_starts(model, pieces)
    signals = np.concatenate([run.runner.inputs(model, piece.record) for piece in started])
    return motion_of(model, run.over_all(started, keep=True).states, signals)


def _with_other_knots(
    stage: EvaluatedFit,
    first: int,
    knots: Callable[[Effect, float, float], Effect],
    prepared: PreparedRecord,
    reference: MechanicalModel,
    spans: int,
) -> EvaluatedFit | None:
    """Return a stage with other knots by the range of each law, fitted over the longest windows.

    The range is that of the model's own runs: smoothed accelerations wander. None if no knot is
    another one, or no fit ended well.
    """
    effects, motion = list(stage.model.effects), _simulated_motion(stage, prepared)
    for i in range(first, len(effects)):
        over = effects[i].definition.over
        if len(over) == 1:
            q, v = (port_row(stage.model, effects[i].at) @ part for part in motion)
            x = {"displacement": q, "velocity": v}.get(over[0], prepared.record.times)
            low, high = float(x.min()), float(x.max())
            effects[i] = knots(effects[i], low, high)
    model = replace(stage.model, effects=tuple(effects))
    if model == stage.model:
        return None
    last = prepared.spans(prepared.trial, prepared.policy.growth)[-spans:]
    fits = homotopy(model, prepared, prepared.trial, reference, last, LEARNING.steps, known=True)
    return best_stage(fits, prepared) if fits else None


def with_halved_spacing(effect: Effect, low: float, high: float) -> Effect:
    """Return a learned curve with twice as many stretches between knots over a range.

    The same effect if there would be too many.
    """
    count = 2 * coefficients_of(effect.values).size - 3
    return effect if count > LEARNING.closest else resampled_spline(effect, low, high, count)


def resampled_spline(effect: Effect, low: float, high: float, count: int) -> Effect:
    """Return a learned curve with so many coefficients over a range; itself if that is none."""
    values = effect.values
    if not high > low:
        return effect
    c = coefficients_of(values)
    stays = effect.definition.over != ("displacement",)
    grid = np.linspace(low, high, 8 * count)
    curve = c @ spline_basis(grid, values["low"], values["high"], c.size, stays)
    basis = spline_basis(grid, low, high, count, stays)
    finer = np.asarray(np.linalg.lstsq(basis.T, curve, rcond=None)[0], dtype=float)
    step = (high - low) / (count - 3) / ((values["high"] - values["low"]) / (c.size - 3))
    knots = {"low": low, "high": high, "roughness": values["roughness"] * step}
    kind = f"{effect.kind.rpartition('_')[0]}_{count}"
    return with_coefficients(Effect(kind, effect.at, knots), finer)


def fit_laws_to_record(
    stage: EvaluatedFit, prepared: PreparedRecord, reference: MechanicalModel
) -> Fit:
    """Return the fit to the whole record, the one to its trial pieces if that did not end well."""
    if not stage.reproducible:
        return stage.fit
    pieces = prepared.everything
    whole = prepared.spans(pieces)[-1:]
    fits = homotopy(stage.model, prepared, pieces, reference, whole, LEARNING.steps, known=True)
    before = free_run_rms(stage.model, prepared, prepared.everything)
    if not fits or mean_log_error(fits[-1].rmse) > mean_log_error(before):
        return stage.fit
    return fits[-1]


# Identification of a nonparametric force: its place, its arguments, its curve.
#
# At every place a curve over the displacement, one over the velocity, both, and a surface over the
# two are fitted to the innovations, or a stiffness and a damping that vary with
# time; the information criterion says which explains best what is left, beside the numbers of the
# refitted model or beside those that were given. The best few go into the model as effects like
# any other and are refitted by free runs that grow longer; the held-out error judges, as it judges
# every named effect.

LawKinds = tuple[Over | Literal["dry"], ...]

SINGLE_CURVE: tuple[LawKinds, ...] = (("stiffness",), ("damping",), ("stiffness", "dry"))
"""What is tried at every place first: one curve. Dry friction stands beside one over the
displacement because no smooth curve jumps as it does."""
CURVES: tuple[LawKinds, ...] = (*SINGLE_CURVE, ("stiffness", "damping"))
"""The same, and two curves."""
KINDS: tuple[LawKinds, ...] = (*CURVES, ("force",))
"""All of these, and a force over displacement and velocity at once, which can be anything."""
OVER_TIME: tuple[LawKinds, ...] = (("varying_stiffness",), ("varying_damping",))
"""What is tried where no law of the motion explains what is left."""


@dataclass(frozen=True, eq=False)
class TriedLaw:
    """A law that was tried.

    Attributes
    ----------
    at : tuple of str
    over : str
        What the laws are curves over.
    odds : float
        Log odds against no law, from the innovations.
    fall : float
        Share by which the innovations fell.
    ratio : float
        Held-out error over the noise after the refit; infinite if there was none.
    helps : bool
        Whether that error fell.
    """

    at: tuple[str, ...]
    over: str
    odds: float
    fall: float
    ratio: float = np.inf
    helps: bool = False


@dataclass(frozen=True, eq=False)
class Learned:
    """What was learned.

    Attributes
    ----------
    fitted : EvaluatedFit
        The model with the laws, fitted to parts of the record and judged on the others.
    final : Fit
        The same, fitted to the whole of it.
    laws : tuple of LearnedLaw
        Those that were added, one or two at one place.
    covariance : xarray.DataArray
        Of the fitted numbers.
    before, after : ndarray, shape (ny,)
        Held-out errors over the noise, without and with the laws.
    tried : tuple of Tried
        What was added first, then the best.
    explains : bool
        Whether the held-out error is as good as the noise now. If not, what is missing is no such
        law, or not that alone: it may depend on time, on the past, or on more than one place.
    """

    fitted: EvaluatedFit
    final: Fit
    laws: tuple[LearnedLaw, ...]
    covariance: xr.DataArray
    before: Array
    after: Array
    tried: tuple[TriedLaw, ...]
    explains: bool

    @property
    def model(self) -> MechanicalModel:
        """The model with the laws, fitted."""
        return self.final.model

    @property
    def what(self) -> str:
        """What they are, over what and where, as in "force over velocity at arm, ground"."""
        best = self.tried[0]
        return f"{self.laws[0].quantity} over {best.over} at {', '.join(best.at)}"

    def evidence(self) -> str:
        """Say in a sentence what the laws explain.

        Returns
        -------
        str
        """
        before, after = float(np.max(self.before)), float(np.max(self.after))
        told = (
            f"A {self.what} takes the held-out error from {before:.3g} to {after:.3g} times the "
            f"noise (log odds {self.tried[0].odds:.0f})"
        )
        if self.explains:
            return f"{told}: such a law explains what was left."
        return (
            f"{told}: it does not explain what is left, which may depend on time, on the past, "
            "or on more than this place."
        )


def learn(
    model: MechanicalModel,
    prepared: PreparedRecord,
    reference: MechanicalModel,
    kinds: Sequence[LawKinds] = KINDS,
    white: Array | None = None,
) -> Learned | None:
    """Learn the law that explains best what a model leaves, and add it to the model.

    Parameters
    ----------
    model : MechanicalModel
        Fitted, with the effects that were found.
    prepared : PreparedRecord
    reference : MechanicalModel
        The model before any fit: its springs and dampers stay where a law contains them, and laws
        are looked for beside its numbers, too. Without the law, a fit may have bent them far off.
    kinds : sequence of tuple, optional
        What is tried at every place: `KINDS`, `CURVES` or `OVER_TIME`.
    white : ndarray, shape (ny,), optional
        Noise of the sensors if it has no colour; if not given, the noise as prepared has none.

    Returns
    -------
    Learned or None
        None if no law makes the held-out error fall.
    """
    before = held_out(model, prepared)
    given = replace(reference, effects=model.effects)
    ranked = _rank_laws([model] if given == model else [model, given], prepared, kinds)
    least = max(LEARNING.odds, LEARNING.near * ranked[0].odds) if ranked else np.inf
    likely = [(i, law) for i, law in enumerate(ranked) if law.odds >= least]
    enough = prepared.policy.at_noise_floor * prepared.scales.noise
    refits: dict[int, EvaluatedFit] = {}
    stood: int | None = None
    for i, law in likely:
        if len(refits) == LEARNING.refits:
            break
        # a law that is less likely than one that helps there is none beside it
        here = [fitted for j, fitted in refits.items() if ranked[j].curves.at == law.curves.at]
        if any(_helps(fitted.error, before) for fitted in here):
            continue
        fitted = fit_with_laws(law.beside, law.curves, prepared, reference)
        if fitted is None:
            continue
        refits[i] = fitted
        if stood is None or _has_lower_error(fitted, refits[stood]):
            stood = i
        if np.all(refits[stood].error < enough):
            break
    if stood is None or not _helps(refits[stood].error, before):
        return None
    for i, law in likely:  # a second law at a place has to earn it
        if law.curves.within(ranked[stood].curves) and i not in refits:
            fitted = fit_with_laws(law.beside, law.curves, prepared, reference)
            if fitted is not None and not _has_lower_error(refits[stood], fitted):
                refits[i], stood = fitted, i
                break
    best = with_knots_over_motion(refits[stood], len(model.effects), prepared, reference)
    least_noise = prepared.scales.noise if white is None else white
    best = refine_knots(best, len(model.effects), prepared, reference, least_noise)
    final = fit_laws_to_record(best, prepared, reference)
    covariance = covariance_of(final)
    noise = residual_noise_floor(final.model, prepared, best.reproducible)
    old = sum(bool(e.definition.over) for e in model.effects)
    told = [
        (i != stood, _tried_law(law, refits.get(i), before, prepared))
        for i, law in enumerate(ranked)
    ]
    told.sort(key=lambda item: (item[0], item[1].ratio, -item[1].odds))
    return Learned(
        best,
        final,
        learned_laws_of(final.model, covariance)[old:],
        covariance,
        before / noise,
        best.error / noise,
        tuple(tried for _, tried in told),
        bool(np.all(best.error <= LEARNING.explains * noise)),
    )


def _has_lower_error(one: EvaluatedFit, other: EvaluatedFit) -> bool:
    return mean_log_error(one.error) < mean_log_error(other.error) - LEARNING.better


def _tried_law(
    law: _RankedLaw, fitted: EvaluatedFit | None, before: Array, prepared: PreparedRecord
) -> TriedLaw:
    curves = law.curves
    over = " and ".join(
        name for e in curves.effects for name in e.definition.over or [e.definition.title]
    )
    ratio, helps = np.inf, False
    if fitted is not None:
        ratio = float(np.max(fitted.error / prepared.scales.noise))
        helps = _helps(fitted.error, before)
    return TriedLaw(curves.at, over, law.odds, curves.fall, ratio, helps)


def _helps(error: Array, before: Array) -> bool:
    return mean_log_error(error) <= mean_log_error(before) + np.log(1 - LEARNING.fall)


class _ModelView(NamedTuple):
    """A model and what it makes of the record: its motion, and its innovations at some levels."""

    model: MechanicalModel
    motion: SmoothedMotion
    seen: list[FilteredRecord]


class _RankedLaw(NamedTuple):
    """Laws at a place, their log odds, and the model beside which they are likeliest."""

    odds: float
    curves: CurveFit
    beside: MechanicalModel


def _rank_laws(
    models: Sequence[MechanicalModel], prepared: PreparedRecord, tried: Sequence[LawKinds]
) -> list[_RankedLaw]:
    """Return laws by their log odds, the best of each place and kind, the best first."""
    policy, record = prepared.policy, prepared.screened
    looks = []
    for model in models:
        motion = prepared.motion(model, record)
        seen = [FilteredRecord(model, prepared, record, n, motion) for n in policy.shape_levels]
        looks.append(_ModelView(model, motion, seen))
    null = min(
        min(f.null_scores(policy.noise_orders).values()) for look in looks for f in look.seen
    )
    rough = []
    for at in places(models[0], lookup("cubic_stiffness")):
        for kinds in tried:
            found = [
                (_fit_at_best_level(look, at, kinds, LEARNING.first, record), look)
                for look in looks
            ]
            known = [(fit, look) for fit, look in found if fit is not None]
            if known:
                fit, look = min(known, key=lambda item: item[0].score)
                rough.append(
                    (_RankedLaw(float(null - fit.score) / 2, fit, look.model), look, kinds)
                )
    rough.sort(key=lambda item: -item[0].odds)
    ranked = [law for law, _, _ in rough]
    for i, (law, look, kinds) in enumerate(rough[: LEARNING.refits]):
        for count in LEARNING.counts if kinds != ("force",) else ():
            if count * LEARNING.samples > record.samples:
                continue
            finer = _fit_at_best_level(look, law.curves.at, kinds, count, record)
            if finer is None:
                continue
            odds = float(null - finer.score) / 2
            if odds > ranked[i].odds + LEARNING.simpler:
                ranked[i] = _RankedLaw(odds, finer, law.beside)
    return sorted(ranked, key=lambda law: -law.odds)


def _fit_at_best_level(
    look: _ModelView,
    at: tuple[str, ...],
    kinds: Sequence[Over | Literal["dry"]],
    count: int,
    record: Record,
) -> CurveFit | None:
    """Return laws at a place at the level where they are likeliest."""
    model, motion = look.model, look.motion
    here = {name for e in model.effects if set(e.at) == set(at) for name in e.definition.over}
    blocks: list[LawColumns] = []
    if "dry" in kinds and any(e.kind == DRY and set(e.at) == set(at) for e in model.effects):
        return None
    for over in kinds:
        size = LEARNING.across[0] if over == "force" else count
        made = (
            dry_friction_block(model, at, motion)
            if over == "dry"
            else block(model, at, over, size, motion, record)
        )
        if made is None or here & {*made.effect.definition.over}:
            return None
        blocks.append(made)
    row = port_row(model, at)
    found = [fit_curves(f, row, blocks) for f in look.seen]
    found = [f for f in found if np.isfinite(f.score) and f.sensible]
    return min(found, key=lambda f: f.score, default=None)
