"""Which masses give the forces of a record their unit."""

from __future__ import annotations

from robustpolish.identification.chains import connected
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.parts import FORCE


def units_of_force(model: MechanicalModel) -> set[str]:
    """Return a mass of each chain in which no force is known: it stays, and gives them a unit.

    A free decay, or a motion under an imposed one, shows ratios of masses and springs only. So
    does a record all of whose inputs or outputs have an unknown gain.
    """
    gains = {(e.kind, e.at[0]) for e in model.effects}
    chosen = set()
    for group in connected(model):
        known = any(
            i.imposes is None and group.intersection(i.on) and ("input_gain", i.name) not in gains
            for i in model.inputs
        )
        known |= any(o.quantity == FORCE and group.intersection(o.of) for o in model.outputs)
        seen = [o.name for o in model.outputs if group.intersection(o.of)]
        known &= not seen or any(("sensor_gain", name) not in gains for name in seen)
        masses = [d for d in model.dofs if d.name in group and d.name in model.free]
        if not known and masses:
            chosen.add(max(masses, key=lambda d: d.mass).name)
    return chosen


def with_units_of_force(model: MechanicalModel, reference: MechanicalModel) -> MechanicalModel:
    """Return the model with those masses as they were, the rest of their chains in proportion.

    Parameters
    ----------
    model, reference : MechanicalModel
        Fitted, and before any fit.
    """
    values, known, changes = model.parameters, reference.parameters, {}
    for name in units_of_force(model):
        group = next(g for g in connected(model) if name in g)
        inside = {
            f"dof.{d.name}.{'inertia' if d.rotational else 'mass'}"
            for d in model.dofs
            if d.name in group
        }
        inside |= {
            f"spring[{i}].stiffness" for i, s in enumerate(model.springs) if group & {*s.between}
        }
        inside |= {
            f"damper[{i}].damping" for i, d in enumerate(model.dampers) if group & {*d.between}
        }
        key = f"dof.{name}.{'inertia' if model.dof(name).rotational else 'mass'}"
        if known.get(key) and values[key] != known[key]:
            changes |= {k: values[k] * known[key] / values[key] for k in inside}
    return model.with_parameters(changes) if changes else model
