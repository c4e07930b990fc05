"""Machines that differ from a model by as much as its fit leaves open."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robustpolish.arrays import Array
from robustpolish.models import MechanicalModel
from robustpolish.validation import described, invalid, is_whole

# Beyond this share of draws without sense, what is left says little about the machine.
_MOST_REDRAWN = 0.5


@dataclass(frozen=True, eq=False)
class ParameterSamples:
    """Draws of a model's numbers.

    Attributes
    ----------
    model : MechanicalModel
    keys : tuple of str
    values : ndarray, shape (samples, keys)
    nominal : ndarray, shape (keys,)
    left_out : tuple of str
        Keys whose error is not known; they keep their value.
    """

    model: MechanicalModel
    keys: tuple[str, ...]
    values: Array
    nominal: Array
    left_out: tuple[str, ...]


def draw(
    model: MechanicalModel, keys: tuple[str, ...], covariance: Array, samples: int, seed: int
) -> ParameterSamples:
    """Draw numbers of a model.

    A draw in which a mass, a stiffness or a damping changes its sign is no machine of this kind and
    is drawn again.

    Parameters
    ----------
    model : MechanicalModel
    keys : tuple of str
        Of the uncertain numbers.
    covariance : ndarray, shape (keys, keys)
        Infinite or NaN on the diagonal where nothing is known.
    samples, seed : int
    """
    if not is_whole(samples) or samples < 1:
        raise invalid("samples", samples, "a positive number of machines", "Ask for 200.")
    if np.any(np.diag(covariance) < 0):
        raise invalid(
            "standard_errors", described("a negative variance"), "errors of at least 0", "Check it."
        )
    known = np.isfinite(np.diag(covariance))
    used = tuple(key for key, here in zip(keys, known, strict=True) if here)
    left_out = tuple(key for key, here in zip(keys, known, strict=True) if not here)
    if not used:
        raise invalid(
            "learned", described("no number with a known error"), "a fit with standard errors",
            "Pass standard_errors, or fit to data that determines the numbers.",
        )  # fmt: skip
    nominal = np.array([model.parameters[key] for key in used])
    root = _root(covariance[known][:, known])
    sign = np.array([0.0 if key.startswith(("effect", "input")) else 1.0 for key in used])
    sign *= np.sign(nominal)
    rng = np.random.default_rng(seed)
    values = nominal + rng.standard_normal((samples, len(used))) @ root.T
    again = np.flatnonzero(np.any(values * sign < 0, axis=1))
    if again.size <= _MOST_REDRAWN * samples:
        while again.size:
            values[again] = nominal + rng.standard_normal((again.size, len(used))) @ root.T
            again = again[np.any(values[again] * sign < 0, axis=1)]
        return ParameterSamples(model, used, values, nominal, left_out)
    worst = used[int(np.argmax(np.linalg.norm(root, axis=1) / np.maximum(abs(nominal), 1e-300)))]
    raise invalid(
        "standard_errors",
        described(f"an error of {worst} as large as its value"),
        "smaller errors",
        "Hold the number fixed, or measure it better.",
    )


def _root(covariance: Array) -> Array:
    """Return a square root of a covariance, of numbers of very different size."""
    size = np.sqrt(np.diag(covariance))
    safe = np.where(size > 0, size, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(safe, safe))
    return safe[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
