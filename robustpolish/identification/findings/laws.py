"""The learned laws of a model, with how well their coefficients are known."""

from __future__ import annotations

import numpy as np
import xarray as xr

from robustpolish.effects import LearnedLaw
from robustpolish.models.mechanical import MechanicalModel


def laws_of(model: MechanicalModel, covariance: xr.DataArray | None) -> tuple[LearnedLaw, ...]:
    """Return the learned laws among the effects of a model, to look at.

    Parameters
    ----------
    model : MechanicalModel
    covariance : xarray.DataArray or None
        Of the fitted numbers, over their keys twice.

    Returns
    -------
    tuple of LearnedLaw
    """
    turning = {dof.name for dof in model.dofs if dof.rotational}
    found = []
    for i, effect in enumerate(model.effects):
        if not effect.definition.over:
            continue
        names = [p.name for p in effect.definition.parameters if p.fitted]
        known = None
        if covariance is not None:
            keys = covariance["parameter"].values.tolist()
            wanted = [f"effect[{i}].{name}" for name in names]
            if set(wanted) <= set(keys):
                here = [keys.index(key) for key in wanted]
                known = covariance.values[np.ix_(here, here)]
        found.append(LearnedLaw(effect, known, effect.at[0] in turning))
    return tuple(found)
