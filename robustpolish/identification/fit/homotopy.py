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
from numpy.typing import NDArray

from robustpolish.identification.fit.evaluation import (
    FREE,
    fitted_starts,
    free_errors,
    full_scale,
    guided_errors,
    reproducible,
    with_rest,
)
from robustpolish.identification.fit.least_squares import Fit, Piece, Residuals, fit
from robustpolish.identification.fit.parameters import free_parameters
from robustpolish.identification.fit.prepared import Setting
from robustpolish.identification.fit.units_of_force import with_units_of_force
from robustpolish.identification.observer.kalman import Level
from robustpolish.identification.observer.run import Predictor
from robustpolish.models.mechanical import MechanicalModel

Array = NDArray[np.float64]
HOMOTOPY = (Level(1.0), Level(0.1), Level(0.01), FREE)
_LOST = 5.0


@dataclass(frozen=True, eq=False)
class Stage:
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


def judge(fitted: Fit, setting: Setting) -> Stage:
    """Measure a fitted model on the held-out pieces."""
    common = (setting.scales, setting.dt, setting.amplitude)
    errors = free_errors(fitted.model, setting.held_out, *common, setting.state_scale)
    guided = guided_errors(fitted.model, setting.held_out, *common)
    steady = reproducible(fitted.model, setting.held_out[0], *common, setting.state_scale)
    rms = np.sqrt(np.mean(errors**2, axis=0))
    return Stage(
        fitted, np.where(np.isfinite(rms), rms, np.inf), np.sqrt(np.mean(guided**2, axis=0)), steady
    )


def homotopy(
    model: MechanicalModel,
    setting: Setting,
    pieces: Sequence[Piece],
    reference: MechanicalModel,
    levels: Sequence[Level] = HOMOTOPY,
    iterations: int = 8,
    held: Sequence[str] = (),
    progress: Callable[[], None] | None = None,
    enough: Callable[[Level, Fit], bool] | None = None,
) -> list[Fit]:
    """Fit at falling levels of guidance; return the fit of every stage.

    A stage whose errors jump is no start for the next: the last one that followed the data is,
    and that is among the last two that are returned.

    Parameters
    ----------
    model : MechanicalModel
    setting : Setting
    pieces : sequence of Piece
        What to fit to.
    reference : MechanicalModel
        About which the priors are centred.
    levels : sequence of Level
    iterations : int
        Most steps per stage.
    held : sequence of str
        Keys that stay as they are.
    enough : callable, optional
        Asked after each stage whether it is worth while to go on; if not, nothing is returned.
    """
    stages: list[Fit] = []
    kept: Fit | None = None
    model = with_units_of_force(model, reference)
    current = with_rest(model, pieces)
    for level in levels:
        predictor = Predictor(model, setting.dt, level, setting.scales, setting.amplitude)
        if level.free and current[0].start.vector.size:
            current = fitted_starts(model, current, predictor, setting.state_scale)
        free = [
            f
            for f in free_parameters(model, setting.scales.bandwidth, reference)
            if f.key not in held
        ]
        residuals = Residuals(
            model, current, predictor, free, level.free and current[0].start.vector.size > 0,
            full_scale(model, setting.state_scale),
        )  # fmt: skip
        result = fit(residuals, iterations=iterations, progress=progress)
        if not np.isfinite(result.cost):
            continue
        if enough is not None and not enough(level, result):
            return []
        stages.append(result)
        if kept is not None and _lost(result, kept):
            continue  # the next stage starts where this one did
        kept, model = result, result.model
        if level.free:
            current = list(result.pieces)
    if kept is not None and all(kept is not stage for stage in stages[-2:]):
        stages.insert(len(stages) - 1, kept)
    return stages


def guided_rms(
    model: MechanicalModel, setting: Setting, pieces: Sequence[Piece], level: Level
) -> Array:
    """Return the prediction errors of a model as it is, at a level, shape (ny,)."""
    common = (setting.scales, setting.dt, setting.amplitude)
    return np.sqrt(np.mean(guided_errors(model, pieces, *common, level) ** 2, axis=0))


def _lost(after: Fit, before: Fit) -> bool:
    """Return whether a stage lost the data that the one before followed."""
    return bool(np.max(after.rmse / before.rmse) > _LOST)


def best_stage(stages: Sequence[Fit], setting: Setting) -> Stage:
    """Return the stage that predicts the held-out pieces best."""
    judged = [judge(stage, setting) for stage in stages[-2:]]
    if all(s.reproducible for s in judged):
        return min(judged, key=lambda s: float(np.sum(np.log(s.free))))
    return min(judged, key=lambda s: float(np.sum(np.log(s.guided))))
