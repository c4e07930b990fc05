"""The peak of the gain in double precision: quick, good for a start, with an honest error bar."""

from __future__ import annotations

import math

import numpy as np
import scipy.linalg as sla
from numpy.typing import NDArray

from robustpolish.analysis.poles.eigen import EPS, eigensystem
from robustpolish.arrays import Array, Vector
from robustpolish.exact.realisation import Realisation


def cayley(model: Realisation) -> Realisation:
    """Map a discrete system by z = (1 + s)/(1 - s), which keeps its gains; others stay."""
    if not model.discrete or model.states == 0:
        return model
    one = np.eye(model.states)
    factors = sla.lu_factor(model.A + one, check_finite=False)
    B = sla.lu_solve(factors, model.B, check_finite=False)
    return Realisation(
        sla.lu_solve(factors, model.A - one, check_finite=False),
        math.sqrt(2) * B,
        math.sqrt(2) * sla.lu_solve(factors, model.C.T, trans=1, check_finite=False).T,
        model.D - model.C @ B,
        False,
    )


def gains(model: Realisation, frequencies: Vector) -> Vector:
    """Return the largest singular value at each frequency x, s = i x; infinity is allowed."""
    result = np.empty(len(frequencies))
    if model.states == 0:
        return np.full(len(frequencies), float(np.linalg.norm(model.D, 2)))
    finite = np.isfinite(frequencies)
    result[~finite] = np.linalg.norm(model.D, 2)
    x = frequencies[finite]
    for start in range(0, x.size, 64):  # bounds the memory for large systems
        part = x[start : start + 64]
        resolvent = np.broadcast_to(-model.A, (part.size, *model.A.shape)).astype(complex)
        diagonal = np.arange(model.states)
        resolvent[:, diagonal, diagonal] += 1j * part[:, None]
        B = np.broadcast_to(model.B.astype(complex), (part.size, *model.B.shape))
        try:
            G = model.C @ np.linalg.solve(resolvent, B) + model.D
        except np.linalg.LinAlgError:  # a pole on the axis to rounding
            result[finite] = 0.0
            return result
        where = np.flatnonzero(finite)[start : start + 64]
        result[where] = np.nan_to_num(np.linalg.svd(G, compute_uv=False)[:, 0])
    return result


def largest_response(model: Realisation) -> float:
    """Return the largest gain at the poles' frequencies, a rough size of the norm."""
    if 0 in model.D.shape:
        return 0.0
    return float(gains(model, _seeds(np.linalg.eigvals(model.A).astype(complex))).max())


def peak(
    model: Realisation, poles: NDArray[np.complex128], tolerance: float
) -> tuple[float, float]:
    """Climb to the largest gain by the two-step iteration of Bruinsma and Steinbuch.

    Returns
    -------
    frequency, gain : float
        Not certified: crossings that rounding hides are missed.
    """
    seeds = _seeds(poles)
    values = gains(model, seeds)
    best = int(values.argmax())
    frequency, gain = float(seeds[best]), float(values[best])
    for _ in range(30):
        if gain == 0:
            break
        crossings = _crossings(model, gain * (1 + tolerance))
        if crossings.size == 0:
            break
        trial = np.concatenate([crossings, 0.5 * (crossings[1:] + crossings[:-1])])
        values = gains(model, trial)
        best = int(values.argmax())
        if values[best] <= gain:
            break
        done = values[best] <= gain * (1 + tolerance)
        frequency, gain = float(trial[best]), float(values[best])
        if done:
            break
    return frequency, gain


def _seeds(poles: NDArray[np.complex128]) -> Vector:
    radius = np.abs(poles)
    damping = np.divide(poles.real, radius, out=np.ones_like(radius), where=radius > 0)
    resonance = radius * np.sqrt(np.clip(1 - 2 * damping**2, 0, None))
    return np.unique(np.concatenate([[0.0, np.inf], radius, np.abs(poles.imag), resonance]))


@np.errstate(over="ignore", invalid="ignore")
def hamiltonian(model: Realisation, gamma: float) -> Array | None:
    """Return the matrix whose imaginary eigenvalues are crossings; None at the gain of D.

    Entries beyond doubles are infinite.
    """
    A, B, C, D = model.A, model.B, model.C, model.D
    if not D.any():
        return np.block([[A, B @ B.T / gamma], [-(C.T @ C) / gamma, -A.T]])
    R = gamma * gamma * np.eye(B.shape[1]) - D.T @ D
    try:
        X = np.linalg.solve(R, np.hstack([D.T @ C, B.T]))
    except np.linalg.LinAlgError:
        return None
    RDC, RB = X[:, : A.shape[0]], X[:, A.shape[0] :]
    closed = A + B @ RDC
    return np.block([[closed, gamma * B @ RB], [-(C.T @ (C + D @ RDC)) / gamma, -closed.T]])


@np.errstate(over="ignore", invalid="ignore")  # what has no size has no near eigenvalues
def _crossings(model: Realisation, gamma: float) -> Vector:
    H = hamiltonian(model, gamma)
    if H is None or not np.isfinite(H).all():
        return np.empty(0)
    eigenvalues = np.linalg.eigvals(H)
    near = np.abs(eigenvalues.real) <= 1e-7 * np.abs(eigenvalues) + 100 * EPS * np.linalg.norm(H)
    return np.unique(np.abs(eigenvalues.imag[near]))


def bounds_gain(model: Realisation, gamma: float) -> bool:
    """Say whether the Hamiltonian has no imaginary eigenvalue, rounding errors considered."""
    H = hamiltonian(model, gamma)
    if H is None or not np.isfinite(H).all():
        return False
    spectrum = eigensystem(H)
    return bool((np.abs(spectrum.values.real) > spectrum.errors).all())
