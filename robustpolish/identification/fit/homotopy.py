"""Fit a model's parameters by free runs that grow longer.

A record is cut into windows from which the model runs freely, each from a start of its own; the
windows grow from a few swings to whole pieces (multiple shooting: Bock 1983; Ljung, System
Identification, section 7.2). Errors over a short window depend smoothly on every number. Over long
runs those of lightly damped systems have many minima, and a distant start ends in a wrong one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from robustpolish.arrays import Array
from robustpolish.identification.fit.least_squares import SETTLED, Fit, Residuals, fit
from robustpolish.identification.fit.parameters import free_parameters, with_units_of_force
from robustpolish.identification.fit.prepared import PreparedRecord
from robustpolish.identification.observer.reproducibility import reproducibility
from robustpolish.identification.observer.run import RecordRun, Start, StartedPiece, rest
from robustpolish.long_calls import on_all_cores
from robustpolish.models.mechanical import MechanicalModel


def homotopy(
    model: MechanicalModel,
    prepared: PreparedRecord,
    pieces: Sequence[StartedPiece],
    reference: MechanicalModel,
    spans: Sequence[int],
    iterations: int = 8,
    progress: Callable[[], None] | None = None,
    settled: float = SETTLED,
    last: float = SETTLED,
    anew: bool = False,
    known: bool = False,
) -> list[Fit]:
    """Fit over windows that grow; return the fit of every stage.

    A stage whose errors jump is no start for the next: the last one that followed the data is,
    and that is among the last two that are returned. An effect that vanished in a stage begins the
    next one as it began the first: over short windows the starts may do its work, and where it is
    nothing none of its other numbers makes a difference, and no longer window would bring it back.

    Parameters
    ----------
    model : MechanicalModel
    prepared : PreparedRecord
    pieces : sequence of StartedPiece
        What to fit to.
    reference : MechanicalModel
        About which the priors are centred.
    spans : sequence of int
        Most samples of the windows, rising; see :meth:`PreparedRecord.spans`.
    iterations : int
        Most steps per stage.
    progress : callable, optional
        Called after every step.
    settled : float, optional
        Relative fall of the cost below which a stage stops that only the next one begins with.
    last : float, optional
        The same of the last stage; below the usual one, it has as many steps as a direct fit.
    anew : bool, optional
        Whether the first windows are begun anew after their fit, as long as that helps: their first
        starts are those of a motion that was smoothed without the law.
    known : bool, optional
        Whether the model's numbers are near the true ones, as after another fit. The first windows
        then begin where such a model comes closest to them: a friction with memory, whose state no
        motion shows, would be led astray from its true numbers by starts that do not suit it.
    """
    stages: list[Fit] = []
    kept: Fit | None = None
    first = model = with_units_of_force(model, reference)
    for span in spans if model.free else spans[-1:]:  # what is imposed cannot go astray
        windows = windows_after(model, prepared, pieces, span, kept, known)
        enough = last if span == spans[-1] else settled
        steps = max(iterations, prepared.policy.direct_steps) if enough < SETTLED else iterations
        # an offset that is not known yet makes the smoothed motion so fast that laws diverge
        still = [StartedPiece(window.record, rest(model)) for window in windows]
        tried = (residuals_of(model, begun, prepared, reference) for begun in (windows, still))
        fits = (fit(residuals, steps, progress, enough) for residuals in tried)
        result = next((found for found in fits if np.isfinite(found.cost)), None)
        if result is None:
            continue
        if anew and not stages:
            smoothed = prepared.windows_of(model, pieces, span)
            result = _begun_anew(result, smoothed, prepared, reference, steps)
        stages.append(result)
        if kept is not None and np.max(result.rmse / kept.rmse) > prepared.policy.lost:
            continue  # the next stage starts where this one did
        kept, model = result, _revived(result.model, first, prepared.policy.vanished)
    if kept is not None and all(kept is not stage for stage in stages[-2:]):
        stages.insert(len(stages) - 1, kept)
    return stages


def _begun_anew(
    found: Fit,
    windows: Sequence[StartedPiece],
    prepared: PreparedRecord,
    reference: MechanicalModel,
    steps: int,
) -> Fit:
    """Return a fit after rounds of starts that suit its law, and fits that suit the starts."""
    for _ in range(prepared.policy.rounds):
        run = prepared.runner(found.model).run(found.model)
        begun = prepared.with_fitted_starts(run, windows)
        other = fit(residuals_of(found.model, begun, prepared, reference), steps)
        if not np.mean(np.log(other.rmse / found.rmse)) < -prepared.policy.unchanged:
            break
        found = other
    return found


def residuals_of(
    model: MechanicalModel,
    pieces: Sequence[StartedPiece],
    prepared: PreparedRecord,
    reference: MechanicalModel,
) -> Residuals:
    """Return the residuals of a model's runs over pieces, those numbers free that are not held."""
    free = free_parameters(model, prepared.scales.bandwidth, prepared.policy, reference)
    free = [number for number in free if number.key not in prepared.held]
    sizes = prepared.sizes(model) if pieces[0].start.vector.size else None
    return Residuals(model, pieces, prepared.runner(model), free, sizes)


