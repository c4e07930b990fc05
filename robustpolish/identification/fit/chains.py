"""Which coordinates of a model hang together."""

from __future__ import annotations

from robustpolish.models.mechanical import MechanicalModel


def connected(model: MechanicalModel) -> list[set[str]]:
    """Return the groups of coordinates that springs, dampers and effects join."""
    groups = [{name} for name in model.dof_names]
    joints = [s.between for s in model.springs] + [d.between for d in model.dampers]
    for joint in [*joints, *(e.at for e in model.effects)]:
        ends = {name for name in joint if name in model.dof_names}
        touched = [g for g in groups if g & ends]
        if len(touched) > 1:
            groups = [g for g in groups if not g & ends] + [set().union(*touched)]
    return groups
