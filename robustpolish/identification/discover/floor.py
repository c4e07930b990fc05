"""The noise that the errors of a fitted model show."""

from __future__ import annotations

from robustpolish.arrays import Array
from robustpolish.identification.fit.prepared import PreparedRecord, with_rest
from robustpolish.identification.residuals.noise_floor import noise_floor
from robustpolish.models.mechanical import MechanicalModel


def floor_beside(model: MechanicalModel, prepared: PreparedRecord, calm: bool) -> Array:
    """Return the noise of each output that the errors of a fitted model show, shape (ny,).

    Parameters
    ----------
    model : MechanicalModel
    prepared : PreparedRecord
    calm : bool
        Whether free runs over the whole record judge; windows do otherwise.
    """
    run = prepared.runner(model).run(model)
    pieces = prepared.everything if calm else prepared.windows
    started = prepared.with_fitted_starts(run, with_rest(model, pieces))
    motion = run.over_all(started).outputs
    known = prepared.repeats is not None
    record, scales = prepared.record, prepared.scales
    errors = record.Y - motion
    return noise_floor(errors, motion, scales.noise, known, record.honest, scales.rounded)
