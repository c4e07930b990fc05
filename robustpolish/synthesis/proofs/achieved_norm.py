"""The norm that a loop achieves, computed, confirmed on a frequency grid, and rounded."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import control
import flint
import numpy as np
from numpy.typing import NDArray

from robustpolish.base.arrays import AnyArray, Array
from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.budget import check_deadline
from robustpolish.linear.arithmetic import balls
from robustpolish.linear.arithmetic.realisation import Realisation
from robustpolish.linear.delayed_systems import resolvent_response
from robustpolish.linear.norms.hinf import HinfNorm, hinf_norm
from robustpolish.linear.norms.modal_form import Peak, modal_form
from robustpolish.linear.stability import eigensystem
from robustpolish.synthesis.problem.matrices import balancing_scale

# The H-infinity norm of a stable loop in plain doubles, where a proof follows.
#
# What it promises is a gain that the loop reaches, up to rounding: no upper bound, no look at the
# stability of the loop, which has to be known. :func:`robustpolish.hinf_norm` promises a
# bracket around the norm, proven, and infinity for unstable systems; it takes longer. The inner
# steps of a search, and large loops whose bound is proven in ball arithmetic afterwards, can do
# without.

_STEPS = 12
_MOST_SEEDS = 80
# From more states on modal coordinates are quicker than Hamiltonian matrices.
_MODAL = 40
# For more frequencies at once a reduction of the states pays.
_FEW = 4
# Brackets this narrow, relative, settle a norm in modal coordinates; up to the second width their
# peak is where the Hamiltonian matrix starts from, one step instead of a look at every resonance.
_WIDEST, _WIDEST_START = 1e-4, 1e-2


class EstimatedNorm(NamedTuple):
    """A gain that is reached, where, and whether nothing larger is in sight.

    ``settled`` is whether the Hamiltonian matrix shows no larger gain than ``value``. Doubles
    cannot tell for norms that are tiny beside the gains that cancel in them. ``frequency`` is
    in rad/s.
    """

    value: float
    frequency: float
    settled: bool


def estimate_norm(
    A: Matrix, B: Matrix, C: Matrix, D: Matrix, tolerance: float = 1e-6
) -> EstimatedNorm:
    """Estimate the norm of a stable continuous-time system.

    Parameters
    ----------
    A, B, C, D : ndarray
    tolerance : float
        Relative; beyond 40 states rounding errors may leave 1e-4.

    Returns
    -------
    EstimatedNorm

    Notes
    -----
    Bruinsma and Steinbuch, Systems & Control Letters 14 (1990) 287-293.
    """
    scale = state_scale(A, B, C)
    A, B, C = A * scale / scale[:, None], B / scale[:, None], C * scale
    peak = _modal_peak(A, B, C, D, tolerance) if len(A) > _MODAL else None
    if peak is None:
        poles: Any = np.linalg.eigvals(A) if A.size else np.zeros(0, complex)
        seeds = np.concatenate([_resonances(poles), [np.inf]])
    else:
        seeds = np.array([peak.frequency])
    norm, where = _highest(A, B, C, D, seeds)
    if peak is not None and peak.upper <= (1 + _WIDEST) * peak.gain:
        return EstimatedNorm(norm, where, abs(norm - peak.gain) <= _WIDEST * norm)
    if norm == 0 or not np.isfinite(norm) or not A.size:
        return EstimatedNorm(norm, where, bool(np.isfinite(norm)))
    for _ in range(_STEPS):
        crossings = _crossings(A, B, C, D, norm * (1 + tolerance))
        if crossings is None or not crossings.size:
            return EstimatedNorm(norm, where, crossings is not None)
        middle = np.concatenate([crossings, (crossings[1:] + crossings[:-1]) / 2])
        higher, there = _highest(A, B, C, D, middle)
        if higher <= norm * (1 + tolerance):
            # Eigenvalues that only look as if they were on the axis.
            return EstimatedNorm(norm, where, crossings.size <= 2)
        norm, where = higher, there
    return EstimatedNorm(norm, where, False)


def _modal_peak(A: Matrix, B: Matrix, C: Matrix, D: Matrix, tolerance: float) -> Peak | None:
    """Find the peak in modal coordinates; None where rounding errors leave it wide open."""
    if not D.size or D.size > len(A):
        return None
    from robustpolish.linear.norms.modal_peak import modal_peak

    form = modal_form(Realisation(A, B, C, D, False), eigensystem(A), False)
    if form is None or not form.stable:
        return None
    return modal_peak(form, tolerance, max(tolerance, _WIDEST_START))


def _highest(A: Matrix, B: Matrix, C: Matrix, D: Matrix, frequencies: Array) -> tuple[float, float]:
    gains = _gains(A, B, C, D, frequencies)
    best = int(np.argmax(gains))
    return float(gains[best]), float(frequencies[best])


def state_scale(A: Matrix, B: Matrix, C: Matrix) -> Matrix:
    """Balance the states by powers of two, with all inputs and all outputs as one more state."""
    into, out = np.linalg.norm(B, axis=1), np.linalg.norm(C, axis=0)
    return balancing_scale(np.block([[A, into[:, None]], [out[None, :], np.zeros((1, 1))]]))[:-1]


def _resonances(poles: Any) -> Array:
    """Return the frequencies at which poles may peak, the least damped ones first."""
    size = np.abs(poles)
    damping = -poles.real / np.where(size > 0, size, 1)
    order = np.argsort(damping)[:_MOST_SEEDS]
    peaks = size * np.sqrt(np.clip(1 - 2 * damping**2, 0, None))
    found = [np.zeros(1), np.abs(poles.imag)[order], size[order], peaks[order]]
    return np.unique(np.concatenate(found))


def _gains(A: Matrix, B: Matrix, C: Matrix, D: Matrix, frequencies: Array) -> Array:
    finite = frequencies[np.isfinite(frequencies)]
    values = np.zeros(frequencies.size)
    if not np.isfinite(frequencies).all() and D.size:
        values[-1] = np.linalg.norm(D, 2)
    n = len(A)
    if n and finite.size:
        found = _responses(A, B, C, D, finite)
        if not np.isfinite(found).all():
            return np.full(frequencies.size, np.inf)
        values[: finite.size] = np.linalg.svd(found, compute_uv=False)[:, 0]
    return values


def _responses(A: Matrix, B: Matrix, C: Matrix, D: Matrix, frequencies: Array) -> AnyArray:
    """Return the frequency response, which is not finite where a pole is hit."""
    if len(A) > _MODAL and frequencies.size > _FEW:
        from robustpolish.synthesis.proofs.frequency_response import responses

        return responses(A, B, C, D, frequencies)
    return resolvent_response(A, B, C, D, 1j * frequencies)


def _crossings(A: Matrix, B: Matrix, C: Matrix, D: Matrix, gamma: float) -> Array | None:
    """Return the frequencies at which a singular value equals gamma."""
    gap = gamma * gamma * np.eye(B.shape[1]) - D.T @ D
    try:
        solved = np.linalg.solve(gap, np.hstack([D.T @ C, B.T]))
    except np.linalg.LinAlgError:
        return None
    n = len(A)
    At = A + B @ solved[:, :n]
    H = np.block(
        [[At, gamma * B @ solved[:, n:]], [-(C.T @ (C + D @ solved[:, :n])) / gamma, -At.T]]
    )
    if not np.isfinite(H).all():
        return None
    values: Any = np.linalg.eigvals(H)
    level = 1e-7 * np.abs(values) + 1e-13 * np.linalg.norm(H)
    return np.unique(np.abs(values.imag[np.abs(values.real) <= level]))


# Up to so many states a norm that doubles cannot settle is computed in higher precision; up to
# fewer, where that takes no time, every norm is.
_PRECISE_STATES = 24
_ALWAYS_PRECISE = 12
_LARGE = 60
# How much, relative, the norm may change when the loop's matrices are rounded to doubles.
_ROUNDING = 1e-2


def achieved_hinf(
    system: control.StateSpace, rounded: control.StateSpace, level: float, reasons: list[str]
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
    narrow = result.upper <= result.value * (1 + 1e-3)
    doubtful = not (narrow and _grid_confirms(result.value, gains, level))
    if not precise and system.nstates <= _PRECISE_STATES and doubtful:
        precise = True
        result, gains, grid = _norm_and_grid(system, precise)
    value = float(result.value)
    if not np.isfinite(value):
        reasons.append(f"the H-infinity norm could not be computed: {result.reason}")
        return np.inf, None
    largest = float(gains.max(initial=0.0))
    if not _grid_confirms(value, gains, level):
        reasons.append(f"the frequency response reaches {largest:.6g}, the norm was {value:.6g}")
    other = _largest_singular_values(rounded, grid, precise)
    rough = float(other.max(initial=0.0))
    if not abs(rough - largest) <= _ROUNDING * largest + level:
        reasons.append(
            "the loop does not bear rounding: with its matrices in doubles its norm is "
            f"{rough:.6g} instead of {largest:.6g}"
        )
    # What rounding adds counts as well: no machine keeps the matrices exactly.
    for seen in (gains, other):
        if seen.max(initial=0.0) > value * (1 + 1e-9):
            value = float(seen.max())
            result = replace(result, frequency=float(grid[int(np.argmax(seen))]))
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
        value, where, settled = estimate_norm(A, B, C, D)
        upper = value * (1 + 1e-6) if settled else np.inf
        return HinfNorm(value, where, value, upper, True, "estimated in doubles")
    return hinf_norm(system, exact=precise)


def _grid_confirms(value: float, gains: NDArray[np.float64], level: float) -> bool:
    """Tell whether the largest gain on the grid is the norm."""
    return bool(abs(gains.max(initial=0.0) - value) <= 5e-4 * value + level)


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
    nyquist = _nyquist_frequency(system)
    poles: Any = np.linalg.eigvals(system.A) if system.nstates else np.zeros(0, complex)
    # A resonance peaks near the imaginary part, a corner lies at the absolute value.
    own = np.concatenate([np.abs(poles.imag), np.abs(poles)])
    if np.isfinite(nyquist):
        own = np.abs(np.angle(poles)) / (np.pi / nyquist)
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
    nyquist = _nyquist_frequency(system)
    exact = [balls.ball(M) for M in (A, B, C, D)]
    for i, frequency in enumerate(frequencies if D.size else ()):
        check_deadline()
        s, response = None, D
        if np.isfinite(frequency):
            angle = np.pi * frequency / nyquist
            s = complex(np.exp(1j * angle) if np.isfinite(nyquist) else 1j * frequency)
        try:
            if precise:
                with balls.precision(160):
                    point = None if s is None else flint.acb(s)
                    response = balls.midpoint(balls.transfer_matrix(*exact, point))  # pyright: ignore[reportCallIssue]
            elif s is not None:
                response = D + C @ np.linalg.solve(s * np.eye(len(A)) - A, B.astype(complex))
            values[i] = np.linalg.svd(response, compute_uv=False)[0]
        except (np.linalg.LinAlgError, ZeroDivisionError):
            values[i] = np.inf
    return values


def _nyquist_frequency(system: control.StateSpace) -> float:
    """Return the highest frequency in rad/s; pi if the sampling time has no unit."""
    if not system.dt:
        return np.inf
    return np.pi / (1.0 if system.dt is True else float(system.dt))
