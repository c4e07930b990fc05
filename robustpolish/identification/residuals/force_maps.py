"""The missing force over the motion at every place, the most suspicious places first."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robustpolish.identification.findings.force_map import ForceMap
from robustpolish.identification.observer.missing_force import Smoothed
from robustpolish.identification.residuals.places import forces_at_places, foretold
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
            follows=foretold(
                place.displacement, place.velocity, place.force, policy.bins, policy.blocks
            ),
        )
        for place in forces_at_places(model, motion.q, motion.v, motion.force, policy.bins)
    ]
    largest = {
        unit: max(f.size for f in found if f.unit == unit) for unit in {f.unit for f in found}
    }
    seen = [f for f in found if f.size > policy.least * largest[f.unit]]
    return tuple(sorted(seen, key=lambda f: -f.follows)[: policy.most])
