"""Tell a wrong gain from wrong masses and springs.

The error cannot: a machine that is lighter and softer by one factor answers like one whose
input is larger, or whose sensor shows too much. But masses and springs do not err by the same
factor by chance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robustpolish.effects import Effect
from robustpolish.identification.fit.chains import connected
from robustpolish.models.mechanical import MechanicalModel

LEAST = 0.1
SPREAD = 0.3


@dataclass(frozen=True)
class WrongGain:
    """A gain that explains what a refit did to masses and springs.

    Attributes
    ----------
    effect : Effect
    alike : tuple of Effect
        Effects that would explain it as well.
    reason : str
    """

    effect: Effect
    alike: tuple[Effect, ...]
    reason: str


def wrong_gains(before: MechanicalModel, after: MechanicalModel) -> list[WrongGain]:
    """Return the gains that a refit hides in a common factor of masses and springs.

    Parameters
    ----------
    before, after : MechanicalModel
        The model as it was, and refitted.
    """
    old, new = before.parameters, after.parameters
    found = []
    there = {(e.kind, e.at) for e in after.effects}
    for group in connected(before):
        inputs = [i for i in before.inputs if i.imposes is None and i.on[0] in group]
        if len(inputs) != 1 or ("input_gain", (inputs[0].name,)) in there:
            continue
        logs = [np.log(new[key] / old[key]) for key in _numbers(before, group, old, new)]
        if len(logs) < 2:
            continue
        gain_key = f"input.{inputs[0].name}.gain"
        common = float(np.log(new[gain_key] / old[gain_key]) - np.mean(logs))
        if abs(common) < LEAST or np.ptp(logs) > SPREAD * abs(common):
            continue
        gain = float(np.exp(common))
        outputs = [o for o in before.outputs if group.intersection(o.of)]
        alike = [Effect("sensor_gain", (outputs[0].name,))] if len(outputs) == 1 else []
        found.append(
            WrongGain(
                Effect("input_gain", (inputs[0].name,), {"gain": gain}),
                tuple(alike),
                f"Masses and springs err by one factor: {inputs[0].name} acts {gain:.3g} times "
                "as strongly as the record says.",
            )
        )
    return found


def _numbers(
    model: MechanicalModel, group: set[str], old: dict[str, float], new: dict[str, float]
) -> list[str]:
    """Return the keys of positive masses and stiffnesses in a group."""
    keys = [f"dof.{d.name}.{'inertia' if d.rotational else 'mass'}" for d in model.dofs
            if d.name in group]  # fmt: skip
    keys += [
        f"spring[{i}].stiffness"
        for i, s in enumerate(model.springs)
        if group.intersection(s.between)
    ]
    return [key for key in keys if old[key] > 0 and new[key] > 0]
