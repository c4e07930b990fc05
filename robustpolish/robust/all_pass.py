"""Stable real systems that have a given value at one frequency and its norm at all of them."""

from __future__ import annotations

import math
from typing import Any

import control
import numpy as np
from scipy.linalg import block_diag

from robustpolish.arrays import AnyMatrix, AnyVector, Matrix


def all_pass(value: AnyMatrix, omega: float, step: float = 0.0) -> control.StateSpace:
    """Return a stable real system whose value at a frequency is a matrix of rank one.

    Its largest gain is the norm of the matrix at every frequency: every channel in and out has
    a lag of its own that turns the phase only.

    Parameters
    ----------
    value : ndarray of complex, shape (p, q)
        Of rank one.
    omega : float
        In rad/s, above 0; at 0 and infinity the value has to be real.
    step : float, optional
        Sampling time in s; 0 in continuous time.

    Returns
    -------
    control.StateSpace
    """
    left, sizes, right = np.linalg.svd(value)
    x = math.tan(omega * step / 2) if step else omega
    out, into = _turned(left[:, 0], x, bool(step)), _turned(right[0], x, bool(step))
    dt = step or 0
    gain = float(sizes[0])
    after = control.StateSpace(*_diagonal(out), dt)
    before = control.StateSpace(*_diagonal(into), dt)
    column = np.abs(left[:, 0])[:, None] * gain
    row = np.abs(right[0])[None]
    joined = after * control.StateSpace([], [], [], column @ row, dt) * before
    return control.StateSpace(joined.A, joined.B, joined.C, joined.D, dt)


# A phase nearer to 0 or 180 degrees is rounding, and a lag for it would be absurdly fast or slow.
_REAL = 1e-12

Lag = tuple[float, float, float, float] | tuple[float]


def _turned(values: AnyVector, x: float, discrete: bool) -> list[Lag]:
    """Return for every entry a system of gain 1 with its phase at the frequency x."""
    found: list[Lag] = []
    for entry in values:
        phase = math.atan2(entry.imag, entry.real)
        if abs(entry) == 0 or abs(math.sin(phase)) < _REAL or not 0 < x < math.inf:
            found.append((-1.0 if math.cos(phase) < 0 else 1.0,))
            continue
        # (s - a)/(s + a) has a phase between 0 and pi; its negative covers the others.
        sign = 1.0 if phase > 0 else -1.0
        lead = phase if phase > 0 else phase + math.pi
        a = x * math.tan(lead / 2)
        if discrete:
            pole = (1 - a) / (1 + a)
            found.append((pole, 1.0, sign * (pole**2 - 1), sign * pole))
        else:
            found.append((-a, 1.0, -2 * a * sign, sign))
    return found


def _diagonal(lags: list[Lag]) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    """Return lags side by side."""
    n = sum(len(lag) == 4 for lag in lags)
    D: Any = block_diag(*[[[lag[-1]]] for lag in lags])
    A, B, C = np.zeros((n, n)), np.zeros((n, len(lags))), np.zeros((len(lags), n))
    state = 0
    for i, lag in enumerate(lags):
        if len(lag) == 4:
            A[state, state], B[state, i], C[i, state] = lag[:3]
            state += 1
    return A, B, C, D
