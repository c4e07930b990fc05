"""What an engineer would say of a record and of what a fit made of a model, before believing it."""

from __future__ import annotations

import numpy as np
import xarray as xr

from robustpolish.effects import CONSTANT
from robustpolish.identification.fit.prepared import PreparedRecord
from robustpolish.identification.sanity.warnings import sanity_warnings
from robustpolish.models.mechanical import MechanicalModel


def warned(
    model: MechanicalModel, fitted: MechanicalModel, prepared: PreparedRecord
) -> tuple[str, ...]:
    """Return the remarks of a record and the warnings that a fit gives cause for, each once.

    Parameters
    ----------
    model : MechanicalModel
        As it was given, effects without numbers started.
    fitted : MechanicalModel
        What a refit or a diagnosis made of it.
    prepared : PreparedRecord

    Returns
    -------
    tuple of str
    """
    data = prepared.record.data
    said = [str(note) for note in data.attrs.get("notes", ())]
    # an offset or a preload that was found says what the mean is
    steady = any(effect.definition.family == CONSTANT for effect in fitted.effects)
    simulated = None if steady else _free_run(model, prepared)
    said += sanity_warnings(model, data, simulated, fitted)
    return tuple(dict.fromkeys(said))


def _free_run(model: MechanicalModel, prepared: PreparedRecord) -> xr.Dataset:
    """Return the outputs of a model over the whole record, from the starts that suit it best."""
    run, started = prepared.closest_runs(model, prepared.everything)
    with np.errstate(all="ignore"):
        outputs = run.over_all(started).outputs
    return xr.Dataset({name: ("time", outputs[:, i]) for i, name in enumerate(model.output_names)})
