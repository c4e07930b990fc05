"""Learned laws in a model: refitted by free runs that grow longer, with closer knots."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from robustpolish.arrays import Array
from robustpolish.effects import Effect
from robustpolish.effects.learned import coefficients_of, spline_basis
from robustpolish.identification.fit.homotopy import (
    JudgedFit,
    best_stage,
    free_rms,
    homotopy,
    rms_over,
    short_rms,
)
from robustpolish.identification.fit.least_squares import Fit
from robustpolish.identification.fit.prepared import PreparedRecord
from robustpolish.identification.laws.penalised import (
    CurveFit,
    with_numbers,
    with_numbers_of,
)
from robustpolish.identification.observer.missing_force import motion_of
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.ports import port_row


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


def log_size(error: Array) -> float:
    """Return the mean log of the errors of all outputs: what a fit makes small."""
    return float(np.mean(np.log(error)))


def held_out(model: MechanicalModel, prepared: PreparedRecord) -> Array:
    """Return the held-out error of a model, of short runs where whole ones judge nothing."""
    error, calm = free_rms(model, prepared, prepared.held_out)
    if calm:
        return error
    return short_rms(model, prepared, prepared.held_out)


def with_laws(
    model: MechanicalModel,
    curves: CurveFit,
    prepared: PreparedRecord,
    reference: MechanicalModel,
) -> JudgedFit | None:
    """Return the model with the laws, fitted by free runs that grow longer.

    Where the record hardly saw a curve, the whole of it may be too much for a run: it begins with
    the share of it that predicts best.
    """
    spans = prepared.spans(prepared.trial, prepared.policy.growth)
    starts = []
    for share in LEARNING.shares:
        effects = [with_numbers(e, share * coefficients_of(e.values).ravel()) for e in curves.laws]
        start, laws = with_numbers_of(effects, model, reference)
        extended = replace(start, effects=(*start.effects, *laws, *curves.others))
        error = short_rms(extended, prepared, prepared.trial)
        starts.append((float(np.sum(np.log(np.nan_to_num(error, nan=np.inf)))), share, extended))
    extended = min(starts, key=lambda item: (item[0], -item[1]))[2]
    stages = homotopy(extended, prepared, prepared.trial, reference, spans, LEARNING.steps)
    return best_stage(stages, prepared) if stages else None


def with_closer_knots(
    stage: JudgedFit,
    first: int,
    prepared: PreparedRecord,
    reference: MechanicalModel,
    white: Array,
) -> JudgedFit:
    """Return a stage with twice as close knots, over the motion that its model now shows.

    As long as more than white noise is left and the held-out error falls: what a curve leaves
    whose knots are too far apart looks like noise of some colour.

    Parameters
    ----------
    stage : JudgedFit
    first : int
        From which effect on laws are concerned.
    prepared : PreparedRecord
    reference : MechanicalModel
    white : ndarray, shape (ny,)
        Noise of the sensors if it has no colour.
    """
    while np.any(stage.error > LEARNING.rest * white):
        finer = _with_other_knots(stage, first, closer, prepared, reference, 2)
        if finer is None or log_size(finer.error) > log_size(stage.error) - LEARNING.better:
            break
        stage = finer
    return stage


def over_own_motion(
    stage: JudgedFit, first: int, prepared: PreparedRecord, reference: MechanicalModel
) -> JudgedFit:
    """Return a stage whose curves have their knots where its model moves.

    Before it was known, a place may have seemed to move farther than it does: what a curve does
    there nobody has seen. As many knots, if they do as well.

    Parameters
    ----------
    stage : JudgedFit
    first, prepared, reference
        As of :func:`with_closer_knots`.
    """

    def as_many(effect: Effect, low: float, high: float) -> Effect:
        values, narrow = effect.values, LEARNING.narrow * (high - low)
        if abs(values["low"] - low) <= narrow and abs(values["high"] - high) <= narrow:
            return effect
        return laid(effect, low, high, coefficients_of(values).size)

    other = _with_other_knots(stage, first, as_many, prepared, reference, 1)
    if other is None or log_size(other.error) > log_size(stage.error) + LEARNING.better:
        return stage
    return other


def _of_free_runs(stage: JudgedFit, prepared: PreparedRecord) -> tuple[Array, Array]:
    """Return displacements and velocities of a model's own runs, shape (coordinates, samples)."""
    model, pieces = stage.model, prepared.everything if stage.reproducible else prepared.windows
    run, started = prepared.closest_runs(model, pieces)
    signals = np.concatenate([run.runner.inputs(model, piece.record) for piece in started])
    return motion_of(model, run.over_all(started, keep=True).states, signals)


def _with_other_knots(
    stage: JudgedFit,
    first: int,
    knots: Callable[[Effect, float, float], Effect],
    prepared: PreparedRecord,
    reference: MechanicalModel,
    spans: int,
) -> JudgedFit | None:
    """Return a stage with other knots by the range of each law, fitted over the longest windows.

    The range is that of the model's own runs: smoothed accelerations wander. None if no knot is
    another one, or no fit ended well.
    """
    effects, motion = list(stage.model.effects), _of_free_runs(stage, prepared)
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


def closer(effect: Effect, low: float, high: float) -> Effect:
    """Return a learned curve with twice as many stretches between knots over a range.

    The same effect if there would be too many.
    """
    count = 2 * coefficients_of(effect.values).size - 3
    return effect if count > LEARNING.closest else laid(effect, low, high, count)


def laid(effect: Effect, low: float, high: float, count: int) -> Effect:
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
    return with_numbers(Effect(kind, effect.at, knots), finer)


def fitted_to_all(stage: JudgedFit, prepared: PreparedRecord, reference: MechanicalModel) -> Fit:
    """Return the fit to the whole record, the one to its trial pieces if that did not end well."""
    if not stage.reproducible:
        return stage.fit
    pieces = prepared.everything
    whole = prepared.spans(pieces)[-1:]
    fits = homotopy(stage.model, prepared, pieces, reference, whole, LEARNING.steps, known=True)
    before = rms_over(stage.model, prepared, prepared.everything)
    if not fits or log_size(fits[-1].rmse) > log_size(before):
        return stage.fit
    return fits[-1]
