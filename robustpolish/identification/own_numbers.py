"""Refit a model's own numbers before anything is said to be missing."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robustpolish.identification.chains import connected
from robustpolish.identification.evaluation import FREE
from robustpolish.identification.homotopy import Stage, best_stage, homotopy, judge
from robustpolish.identification.observer import Level
from robustpolish.identification.setting import Setting
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.parts import FORCE

_LEVELS = (Level(1.0), Level(0.1), FREE)
_STEPS = 20
# The direct fit has to be better by so much where both are far from the noise.
_BETTER = 0.8
# A factor is worth settling beyond this, and may cost so much of the error.
_UNCHANGED = 0.01


class OwnNumbers(NamedTuple):
    """The refitted model, judged, and the one whose fit was led by the data."""

    stage: Stage
    guided: MechanicalModel


def refit_own(model: MechanicalModel, setting: Setting) -> OwnNumbers:
    """Fit the numbers of a model as it is, effects of its own included.

    A fit that is led by the data finds numbers that are far off; one that runs freely from the
    start keeps those that are nearly right already, where the data says little about them while it
    leads. Chains that hang together by nothing are judged apart.

    Parameters
    ----------
    model : MechanicalModel
    setting : Setting
    """
    pieces = setting.trial if model.free else setting.estimation  # quick where nothing swings
    stages = homotopy(model, setting, pieces, model, _LEVELS)
    stage = best_stage(stages, setting)
    guided = stages[min(1, len(stages) - 1)].model
    if np.any(stage.error * _BETTER > setting.scales.noise):
        stage = _directly(stage, model, setting)
    return OwnNumbers(_at_rest(stage, model, setting), guided)


def _directly(stage: Stage, model: MechanicalModel, setting: Setting) -> Stage:
    """Return a stage whose chains are as good as those of a direct fit."""
    pieces = setting.trial if model.free else setting.estimation
    direct = homotopy(model, setting, pieces, model, (FREE,), _STEPS)
    if not direct:
        return stage
    other = judge(direct[-1], setting)
    mixed = _best_of_chains(stage, other)
    if mixed is None:
        return stage
    joined = homotopy(mixed, setting, pieces, model, (FREE,), _STEPS)
    found = [stage, other, *(judge(fitted, setting) for fitted in joined)]
    return min(found, key=lambda s: float(np.mean(np.log(s.error))))


def _at_rest(stage: Stage, model: MechanicalModel, setting: Setting) -> Stage:
    """Return the stage with its common factors settled, if the error does not mind."""
    rested = settled(stage.model, model)
    if rested is stage.model or not stage.reproducible:
        return stage
    fits = homotopy(rested, setting, setting.trial, model, (FREE,))
    stages = [judge(fitted, setting) for fitted in fits]
    kept = [s for s in stages if np.mean(np.log(s.error / stage.error)) < _UNCHANGED]
    return kept[0] if kept else stage


def _best_of_chains(stage: Stage, direct: Stage) -> MechanicalModel | None:
    """Return the first model with the chains of the second where that is better; None if nowhere.

    Numbers of effects and of chains without an output stay.
    """
    model, numbers = stage.model, direct.model.parameters
    taken: dict[str, float] = {}
    for group in connected(model):
        seen = [i for i, o in enumerate(model.outputs) if group.intersection(o.of)]
        if not seen:
            continue
        fall = np.mean(np.log(direct.error[seen])) - np.mean(np.log(stage.error[seen]))
        if fall < np.log(_BETTER):
            taken |= {key: numbers[key] for key in _keys(model, group)}
    return model.with_parameters(taken) if taken else None


def settled(model: MechanicalModel, reference: MechanicalModel) -> MechanicalModel:
    """Return the model with chains scaled to what is known of their masses and gains.

    A chain whose masses, springs, dampers and gains are all larger by one factor moves alike. Where
    the chain has two inputs or more the fit is free to wander along this factor.
    """
    known, found = reference.parameters, model.parameters
    changes: dict[str, float] = {}
    for group in connected(model):
        inputs = [i for i in model.inputs if i.imposes is None and i.on[0] in group]
        forces = any(o.quantity == FORCE and group.intersection(o.of) for o in model.outputs)
        bent = any(group.intersection(effect.at) for effect in model.effects)
        if len(inputs) < 2 or forces or bent:
            continue
        keys = _keys(model, group)
        told = [key for key in keys if not key.startswith(("spring", "damper")) and known[key]]
        ratios = np.array([found[key] / known[key] for key in told])
        if ratios.size and np.all(ratios > 0):
            factor = float(np.sum(ratios) / np.sum(ratios**2))  # nearest to one, all alike likely
            if abs(np.log(factor)) > _UNCHANGED:
                changes |= {key: factor * found[key] for key in keys}
    return model.with_parameters(changes) if changes else model


def _keys(model: MechanicalModel, group: set[str]) -> list[str]:
    """Return the keys of the numbers of a chain."""
    inertia = {True: "inertia", False: "mass"}
    keys = [f"dof.{d.name}.{inertia[d.rotational]}" for d in model.dofs if d.name in group]
    for name, parts in (
        ("spring[{}].stiffness", model.springs),
        ("damper[{}].damping", model.dampers),
    ):
        keys += [name.format(i) for i, p in enumerate(parts) if group.intersection(p.between)]
    keys += [f"input.{i.name}.gain" for i in model.inputs if i.on[0] in group]
    return keys
