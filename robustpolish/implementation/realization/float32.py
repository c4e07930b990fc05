"""What single precision does to a controller: rounded coefficients, and rounding every sample."""

from __future__ import annotations

from typing import NamedTuple

import control
import numpy as np

from robustpolish.arrays import Matrix, Vector
from robustpolish.implementation.sampled.matrices import named_like
from robustpolish.models.plant.blocks import matrices_of

UNIT = 2.0**-24
"""Largest relative error of one operation in single precision."""

SAMPLES = 10_000
"""Over so many samples the bound on the outputs is taken."""

_TINY = 2.0**-126


class RoundoffBound(NamedTuple):
    """Bounds for measurements of at most one unit each.

    ``per_sample`` : what rounding adds to every control in one sample; ``outputs`` : by how much
    the controls of `SAMPLES` samples from rest differ from those of the controller in doubles,
    rounding of coefficients included; ``size`` : the largest controls there can be.
    """

    per_sample: Vector
    outputs: Vector
    size: Vector


def rounded(controller: control.StateSpace) -> control.StateSpace:
    """Return a controller with its coefficients rounded to single precision."""
    parts = [np.asarray(M, dtype=np.float32).astype(float) for M in matrices_of(controller)]
    return named_like(controller, parts, controller.dt)


def roundoff_bound(controller: control.StateSpace, samples: int = SAMPLES) -> RoundoffBound:
    """Bound the error of a controller that is computed in single precision.

    Parameters
    ----------
    controller : control.StateSpace
        Discrete, in the form in which it is computed.
    samples : int, optional

    Returns
    -------
    RoundoffBound
        Infinite for a controller whose outputs are not bounded over so many samples.

    Notes
    -----
    A sum of m products is off by at most (m + 1) u / (1 - (m + 1) u) times the sum of their
    sizes (N. J. Higham, Accuracy and Stability of Numerical Algorithms, section 3.1); what a sample
    adds reaches later ones through the powers of A, whose sizes are summed.
    """
    A, B, C, D = matrices_of(controller)
    n, ny = A.shape[0], B.shape[1] if A.size else D.shape[1]
    unit = (n + ny + 2) * UNIT
    gamma = unit / (1 - unit)
    y = np.ones(ny)
    direct = np.abs(D) @ y
    if n == 0:
        step = (gamma + UNIT) * direct + _TINY
        return RoundoffBound(step, step, direct)
    with np.errstate(all="ignore"):
        reach, seen, passed = _sums(A, B, C, samples)
        x = reach @ y
        size = np.abs(C) @ x + direct
        # What a sample adds to the states: rounding of sums, of coefficients and of y.
        extra = np.zeros(n)
        for _ in range(20):
            inside = x + passed @ extra
            extra = (gamma + 3 * UNIT) * (np.abs(A) @ inside + np.abs(B) @ y) + _TINY
        inside = x + passed @ extra
        per_sample = (gamma + 3 * UNIT) * (np.abs(C) @ inside + direct) + _TINY
        outputs = seen @ extra + per_sample
    bad = ~np.isfinite(outputs) | (outputs > size * 1e6)
    outputs = np.where(bad, np.inf, outputs)
    return RoundoffBound(np.where(bad, np.inf, per_sample), outputs, size)


def _sums(A: Matrix, B: Matrix, C: Matrix, samples: int) -> tuple[Matrix, Matrix, Matrix]:
    """Return the sums over so many samples of |A^k B|, |C A^k| and |A^k|."""
    reach, seen, passed = np.zeros_like(B), np.zeros_like(C), np.zeros_like(A)
    power = np.eye(len(A))
    for _ in range(samples):
        size = np.abs(power)
        reach, seen, passed = reach + np.abs(power @ B), seen + np.abs(C @ power), passed + size
        power = A @ power
        if not size.max() > 1e-30 or not np.isfinite(size).all():
            break
    return reach, seen, passed
