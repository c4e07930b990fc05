"""The missing force over the motion at every place, the most suspicious places first."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robustpolish.arrays import Array
from robustpolish.identification.findings.force_map import ForceMap
from robustpolish.identification.observer.missing_force import Smoothed
from robustpolish.identification.residuals.places import forces_at_places
from robustpolish.models.mechanical import MechanicalModel


@dataclass(frozen=True)
class MapPolicy:
    """How maps are made and chosen.

    Attributes
    ----------
    bins : int
        Cells in each direction: a dozen show a dead zone and a step at standstill, and 3000 samples
        still fill them.
    blocks : int
        Stretches of the record that belong to one half and to the other in turn: many, so that a
        decay has its large and its small swings in both.
    least : float
        Share of the largest missing force of the same unit below which a place is left out: what
        is next to nothing follows from anything.
    most, shown : int
        Maps that are kept, and of these that are drawn in a report: where two masses are joined,
        a force between them shows at both and at their connection.
    tells : float
        Share of the force that has to follow from the motion for a map to say anything.
    """

    bins: int = 12
    blocks: int = 20
    least: float = 0.05
    most: int = 4
    shown: int = 2
    tells: float = 0.1


MAPS = MapPolicy()
"""What maps go by."""


def force_maps(
    model: MechanicalModel, motion: Smoothed, policy: MapPolicy = MAPS
) -> tuple[ForceMap, ...]:
    """Return the missing force over displacement and velocity, by how far these foretell it.

    Parameters
    ----------
    model : MechanicalModel
    motion : Smoothed
        Motion and missing force along a record.
    policy : MapPolicy, optional

    Returns
    -------
    tuple of ForceMap
        None if the motion could not be followed.
    """
    if not all(np.isfinite(part).all() for part in (motion.q, motion.v, motion.force)):
        return ()
    found = [
        ForceMap(
            at=place.at,
            surface=place.surface,
            size=float(np.sqrt(np.mean(place.force**2))),
            follows=foretold(place.displacement, place.velocity, place.force, policy),
        )
        for place in forces_at_places(model, motion.q, motion.v, motion.force, policy.bins)
    ]
    largest = {
        unit: max(f.size for f in found if f.unit == unit) for unit in {f.unit for f in found}
    }
    seen = [f for f in found if f.size > policy.least * largest[f.unit]]
    return tuple(sorted(seen, key=lambda f: -f.follows)[: policy.most])


def foretold(q: Array, v: Array, force: Array, policy: MapPolicy = MAPS) -> float:
    """Return the share of a force's power that the map of one half of a record says of the other.

    Parameters
    ----------
    q, v, force : ndarray, shape (samples,)
    policy : MapPolicy, optional

    Returns
    -------
    float
        From 0 to 1. Cells that only one half visits count as foretold to be zero.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> time = np.arange(4000) / 100
    >>> q, v = np.sin(time) + 0.3 * np.sin(7.3 * time), np.cos(time) + 2.2 * np.cos(7.3 * time)
    >>> foretold(q, v, np.sign(v)) > 0.9, foretold(q, v, rng.standard_normal(4000)) < 0.05
    (True, True)
    """
    total = float(np.sum(force**2))
    if total == 0:
        return 0.0
    bins = policy.bins
    cell = bins * _cells(q, bins) + _cells(v, bins)
    half = (np.arange(force.size) * policy.blocks // force.size) % 2
    left = 0.0
    for this in (0, 1):
        other = half != this
        count = np.bincount(cell[other], minlength=bins**2)
        mean = np.bincount(cell[other], force[other], bins**2) / np.maximum(count, 1)
        left += float(np.sum((force[~other] - mean[cell[~other]]) ** 2))
    return float(np.clip(1 - left / total, 0.0, 1.0))


def _cells(values: Array, bins: int) -> np.ndarray:
    edges = np.linspace(values.min(), values.max(), bins + 1)
    return np.clip(np.searchsorted(edges, values, side="right") - 1, 0, bins - 1)
