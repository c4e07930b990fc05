"""A price on the controls: they join the performance outputs."""

from __future__ import annotations

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray

from robustpolish.models import GeneralizedPlant
from robustpolish.validation import described, invalid


def control_weights(plant: GeneralizedPlant, weight: ArrayLike) -> NDArray[np.float64]:
    """Check a price: one number for all controls, or one for each.

    Raises
    ------
    InvalidInputError
        If the shape does not fit or a weight is negative or not finite.
    """
    expected = f"a number of at least 0, or {plant.nu} of them, in units of z per unit of u"
    try:
        weights = np.array(np.broadcast_to(np.asarray(weight, dtype=float), (plant.nu,)))
    except (TypeError, ValueError):
        shown = described(f"shape {np.shape(weight)}")
        raise invalid("control_weight", shown, expected, "Pass one weight per control.") from None
    if not np.isfinite(weights).all() or (weights < 0).any():
        raise invalid("control_weight", weight, expected, "Check its sign.")
    return weights


def priced(plant: GeneralizedPlant, weight: ArrayLike) -> GeneralizedPlant:
    """Append weighted controls to the performance outputs.

    Parameters
    ----------
    plant : GeneralizedPlant
    weight : float or array_like, shape (nu,)
        Units of z per unit of u; controls with weight 0 add no output.

    Returns
    -------
    GeneralizedPlant
        The plant itself if all weights are zero; otherwise z = (z, weight u), with
        outputs named ``price_`` and the name of the control.
    """
    weights = control_weights(plant, weight)
    paid = np.flatnonzero(weights)
    if not paid.size:
        return plant
    system, nz = plant.system, plant.nz
    rows = np.zeros((paid.size, plant.nw + plant.nu))
    rows[np.arange(paid.size), plant.nw + paid] = weights[paid]
    C = np.vstack([system.C[:nz], np.zeros((paid.size, plant.nx)), system.C[nz:]])
    D = np.vstack([system.D[:nz], rows, system.D[nz:]])
    names = [f"price_{plant.control_names[i]}" for i in paid]
    outputs = [*plant.performance_names, *names, *plant.measurement_names]
    whole = control.StateSpace(
        system.A,
        system.B,
        C,
        D,
        plant.dt,
        inputs=system.input_labels,
        outputs=outputs,
        states=system.state_labels,
        remove_useless_states=False,
    )
    return GeneralizedPlant(whole, plant.ny, plant.nu, plant.units)
