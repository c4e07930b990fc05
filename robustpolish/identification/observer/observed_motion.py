"""The motion of all coordinates and the missing force, as far as the outputs show them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from robustpolish.errors import RobustPolishError
from robustpolish.identification.observer.kalman import Level, Scales
from robustpolish.identification.observer.missing_force import Smoothed, smooth
from robustpolish.identification.observer.run import Prediction, Predictor, zero_start
from robustpolish.identification.observer.scales import amplitude_of, scales_of
from robustpolish.identification.record import Record, record_of
from robustpolish.models.mechanical import MechanicalModel

# How strongly an observer follows the data, as shares of the forces.
_LEVELS = (0.01, 0.03, 0.1, 0.3, 1.0)


def likeliest_observer(
    model: MechanicalModel, record: Record, scales: Scales
) -> tuple[Level, Prediction] | None:
    """Return the level of the missing force that predicts the data best, and its predictions.

    Parameters
    ----------
    model : MechanicalModel
    record : Record
    scales : Scales

    Returns
    -------
    (Level, Prediction) or None
        None if the observer diverges at all levels.
    """
    amplitude = amplitude_of(model, record, scales.bandwidth)
    best, chosen = np.inf, None
    for share in _LEVELS:
        level = Level(share)
        predictor = Predictor(model, record.dt, level, scales, amplitude)
        found = predictor.predict(model, record, zero_start(model), keep=True)
        error = record.Y - found.outputs
        S = predictor.gain.innovation
        with np.errstate(over="ignore", invalid="ignore"):
            cost = len(error) * np.linalg.slogdet(S)[1]
            cost += np.sum(error * np.linalg.solve(S, error.T).T)
        if np.isfinite(cost) and cost < best:
            best, chosen = float(cost), (level, found)
    return chosen


@dataclass(frozen=True, eq=False)
class ObservedMotion:
    """Motion, missing force and internal states of effects along a record.

    Attributes
    ----------
    smoothed : Smoothed
        Displacements, velocities and missing force.
    internal : ndarray, shape (samples, nz)
        Internal states of the effects, from the forward pass.
    """

    smoothed: Smoothed
    internal: NDArray[np.float64]

    def starts(self, model: MechanicalModel) -> NDArray[np.float64]:
        """Return the start at every sample: free motions, then internal states."""
        free = model.matrices.free
        return np.hstack([self.smoothed.q[free].T, self.smoothed.v[free].T, self.internal])


def observed_motion(model: MechanicalModel, data: xr.Dataset) -> ObservedMotion | None:
    """Return the smoothed motion of a record; None if it is too short or cannot be followed."""
    try:
        record = record_of(model, data)
    except RobustPolishError:
        return None
    scales = scales_of(model, record)
    found = likeliest_observer(model, record, scales)
    if found is None:
        return None
    amplitude = amplitude_of(model, record, scales.bandwidth)
    smoothed = smooth(model, record, found[0], scales, amplitude)
    if not np.isfinite(smoothed.q).all() or not np.isfinite(smoothed.force).all():
        return None
    return ObservedMotion(smoothed, found[1].internal)