def _revived(model: MechanicalModel, first: MechanicalModel, vanished: float) -> MechanicalModel:
    """Return a model with the first values of those effects that have vanished since.

    One that has a single number needs no help: its size alone brings it back.
    """
    effects = list(model.effects)
    for i, (effect, began) in enumerate(zip(effects, first.effects, strict=True)):
        fitted = [p for p in effect.definition.parameters if p.fitted]
        sizes = [p.name for p in fitted if p.counts_force] if len(fitted) > 1 else []
        if any(abs(effect.values[n]) < vanished * abs(began.values[n]) for n in sizes):
            effects[i] = began
    return replace(model, effects=tuple(effects))


def windows_after(
    model: MechanicalModel,
    prepared: PreparedRecord,
    pieces: Sequence[StartedPiece],
    span: int,
    before: Fit | None,
    known: bool = False,
) -> list[StartedPiece]:
    """Cut pieces into windows that start where the stage before was, or the smoothed motion.

    With `known` numbers, where the model comes closest to the windows.
    """
    windows = prepared.windows_of(model, pieces, span)
    if before is None:
        return _not_lost(model, prepared, windows, known)
    run = prepared.runner(before.model).run(before.model)
    seen = run.over_all(before.pieces, keep=True)
    first = {}
    at = 0
    for piece in before.pieces:
        first[piece.record.first] = at
        at += piece.record.samples
    marks = np.array(sorted(first))
    n = windows[0].start.state.size
    found = []
    for window in windows:
        begin = window.record.first
        mark = int(marks[np.searchsorted(marks, begin, side="right") - 1])
        row = first[mark] + begin - mark
        start = Start(seen.states[row, :n], seen.internal[row])
        finite = np.isfinite(start.vector).all()
        found.append(StartedPiece(window.record, start) if finite else window)
    return found


def _not_lost(
    model: MechanicalModel, prepared: PreparedRecord, windows: list[StartedPiece], known: bool
) -> list[StartedPiece]:
    """Return the windows, with starts of their own where those of the smoothed motion are far off.

    Where a mass has no displacement sensor its place is a matter of the model that smoothed the
    motion, and a law that grows fast makes of a wrong place a force beyond all bounds: a fit would
    then bend the law to the starts, even away from the true one.
    """
    run = prepared.runner(model).run(model)
    if run.linear or not windows[0].start.vector.size:
        return windows
    if known:
        return prepared.with_fitted_starts(run, windows)
    with np.errstate(over="ignore", invalid="ignore"):
        left = np.mean(run.all_errors(windows) ** 2, axis=0)
    seen = np.var(np.concatenate([window.record.Y for window in windows]), axis=0)
    return windows if np.all(left < seen) else prepared.with_fitted_starts(run, windows)


