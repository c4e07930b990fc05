"""Fit a model's parameters by homotopy on prediction errors.

A nonlinear observer follows the data, first closely, then less and less, until the model
runs freely (Ljung, System Identification, section 7.2; Vyasarayani et al. 2012, Nonlinear
Dynamics 67, 2779-2797, on homotopy in parameter identification). Free-run fits of lightly
damped systems from a distant start end in wrong minima; these do not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from robustpolish.arrays import Array
from robustpolish.identification.fit.least_squares import Fit, Residuals, fit
from robustpolish.identification.fit.parameters import free_parameters, with_units_of_force
from robustpolish.identification.fit.prepared import PreparedRecord, with_rest
from robustpolish.identification.observer.kalman import Level
from robustpolish.identification.observer.reproducibility import reproducibility
from robustpolish.identification.observer.run import StartedPiece
from robustpolish.models.mechanical import MechanicalModel


def homotopy(
    model: MechanicalModel,
    prepared: PreparedRecord,
    pieces: Sequence[StartedPiece],
    reference: MechanicalModel,
    levels: Sequence[Level],
    iterations: int = 8,
    progress: Callable[[], None] | None = None,
    enough: Callable[[Level, Fit], bool] | None = None,
) -> list[Fit]:
    """Fit at falling levels of guidance; return the fit of every stage.

    A stage whose errors jump is no start for the next: the last one that followed the data is,
    and that is among the last two that are returned.

    Parameters
    ----------
    model : MechanicalModel
    prepared : PreparedRecord
    pieces : sequence of StartedPiece
        What to fit to.
    reference : MechanicalModel
        About which the priors are centred.
    levels : sequence of Level
    iterations : int
        Most steps per stage.
    progress : callable, optional
        Called after every step.
    enough : callable, optional
        Asked after each stage whether it is worth while to go on; if not, nothing is returned.
    """
    stages: list[Fit] = []
    kept: Fit | None = None
    policy, bandwidth = prepared.policy, prepared.scales.bandwidth
    model = with_units_of_force(model, reference)
    current = with_rest(model, pieces)
    for level in levels:
        runner = prepared.runner(model, level)
        sizes = None
        if level.free and current[0].start.vector.size:
            sizes = prepared.sizes(model)
            current = prepared.with_fitted_starts(runner.run(model), current)
        free = free_parameters(model, bandwidth, policy, reference)
        result = fit(Residuals(model, current, runner, free, sizes), iterations, progress)
        if not np.isfinite(result.cost):
            continue
        if enough is not None and not enough(level, result):
            return []
        stages.append(result)
        if kept is not None and np.max(result.rmse / kept.rmse) > policy.lost:
            continue  # the next stage starts where this one did
        kept, model = result, result.model
        if level.free:
            current = list(result.pieces)
    if kept is not None and all(kept is not stage for stage in stages[-2:]):
        stages.insert(len(stages) - 1, kept)
    return stages


@dataclass(frozen=True, eq=False)
class JudgedFit:
    """A fitted model and what it does on data that it was not fitted to.

    Attributes
    ----------
    fit : Fit
    free : ndarray, shape (ny,)
        Held-out root mean square error of free runs.
    guided : ndarray, shape (ny,)
        The same of runs that are led a little.
    reproducible : bool
        Whether free runs judge anything.
    """

    fit: Fit
    free: Array
    guided: Array
    reproducible: bool

    @property
    def model(self) -> MechanicalModel:
        """The fitted model."""
        return self.fit.model

    @property
    def error(self) -> Array:
        """Held-out error that judges: free if reproducible, else guided."""
        return self.free if self.reproducible else self.guided


def judged(fitted: Fit, prepared: PreparedRecord) -> JudgedFit:
    """Measure a fitted model on the held-out pieces."""
    model, held_out = fitted.model, prepared.held_out
    free, calm = free_rms(model, prepared, held_out)
    return JudgedFit(
        fitted, free, guided_rms(model, prepared, held_out, prepared.policy.guided), calm
    )


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
    run = prepared.runner(model).run(model)
    started = prepared.with_fitted_starts(run, with_rest(model, pieces))
    errors = [run.errors(piece) for piece in started]
    rms = np.sqrt(np.mean(np.vstack(errors) ** 2, axis=0))
    first = started[0]
    found = reproducibility(run, first, first.record.Y - errors[0])
    return np.where(np.isfinite(rms), rms, np.inf), found.reproducible


def guided_rms(
    model: MechanicalModel, prepared: PreparedRecord, pieces: Sequence[StartedPiece], level: Level
) -> Array:
    """Return the prediction errors of a model as it is, at a level, shape (ny,)."""
    run = prepared.runner(model, level).run(model)
    errors = [run.errors(piece) for piece in with_rest(model, pieces)]
    return np.sqrt(np.mean(np.vstack(errors) ** 2, axis=0))


def best_stage(stages: Sequence[Fit], prepared: PreparedRecord) -> JudgedFit:
    """Return the stage that predicts the held-out pieces best."""
    found = [judged(stage, prepared) for stage in stages[-2:]]
    if all(s.reproducible for s in found):
        return min(found, key=lambda s: float(np.sum(np.log(s.free))))
    return min(found, key=lambda s: float(np.sum(np.log(s.guided))))
