"""The H-infinity norm with its peak frequency and a bracket around the true value."""

from __future__ import annotations

import math
from dataclasses import dataclass

import control
import numpy as np
from numpy.typing import NDArray

from robustpolish.analysis._realisation import Realisation, realisation, rescaled
from robustpolish.validation import positive


@dataclass(frozen=True)
class HinfNorm:
    """Largest gain of a system over all frequencies.

    Attributes
    ----------
    value : float
        The norm; infinite if the system is not stable.
    frequency : float
        Where the gain peaks, in rad/s; infinite if only the limit reaches it.
    lower, upper : float
        The true norm lies between the two.
    stable : bool
        Whether all poles are strictly stable.
    reason : str
        How the value was found, or why it is infinite.
    """

    value: float
    frequency: float
    lower: float
    upper: float
    stable: bool
    reason: str

    def __float__(self) -> float:
        return self.value


def hinf_norm(system: control.StateSpace, *, tolerance: float = 1e-9) -> HinfNorm:
    """Compute the H-infinity norm."""
    tolerance = positive("tolerance", tolerance)
    model = realisation("system", system)
    if 0 in model.D.shape:
        return HinfNorm(0.0, 0.0, 0.0, 0.0, True, "there are no inputs or no outputs")
    if model.states == 0:
        gain = float(np.linalg.norm(model.D, 2))
        return HinfNorm(gain, 0.0, gain, gain, True, "a static gain")
    scaled = rescaled(model)
    poles = np.linalg.eigvals(scaled.A)
    margin = 1 - np.abs(poles) if scaled.discrete else -poles.real
    if margin.min() <= 0:
        pole = poles[margin.argmin()] * scaled.time
        where = "outside or on the unit circle" if scaled.discrete else "not in the left half-plane"
        return HinfNorm(math.inf, math.nan, math.inf, math.inf, False, f"pole {pole:.6g} {where}")
    form = _continuous(scaled)
    frequency, lower, upper = _peak(form, tolerance)
    if scaled.discrete:
        frequency = 2 * math.atan(frequency) / scaled.step
    return HinfNorm(
        lower * scaled.gain,
        frequency * scaled.time,
        lower * scaled.gain,
        upper * scaled.gain,
        True,
        "largest singular value at the peak, bounded by the Hamiltonian test",
    )


def _continuous(model: Realisation) -> Realisation:
    """Map z = (1 + s)/(1 - s), which keeps the norm."""
    if not model.discrete:
        return model
    n = model.states
    plus = np.eye(n) + model.A
    inverse = np.linalg.inv(plus)
    return Realisation(
        np.linalg.solve(plus, model.A - np.eye(n)),
        math.sqrt(2) * inverse @ model.B,
        math.sqrt(2) * model.C @ inverse,
        model.D - model.C @ inverse @ model.B,
        False,
    )


def gains(model: Realisation, frequencies: NDArray[np.float64]) -> NDArray[np.float64]:
    """Largest singular values at the given (scaled) frequencies; infinity is allowed."""
    result = np.empty(len(frequencies))
    finite = np.isfinite(frequencies)
    result[~finite] = np.linalg.norm(model.D, 2)
    w = frequencies[finite]
    if w.size:
        resolvent = 1j * w[:, None, None] * np.eye(model.states) - model.A
        B = np.broadcast_to(model.B.astype(complex), (w.size, *model.B.shape))
        G = model.C @ np.linalg.solve(resolvent, B) + model.D
        result[finite] = np.linalg.svd(G, compute_uv=False)[:, 0]
    return result


def _peak(model: Realisation, tolerance: float) -> tuple[float, float, float]:
    poles = np.linalg.eigvals(model.A)
    radius, zeta2 = np.abs(poles), (poles.real / np.abs(poles)) ** 2
    resonance = radius * np.sqrt(np.clip(1 - 2 * zeta2, 0, None))
    seeds = np.unique(np.concatenate([[0.0, np.inf], radius, np.abs(poles.imag), resonance]))
    values = gains(model, seeds)
    best = int(values.argmax())
    frequency, lower = float(seeds[best]), float(values[best])
    for _ in range(40):
        if lower == 0:
            return 0.0, 0.0, 0.0
        upper = lower * (1 + tolerance)
        crossings = _crossings(model, upper)
        if crossings.size == 0:
            break
        trial = np.concatenate([crossings, 0.5 * (crossings[1:] + crossings[:-1])])
        values = gains(model, trial)
        best = int(values.argmax())
        if values[best] <= lower * (1 + tolerance / 2):
            if values[best] > lower:
                frequency, lower = float(trial[best]), float(values[best])
            break
        frequency, lower = float(trial[best]), float(values[best])
    return frequency, lower, lower * (1 + tolerance)


def _crossings(model: Realisation, gamma: float) -> NDArray[np.float64]:
    A, B, C, D = model.A, model.B, model.C, model.D
    R = gamma**2 * np.eye(B.shape[1]) - D.T @ D
    X = np.linalg.solve(R, np.hstack([D.T @ C, B.T]))
    RDC, RB = X[:, : A.shape[0]], X[:, A.shape[0] :]
    closed = A + B @ RDC
    hamiltonian = np.block([[closed, gamma * B @ RB], [-(C.T @ (C + D @ RDC)) / gamma, -closed.T]])
    eigenvalues = np.linalg.eigvals(hamiltonian)
    near = np.abs(eigenvalues.real) <= 1e-7 * np.abs(eigenvalues) + 1e-13 * np.linalg.norm(
        hamiltonian
    )
    return np.unique(np.abs(eigenvalues.imag[near]))
