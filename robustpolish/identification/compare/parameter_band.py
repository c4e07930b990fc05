"""How far the simulated outputs may be off because the parameters are uncertain."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from robustpolish.arrays import Array
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.validation import described, invalid, positive

Simulation = Callable[[MechanicalModel], Array]


def parameter_band(
    model: MechanicalModel,
    standard_errors: Mapping[str, float],
    simulate: Simulation,
) -> Array:
    """Return the half width of the 95 % band of the outputs, to first order.

    Parameters
    ----------
    model : MechanicalModel
    standard_errors : mapping of str to float
        By the keys of ``model.parameters``; taken as independent.
    simulate : callable
        Gives the outputs of a model, shape (samples, ny).

    Returns
    -------
    ndarray, shape (samples, ny)
    """
    known = model.parameters
    nominal = simulate(model)
    variance = np.zeros_like(nominal)
    for key, error in standard_errors.items():
        if key not in known:
            listed = ", ".join(known)
            shown = described(f"{key!r}")
            raise invalid("standard_errors", shown, f"keys among {listed}", "Correct the key.")
        size = positive(f"standard_errors[{key!r}]", error, zero=True)
        if size == 0:
            continue
        # Upwards only: a mass or a gap must not become negative.
        variance += (simulate(model.with_parameters({key: known[key] + size})) - nominal) ** 2
    return 1.96 * np.sqrt(variance)
