"""The H-infinity norm of a stable loop in plain doubles, where a proof follows.

What it promises is a gain that the loop reaches, up to rounding: no upper bound, no look at the
stability of the loop, which has to be known. :func:`robustpolish.analysis.hinf_norm` promises a
bracket around the norm, proven, and infinity for unstable systems; it takes longer. The inner steps
of a search, and large loops whose bound is proven in ball arithmetic afterwards, can do without.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from robustpolish.analysis.norms.modal.modal_form import modal_form
from robustpolish.analysis.poles.eigen import eigensystem
from robustpolish.arrays import AnyArray, Array
from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.exact.realisation import Realisation
from robustpolish.synthesis.problem.matrices import balancing_scale

if TYPE_CHECKING:
    from robustpolish.analysis.norms.modal.modal_peak import ModalPeak

_STEPS = 12
_MOST_SEEDS = 80
# From more states on modal coordinates are quicker than Hamiltonian matrices.
_MODAL = 40
# For more frequencies at once a reduction of the states pays.
_FEW = 4
# Brackets this narrow, relative, settle a norm in modal coordinates; up to the second width their
# peak is where the Hamiltonian matrix starts from, one step instead of a look at every resonance.
_WIDEST, _WIDEST_START = 1e-4, 1e-2


class QuickNorm(NamedTuple):
    """A gain that is reached, where, and whether nothing larger is in sight.

    ``settled`` is whether the Hamiltonian matrix shows no larger gain than ``value``. Doubles
    cannot tell for norms that are tiny beside the gains that cancel in them. ``frequency`` is
    in rad/s.
    """

    value: float
    frequency: float
    settled: bool


def quick_norm(A: Matrix, B: Matrix, C: Matrix, D: Matrix, tolerance: float = 1e-6) -> QuickNorm:
    """Estimate the norm of a stable continuous-time system.

    Parameters
    ----------
    A, B, C, D : ndarray
    tolerance : float
        Relative; beyond 40 states rounding errors may leave 1e-4.

    Returns
    -------
    QuickNorm

    Notes
    -----
    Bruinsma and Steinbuch, Systems & Control Letters 14 (1990) 287-293.
    """
    scale = state_scale(A, B, C)
    A, B, C = A * scale / scale[:, None], B / scale[:, None], C * scale
    peak = _peak_by_modes(A, B, C, D, tolerance) if len(A) > _MODAL else None
    if peak is None:
        poles: Any = np.linalg.eigvals(A) if A.size else np.zeros(0, complex)
        seeds = np.concatenate([_resonances(poles), [np.inf]])
    else:
        seeds = np.array([peak.frequency])
    norm, where = _highest(A, B, C, D, seeds)
    if peak is not None and peak.upper <= (1 + _WIDEST) * peak.gain:
        return QuickNorm(norm, where, abs(norm - peak.gain) <= _WIDEST * norm)
    if norm == 0 or not np.isfinite(norm) or not A.size:
        return QuickNorm(norm, where, bool(np.isfinite(norm)))
    for _ in range(_STEPS):
        crossings = _crossings(A, B, C, D, norm * (1 + tolerance))
        if crossings is None or not crossings.size:
            return QuickNorm(norm, where, crossings is not None)
        middle = np.concatenate([crossings, (crossings[1:] + crossings[:-1]) / 2])
        higher, there = _highest(A, B, C, D, middle)
        if higher <= norm * (1 + tolerance):
            # Eigenvalues that only look as if they were on the axis.
            return QuickNorm(norm, where, crossings.size <= 2)
        norm, where = higher, there
    return QuickNorm(norm, where, False)


def _peak_by_modes(
    A: Matrix, B: Matrix, C: Matrix, D: Matrix, tolerance: float
) -> ModalPeak | None:
    """Find the peak in modal coordinates; None where rounding errors leave it wide open."""
    if not D.size or D.size > len(A):
        return None
    from robustpolish.analysis.norms.modal.modal_peak import modal_peak  # imports Numba

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
    n = len(A)
    bordered = np.zeros((n + 1, n + 1))
    bordered[:n, :n] = A
    bordered[:n, n], bordered[n, :n] = np.linalg.norm(B, axis=1), np.linalg.norm(C, axis=0)
    return balancing_scale(bordered)[:n]


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
        if found is None or not np.isfinite(found).all():
            return np.full(frequencies.size, np.inf)
        values[: finite.size] = np.linalg.svd(found, compute_uv=False)[:, 0]
    return values


def _responses(A: Matrix, B: Matrix, C: Matrix, D: Matrix, frequencies: Array) -> AnyArray | None:
    """Return the frequency response, or None if a pole is hit."""
    n = len(A)
    if n > _MODAL and frequencies.size > _FEW:
        from robustpolish.synthesis.certificate.frequency_response import responses  # Numba, too

        return responses(A, B, C, D, frequencies)
    shifted = 1j * frequencies[:, None, None] * np.eye(n) - A
    try:
        states = np.linalg.solve(shifted, np.broadcast_to(B, (frequencies.size, *B.shape)))
    except np.linalg.LinAlgError:
        return None
    return C @ states + D


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
