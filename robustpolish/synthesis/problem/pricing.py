"""What makes a singular problem regular: a price on the controls, noise on the measurements."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robustpolish.models import GeneralizedPlant
from robustpolish.validation import described, invalid


def _weights(argument: str, weight: ArrayLike | None, count: int, unit: str) -> NDArray[np.float64]:
    if weight is None:
        return np.zeros(count)
    expected = f"a number of at least 0, or {count} of them, in {unit}"
    try:
        weights = np.array(np.broadcast_to(np.asarray(weight, dtype=float), (count,)))
    except (TypeError, ValueError):
        shown = described(f"shape {np.shape(weight)}")
        raise invalid(argument, shown, expected, "Pass one number per signal.") from None
    if not np.isfinite(weights).all() or (weights < 0).any():
        raise invalid(argument, weight, expected, "Check its sign.")
    return weights


NOISE_PREFIX = "noise_"
"""What the names of added measurement noise begin with."""


def priced(plant: GeneralizedPlant, weight: ArrayLike | None) -> GeneralizedPlant:
    """Append weighted controls to the performance outputs.

    Parameters
    ----------
    plant : GeneralizedPlant
    weight : float or array_like, shape (nu,), or None
        Units of z per unit of u; controls with weight 0 add no output.

    Returns
    -------
    GeneralizedPlant
        The plant itself if all weights are zero; otherwise z = (z, weight u), with
        outputs named ``price_`` and the name of the control.

    Raises
    ------
    InvalidInputError
        If the shape does not fit or a weight is negative or not finite.
    """
    weights = _weights("control_weight", weight, plant.nu, "units of z per unit of u")
    paid = np.flatnonzero(weights)
    if not paid.size:
        return plant
    more = ((0, paid.size), (0, 0))
    return plant.replace(
        C1=np.pad(plant.C1, more),
        D11=np.pad(plant.D11, more),
        D12=np.vstack([plant.D12, np.diag(weights)[paid]]),
        performance=[*plant.performance_names, *(f"price_{plant.control_names[i]}" for i in paid)],
    )


def noisy(plant: GeneralizedPlant, noise: ArrayLike | None) -> GeneralizedPlant:
    """Append noise on the measurements to the disturbances.

    Without it a controller may amplify a small y without limit, so a price on u alone does
    not keep the gain finite.

    Parameters
    ----------
    plant : GeneralizedPlant
    noise : float or array_like, shape (ny,), or None
        Units of y per unit of w; measurements with noise 0 get no disturbance.

    Returns
    -------
    GeneralizedPlant
        The plant itself if all are zero; otherwise w = (w, noise), with disturbances named
        ``noise_`` and the name of the measurement.

    Raises
    ------
    InvalidInputError
        If the shape does not fit or a size is negative or not finite.
    """
    sizes = _weights("measurement_noise", noise, plant.ny, "units of y per unit of w")
    heard = np.flatnonzero(sizes)
    if not heard.size:
        return plant
    more = ((0, 0), (0, heard.size))
    names = [NOISE_PREFIX + plant.measurement_names[i] for i in heard]
    return plant.replace(
        B1=np.pad(plant.B1, more),
        D11=np.pad(plant.D11, more),
        D21=np.hstack([plant.D21, np.diag(sizes)[:, heard]]),
        disturbances=[*plant.disturbance_names, *names],
    )
