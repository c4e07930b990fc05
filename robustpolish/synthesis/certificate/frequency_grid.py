"""Largest singular values of a loop on a frequency grid, as an independent look at its norm."""

from __future__ import annotations

from typing import Any

import control
import flint
import numpy as np

from robustpolish.arrays import Vector
from robustpolish.exact import balls


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


def largest_singular_values(
    system: control.StateSpace, frequencies: Vector, precise: bool = False
) -> Vector:
    """Return the largest singular value of the response at each frequency.

    Parameters
    ----------
    system : control.StateSpace
    frequencies : ndarray
        In rad/s; infinity is allowed in continuous time.
    precise : bool
        Whether to solve for the response with 160 bits, which high gains need.

    Returns
    -------
    ndarray
        Infinite at a pole on the boundary.
    """
    A, B, C, D = (np.asarray(M) for M in (system.A, system.B, system.C, system.D))
    values = np.zeros(frequencies.size)
    if 0 in D.shape:
        return values
    nyquist = _nyquist(system)
    solve = _solve_precisely if precise else np.linalg.solve
    for i, frequency in enumerate(frequencies):
        response = D.astype(complex)
        if np.isfinite(frequency):
            angle = np.pi * frequency / nyquist
            s = np.exp(1j * angle) if np.isfinite(nyquist) else 1j * frequency
            try:
                states = solve(s * np.eye(A.shape[0]) - A, B.astype(complex))
            except (np.linalg.LinAlgError, ZeroDivisionError):
                values[i] = np.inf
                continue
            response = response + _product(C, states) if precise else response + C @ states
        values[i] = np.linalg.svd(response, compute_uv=False)[0]
    return values


def _solve_precisely(A: Any, B: Any) -> Any:
    with balls.precision(160):
        return _complex_ball(A).solve(_complex_ball(B)).mid()


def _product(C: Any, states: Any) -> Any:
    """Multiply before rounding, for the terms may cancel."""
    with balls.precision(160):
        product = _complex_ball(C) * states
        entries = [complex(float(z.real.mid()), float(z.imag.mid())) for z in product.entries()]
    return np.array(entries).reshape(product.nrows(), product.ncols())


def _complex_ball(M: Any) -> Any:
    return flint.acb_mat(M.shape[0], M.shape[1], [complex(z) for z in M.ravel()])


def _nyquist(system: control.StateSpace) -> float:
    """Return the highest frequency in rad/s; pi if the sampling time has no unit."""
    if not system.dt:
        return np.inf
    return np.pi / (1.0 if system.dt is True else float(system.dt))