@dataclass(frozen=True, eq=False)
class JudgedFit:
    """A fitted model and what it does on data that it was not fitted to.

    Attributes
    ----------
    fit : Fit
    free : ndarray, shape (ny,)
        Held-out root mean square error of free runs over whole pieces.
    over_windows : callable
        Returns the same of free runs over short windows, shape (ny,).
    reproducible : bool
        Whether free runs over whole pieces judge anything.
    over_fitted : callable
        Returns the error of free runs over the whole pieces that fits are made to, shape (ny,).
    fades : bool
        Whether the held-out pieces are far quieter than those that fits are made to.
    """

    fit: Fit
    free: Array
    over_windows: Callable[[], Array]
    reproducible: bool
    over_fitted: Callable[[], Array]
    fades: bool = False

    @cached_property
    def short(self) -> Array:
        """Held-out error over short windows; measured only where free runs judge nothing."""
        return self.over_windows()

    @cached_property
    def fitted(self) -> Array:
        """Error over whole fitted pieces; measured only where fits ended on unlike windows."""
        return self.over_fitted()

    @property
    def over_all(self) -> Array:
        """Error of free runs by which fits are ranked, held out and, where motion fades, fitted.

        Many laws do the same in a motion that has faded; which of them is there shows while it is
        loud, and with thousands of samples for each number a fit cannot bend itself to noise.
        """
        return np.sqrt(self.free * self.fitted) if self.fades else self.free

    @property
    def model(self) -> MechanicalModel:
        """The fitted model."""
        return self.fit.model

    @property
    def error(self) -> Array:
        """Held-out error that judges: over whole pieces if reproducible, else over windows."""
        return self.free if self.reproducible else self.short


def left_by(fitted: JudgedFit, among: Sequence[JudgedFit]) -> float:
    """Return the mean log of the errors that rank; of short windows unless all run reproducibly."""
    calm = fitted.reproducible and all(other.reproducible for other in among)
    errors = fitted.over_all if calm else fitted.short
    return float(np.mean(np.log(np.maximum(errors, 1e-300))))


def judged(fitted: Fit, prepared: PreparedRecord) -> JudgedFit:
    """Measure a fitted model on the held-out pieces."""
    free, calm = free_rms(fitted.model, prepared, prepared.held_out)
    over = partial(short_rms, fitted.model, prepared, prepared.held_out)
    long = partial(rms_over, fitted.model, prepared, prepared.trial)
    return JudgedFit(fitted, free, over, calm, long, prepared.fades)


def free_rms(
    model: MechanicalModel, prepared: PreparedRecord, pieces: Sequence[StartedPiece]
) -> tuple[Array, bool]:
    """Return the errors of free runs, infinite where they diverge, and whether they judge anything.

    Returns
    -------
    rms : ndarray, shape (ny,)
    reproducible : bool
        Whether the first piece can be run again and again.
    """
    run, started, errors = _errors(model, prepared, pieces)
    first = started[0]
    found = reproducibility(run, first, first.record.Y - errors[: first.record.samples])
    return _rms(errors), found.reproducible


def short_rms(
    model: MechanicalModel, prepared: PreparedRecord, pieces: Sequence[StartedPiece]
) -> Array:
    """Return the errors of free runs over short windows, shape (ny,)."""
    return rms_over(model, prepared, prepared.windows_of(model, pieces, prepared.short))


def rms_over(
    model: MechanicalModel, prepared: PreparedRecord, pieces: Sequence[StartedPiece]
) -> Array:
    """Return the errors of free runs, infinite where they diverge, shape (ny,)."""
    return _rms(_errors(model, prepared, pieces)[2])


def _errors(
    model: MechanicalModel, prepared: PreparedRecord, pieces: Sequence[StartedPiece]
) -> tuple[RecordRun, list[StartedPiece], Array]:
    run, started = prepared.closest_runs(model, pieces)
    return run, started, run.all_errors(started)


def _rms(errors: Array) -> Array:
    with np.errstate(over="ignore", invalid="ignore"):
        found = np.sqrt(np.mean(errors**2, axis=0))
    return np.where(np.isfinite(found), found, np.inf)


def best_stage(stages: Sequence[Fit], prepared: PreparedRecord) -> JudgedFit:
    """Return the stage that predicts the held-out pieces best."""
    found = on_all_cores(lambda stage: judged(stage, prepared), stages[-2:])
    if all(s.reproducible for s in found):
        return min(found, key=lambda s: float(np.sum(np.log(s.free))))
    return min(found, key=lambda s: float(np.sum(np.log(s.short))))
