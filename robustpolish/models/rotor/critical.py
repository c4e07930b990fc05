"""Speeds at which an unbalance meets a whirl of its own frequency."""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigh

from robustpolish.arrays import Vector
from robustpolish.models.rotor.second_order import SecondOrder
from robustpolish.validation import described, invalid


def critical_speeds(system: SecondOrder) -> Vector:
    """Return where the undamped rotor whirls as fast as it spins, in rad/s, rising.

    Parameters
    ----------
    system : SecondOrder
        Of two planes with as many coordinates each, x before y.

    Returns
    -------
    ndarray, shape (speeds,)

    Raises
    ------
    InvalidInputError
        If nothing holds the rotor.
    """
    K = (system.stiffness + system.stiffness.T) / 2
    sizes = np.sqrt(np.diag(K))
    if not (sizes > 0).all() or system.normal_modes[0].min(initial=np.inf) == 0:
        what = described("a rotor that nothing holds")
        raise invalid("bearings", what, "bearings that hold the rotor", "Add a bearing.")
    # K X = speed^2 (M - j G) X is what an unbalance meets; X turns as exp(j speed t).
    spun = (system.mass - 1j * system.gyroscopic) / np.outer(sizes, sizes)
    inverse, shapes = eigh(spun, K / np.outer(sizes, sizes))
    x, y = np.split(shapes / sizes[:, None], 2)
    forward = np.linalg.norm(x + 1j * y, axis=0) > 1e-6 * np.linalg.norm(x, axis=0)
    listed = forward & (inverse > 1e-14 * inverse[-1])
    speeds = np.sort(1 / np.sqrt(inverse[listed]))
    # Without gyroscopic moments both ways round are one speed.
    return speeds[np.r_[True, np.diff(speeds) > 1e-9 * speeds[1:]][: len(speeds)]]
