"""Largest singular values of a loop on a frequency grid, as an independent look at its norm."""

from __future__ import annotations

from typing import Any

import control
import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]


def confirmation_grid(system: control.StateSpace, peak: float) -> Vector:
    """Return frequencies in rad/s: zero, infinity, near `peak`, and at the poles.

    Parameters
    ----------
    system : control.StateSpace
    peak : float
        Where the peak is supposed to be, rad/s; may be zero or infinite.

    Returns
    -------
    ndarray
        For a discrete-time system from 0 to the Nyquist frequency.
    """
    nyquist = _nyquist(system)
    poles: Any = np.linalg.eigvals(system.A) if system.nstates else np.zeros(0, complex)
    if np.isfinite(nyquist):
        own = np.abs(np.angle(poles)) / (np.pi / nyquist)
    else:
        # A resonance peaks near the imaginary part, a corner lies at the absolute value.
        own = np.concatenate([np.abs(poles.imag), np.abs(poles)])
    points = [np.array([0.0, nyquist]), np.unique(own)]
    if np.isfinite(peak):
        away = np.concatenate([[0.0], np.logspace(-7, -0.5, 14)])
        points += [peak * (1 + away), peak * (1 - away)]
    grid = np.unique(np.concatenate(points))
    return grid[grid <= nyquist]


def largest_singular_values(system: control.StateSpace, frequencies: Vector) -> Vector:
    """Return the largest singular value of the response at each frequency (rad/s).

    Points that fall on a pole are infinite.
    """
    A, B, C, D = (np.asarray(M) for M in (system.A, system.B, system.C, system.D))
    values = np.zeros(frequencies.size)
    if 0 in D.shape:
        return values
    nyquist = _nyquist(system)
    for i, frequency in enumerate(frequencies):
        response = D.astype(complex)
        if np.isfinite(frequency):
            s = np.exp(1j * np.pi * frequency / nyquist) if np.isfinite(nyquist) else 1j * frequency
            try:
                response = response + C @ np.linalg.solve(s * np.eye(A.shape[0]) - A, B)
            except np.linalg.LinAlgError:
                values[i] = np.inf
                continue
        values[i] = np.linalg.svd(response, compute_uv=False)[0]
    return values


def _nyquist(system: control.StateSpace) -> float:
    """Return the highest frequency in rad/s; pi if the sampling time has no unit."""
    if not system.dt:
        return np.inf
    return np.pi / (1.0 if system.dt is True else float(system.dt))
