"""A discrete controller stepped in doubles, with the limits of its actuators."""

from __future__ import annotations

import control
import numpy as np

from robustpolish.arrays import Array, Matrix, Vector
from robustpolish.models.plant.blocks import matrices_of


def controller_outputs(
    controller: control.StateSpace,
    y: Array,
    limits: tuple[Vector, Vector] | None = None,
    feedback: Matrix | None = None,
) -> Array:
    """Return what a controller makes of measurements, from rest.

    Parameters
    ----------
    controller : control.StateSpace
        Discrete.
    y : ndarray, shape (samples, ny)
    limits : (low, high), optional
        Of the controls.
    feedback : ndarray, shape (nk, nu), optional
        L of the anti-windup; see `anti_windup`.

    Returns
    -------
    ndarray, shape (samples, nu)
    """
    A, B, C, D = matrices_of(controller)
    low, high = limits if limits is not None else (-np.inf, np.inf)
    L = np.zeros((len(A), len(C))) if feedback is None else feedback
    x, out = np.zeros(len(A)), np.zeros((len(y), len(C)))
    for k, measured in enumerate(y):
        wanted = C @ x + D @ measured
        out[k] = np.clip(wanted, low, high)
        x = A @ x + B @ measured + L @ (out[k] - wanted)
    return out
