"""The norm that a loop achieves, computed, confirmed on a frequency grid, and rounded."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import control
import flint
import numpy as np
from numpy.typing import NDArray

from robustpolish.analysis import HinfNorm, h2_norm, hinf_norm
from robustpolish.deadline import look_at_the_clock
from robustpolish.exact import balls
from robustpolish.synthesis.certificate.quick_norm import quick_norm

# Up to so many states a norm that doubles cannot settle is computed in higher precision; up to
# fewer, where that takes no time, every norm is.
_PRECISE_STATES = 24
_ALWAYS_PRECISE = 12
_LARGE = 60
# How much, relative, the norm may change when the loop's matrices are rounded to doubles.
_ROUNDING = 1e-2


def achieved_hinf(
    system: control.StateSpace,
    rounded: control.StateSpace,
    level: float,
    reasons: list[str],
) -> tuple[float, float | None]:
    """Compute the norm, confirm it on a grid that is dense around its peak, and round the loop.

    Parameters
    ----------
    system : control.StateSpace
        The stable loop, connected in ball arithmetic.
    rounded : control.StateSpace
        The same, connected in doubles.
    level : float
        Norms below it cannot be told from zero in doubles.
    reasons : list of str
        What speaks against the loop is appended.

    Returns
    -------
    norm : float
    frequency : float or None
        Where it peaks, rad/s.
    """
    precise = system.nstates <= _ALWAYS_PRECISE
    result, gains, grid = _norm_and_grid(system, precise)
    if not precise and system.nstates <= _PRECISE_STATES:
        precise = not (
            result.upper <= result.value * (1 + 1e-3) and _agree(result.value, gains, level)
        )
        if precise:
            result, gains, grid = _norm_and_grid(system, precise)
    value = float(result.value)
    if not np.isfinite(value):
        reasons.append(f"the H-infinity norm could not be computed: {result.reason}")
        return np.inf, None
    largest = float(gains.max(initial=0.0))
    if not _agree(value, gains, level):
        reasons.append(f"the frequency response reaches {largest:.6g}, the norm was {value:.6g}")
    other = _largest_singular_values(rounded, grid, precise)
    if not abs(other.max(initial=0.0) - largest) <= _ROUNDING * largest + level:
        reasons.append(
            "the loop does not bear rounding: with its matrices in doubles its norm is "
            f"{float(other.max(initial=0.0)):.6g} instead of {largest:.6g}"
        )
    # What rounding adds counts as well: no machine keeps the matrices exactly.
    for seen in (gains, other):
        if seen.max(initial=0.0) > value * (1 + 1e-9):
            value, where = float(seen.max()), float(grid[int(np.argmax(seen))])
            result = replace(result, frequency=where)
    beside = _norm(rounded, precise=False)
    if value * (1 + 1e-9) < beside.value <= value * (1 + _ROUNDING) + level:
        value, result = float(beside.value), beside
    return value, float(result.frequency)


def _norm_and_grid(
    system: control.StateSpace, precise: bool
) -> tuple[HinfNorm, NDArray[np.float64], NDArray[np.float64]]:
    """Return the norm, the largest singular values on a grid, and the grid."""
    result = _norm(system, precise)
    if not np.isfinite(result.value):
        return result, np.zeros(0), np.zeros(0)
    grid = _confirmation_grid(system, float(result.frequency))
    return result, _largest_singular_values(system, grid, precise), grid


def _norm(system: control.StateSpace, precise: bool) -> HinfNorm:
    """Return the norm; a proof in balls follows, so that none is needed for large loops."""
    if system.nstates > _LARGE and not system.dt:
        A, B, C, D = (np.asarray(M) for M in (system.A, system.B, system.C, system.D))
        value, where, settled = quick_norm(A, B, C, D)
        upper = value * (1 + 1e-6) if settled else np.inf
        return HinfNorm(value, where, value, upper, True, "estimated in doubles")
    return hinf_norm(system, exact=precise)


def _agree(value: float, gains: NDArray[np.float64], level: float) -> bool:
    """Tell whether the largest gain on the grid is the norm."""
    return bool(abs(gains.max(initial=0.0) - value) <= 5e-4 * value + level)


def achieved_h2(system: control.StateSpace, reasons: list[str]) -> float:
    """Compute the H2 norm; what speaks against it is appended to `reasons`."""
    result = h2_norm(system, tolerance=1e-4)  # the proof bounds it closer
    if not np.isfinite(result.value):
        reasons.append(f"the H2 norm is not finite: {result.reason}")
    return float(result.value)


def _confirmation_grid(system: control.StateSpace, peak: float) -> NDArray[np.float64]:
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


def _largest_singular_values(
    system: control.StateSpace, frequencies: NDArray[np.float64], precise: bool = False
) -> NDArray[np.float64]:
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
        look_at_the_clock()
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
        A, B = _complex_ball(A), _complex_ball(B)
        try:
            return A.solve(B, algorithm="lu").mid()
        except ZeroDivisionError:  # slower, and succeeds on worse conditioned matrices
            return A.solve(B, algorithm="precond").mid()


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
