"""Predictions over a horizon, from states that an observer takes from the outputs before it."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from robustpolish.identification.observer.free_run import FreeRun
from robustpolish.identification.observer.observed_motion import likeliest_observer
from robustpolish.identification.observer.scales import scales_of
from robustpolish.identification.record import record_of
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.validation import described, invalid

Array = NDArray[np.float64]


def predict(
    model: MechanicalModel, data: xr.Dataset, run: FreeRun, horizon: float
) -> tuple[Array, Array]:
    """Return predictions and the start of the record that the observer began with.

    Each prediction is a free run of the model over the horizon. The observer may take a part of
    the motion for the work of an unknown force; that force is not carried into the prediction,
    which judges the model alone.

    Parameters
    ----------
    model : MechanicalModel
    data : xarray.Dataset
        Checked record.
    run : FreeRun
        The model made ready on this record.
    horizon : float
        In s; at least one sample.

    Returns
    -------
    outputs : ndarray, shape (samples, ny)
        NaN over the first horizon.
    start : ndarray, shape (1, n)
    """
    ahead = max(1, round(horizon / run.step))
    if ahead >= run.samples:
        raise invalid(
            "horizon",
            described(f"{horizon} s, {ahead} samples"),
            f"less than the record, {run.samples} samples",
            "Choose a shorter one.",
        )
    if not run.start_size:
        return run.run(np.zeros(0)), np.zeros((1, 0))
    starts = _observed(model, data, run)
    outputs = np.full(run.measured.shape, np.nan)
    for k in range(run.samples - ahead):
        outputs[k + ahead] = run.run(starts[k], k, k + ahead + 1)[-1]
    return outputs, starts[:1]


def _observed(model: MechanicalModel, data: xr.Dataset, run: FreeRun) -> Array:
    """Estimate the state at every sample from the outputs up to there."""
    record = record_of(model, data)
    chosen = likeliest_observer(model, record, scales_of(model, record))
    if chosen is None:
        raise invalid(
            "model",
            described("a model whose observer diverges on these data"),
            "one that can follow them",
            "Compare in short windows, or check its stiffness and damping.",
        )
    n = run.system.states
    return np.hstack([chosen[1].states[:, :n], chosen[1].internal])
