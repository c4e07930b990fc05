"""Where a sampled loop has its largest gain."""

from __future__ import annotations

import numpy as np

from robustpolish.implementation.sampled.energy_section import Section
from robustpolish.implementation.sampled.induced_norm import period_section
from robustpolish.implementation.sampled.scaled_map import ScaledMap

_GRID = 200
_REFINED = 3


def peak_frequency(loop: ScaledMap, gamma: float) -> float | None:
    """Return where the discrete loop that stands for the sampled one at gamma has gain one.

    Parameters
    ----------
    loop : ScaledMap
    gamma : float
        A little above the norm.

    Returns
    -------
    float or None
        rad/s, from 0 to half the sample rate.
    """
    section = period_section(loop, gamma)
    if not isinstance(section, Section):
        return None
    poles = np.linalg.eigvals(section.A)
    angles = np.concatenate(
        [np.logspace(-6, 0, _GRID) * np.pi, np.linspace(0, np.pi, _GRID), np.abs(np.angle(poles))]
    )
    angles = np.unique(angles)
    values = _gains(section, angles)
    for _ in range(_REFINED):
        best = int(np.argmax(values))
        low, high = angles[max(best - 1, 0)], angles[min(best + 1, angles.size - 1)]
        angles = np.linspace(low, high, 41)
        values = _gains(section, angles)
    return float(angles[int(np.argmax(values))]) / loop.map.period


def _gains(section: Section, angles: np.ndarray) -> np.ndarray:
    reach, see = _root(section.G), _root(section.Q).T
    eye = np.eye(len(section.A))
    shifted = np.exp(1j * angles)[:, None, None] * eye - section.A
    states = np.linalg.solve(shifted, np.broadcast_to(reach, (angles.size, *reach.shape)))
    return np.linalg.svd(see @ states, compute_uv=False)[:, 0]


def _root(M: np.ndarray) -> np.ndarray:
    values, vectors = np.linalg.eigh(M)
    return vectors * np.sqrt(np.maximum(values, 0))
