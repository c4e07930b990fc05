"""Distance of each mode from being unreachable, and which modes are."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from robustpolish.analysis.poles.eigen import EPS, eigensystem
from robustpolish.analysis.poles.exact_poles import hidden_poles, sided_poles
from robustpolish.analysis.scaling.decoupled_blocks import decoupled_blocks
from robustpolish.analysis.scaling.units import even_scales, in_units
from robustpolish.exact.rational import EXACT_STATES, rational
from robustpolish.exact.realisation import Realisation


@dataclass(frozen=True)
class Deficiency:
    """One mode: its eigenvalue, distance, leading state's index and verdicts."""

    eigenvalue: complex
    distance: float
    state: int
    deficient: bool
    stable: bool


def deficiencies(model: Realisation, tolerance: float | None) -> list[Deficiency]:
    """Test the pair (A, B) mode by mode, in scaled units, block by block."""
    found: list[Deficiency] = []
    for block in decoupled_blocks(model.A, model.B, np.zeros((0, model.states))):
        if block.states:
            A = model.A[np.ix_(block.states, block.states)]
            B = model.B[np.ix_(block.states, block.inputs)]
            part = _scaled(_pair(model, A, B))
            found += [
                replace(mode, state=block.states[mode.state]) for mode in _modes(part, tolerance)
            ]
    return found


def _pair(model: Realisation, A: NDArray[np.float64], B: NDArray[np.float64]) -> Realisation:
    return replace(model, A=A, B=B, C=np.zeros((0, len(A))), D=np.zeros((0, B.shape[1])))


def _scaled(model: Realisation) -> Realisation:
    """Scale states, time and each input on its own: none of them changes what is reachable."""
    each = [np.array([i]) for i in range(model.B.shape[1])]
    return in_units(model, even_scales(model, each, []))


def _modes(model: Realisation, tolerance: float | None) -> list[Deficiency]:
    A, B, n = model.A, model.B, model.states
    spectrum = eigensystem(A)
    values = spectrum.values
    size = float(np.linalg.norm(np.hstack([A, B]), 2))
    limit = (100 * n * EPS if tolerance is None else tolerance) * size
    hidden = hidden_poles(rational(A), rational(B), model.discrete) if n <= EXACT_STATES else []
    matched = _matched(values, hidden)
    margins = 1 - np.abs(values) if model.discrete else -values.real
    sides = {}
    if n <= EXACT_STATES and (np.abs(margins) <= spectrum.errors).any():
        poles = sided_poles(rational(A), model.discrete)
        sides = _matched(values, [(pole, side < 0) for pole, side in poles])
    result = []
    for i, value in enumerate(values):
        if value.imag < 0:
            continue
        distance = _distance(A, B, values, i)
        deficient = distance <= limit
        stable = bool(margins[i] > spectrum.errors[i])
        if i in matched:
            value, stable = matched[i]
            distance, deficient = 0.0, True
        elif i in sides:
            stable = sides[i][1]
        relative = distance / size if size else 0.0
        leader = int(spectrum.shares[:, i].argmax())
        value = complex(value) * model.time
        result.append(Deficiency(value, relative, leader, deficient, stable))
    return result


def _matched(
    values: NDArray[np.complex128], exact: list[tuple[complex, bool]]
) -> dict[int, tuple[complex, bool]]:
    """Assign each exact eigenvalue to the nearest computed one that is left."""
    free = set(range(len(values)))
    matched = {}
    for pole, stable in exact:
        nearest = min(free, key=lambda i: abs(values[i] - pole))
        free.remove(nearest)
        matched[nearest] = (pole, stable)
    return matched


def _distance(
    A: NDArray[np.float64], B: NDArray[np.float64], values: NDArray[np.complex128], which: int
) -> float:
    """Minimise the smallest singular value of (A - x I, B) over x near one eigenvalue.

    For the left singular vector u at x, the best x is u* A u: it can
    only lessen the norm of u* (A - x I, B), so every step is downhill. It
    ends where another eigenvalue becomes the nearest.
    """
    n = A.shape[0]
    x, best = complex(values[which]), np.inf
    for _ in range(30):
        u, s, _ = np.linalg.svd(np.hstack([A - x * np.eye(n), B]), full_matrices=False)
        smallest = float(s[-1])
        if smallest >= best * (1 - 1e-3):
            return min(best, smallest)
        best = smallest
        x = complex(u[:, -1].conj() @ A @ u[:, -1])
        if np.abs(values - x).min() < abs(values[which] - x):
            break
    return best
