"""Pairs of effects that data may not separate, and the experiment that would."""

from __future__ import annotations

from collections.abc import Sequence

from robustpolish.effects import Effect, lookup
from robustpolish.identification.diagnosis import Confusion, FoundEffect
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.parts import FORCE

_DRY = ("coulomb_friction", "stribeck_friction")
_EXPERIMENTS: dict[frozenset[str], str] = {
    frozenset({"sensor_offset", "constant_force"}): "Start the record at rest, before the "
    "force acts: an offset is there from the first sample, a force moves the machine.",
    frozenset({"coulomb_friction", "stribeck_friction"}): "Excite slowly, with velocities "
    "down to a tenth of those of this record: only Stribeck friction rises there.",
    frozenset({"coulomb_friction", "constant_force"}): "Move at several constant speeds in both "
    "directions, and let the machine rest after each: friction that differs with the direction "
    "vanishes at rest, a constant force does not.",
    frozenset({"coulomb_friction", "sensor_offset"}): "Record the force while nothing moves and "
    "nothing drives it: an offset is there, friction that differs with the direction is not.",
    frozenset({"cubic_stiffness", "backlash"}): "Excite at two or three times the amplitude and at "
    "a third of it: a cubic spring changes with the square, a clearance matters less and less.",
    frozenset({"input_gain", "sensor_gain"}): "Load with a known weight, or add a known mass.",
}


def asymmetries(model: MechanicalModel, found: Sequence[FoundEffect]) -> list[Confusion]:
    """Return the constants that friction of unlike size in the two directions would be.

    Only the friction in each direction plus or minus the constant shows while something slides.
    """
    pairs = []
    for constant in found:
        end = _loaded(model, constant)
        for friction in found:
            if end is None or friction.kind not in _DRY or end not in friction.at:
                continue
            size = next(iter(constant.parameters.values())).value
            name = next(iter(constant.parameters))
            lopsided = Effect("coulomb_friction", friction.at, {"asymmetry": -size})
            here = Effect(constant.kind, constant.at, {name: size})
            pairs.append(Confusion(here, lopsided, experiment(here, lopsided)))
    return pairs


def _loaded(model: MechanicalModel, constant: FoundEffect) -> str | None:
    """Return the coordinate on which a constant force acts, or seems to act by an offset."""
    if constant.kind == "constant_force":
        return constant.at[0]
    if constant.kind == "sensor_offset":
        output = next(o for o in model.outputs if o.name == constant.at[0])
        return output.of[0] if output.quantity == FORCE else None
    return None


def experiment(first: Effect, second: Effect) -> str:
    """Propose an excitation that would tell two effects apart."""
    known = _EXPERIMENTS.get(frozenset({first.kind, second.kind}))
    if known is not None:
        return known
    if first.kind == second.kind:
        places = sorted(set(first.at) ^ set(second.at))
        ends = " and ".join(places)
        return f"Measure, or hold still, {ends}: the place shows in the relative motion."
    if lookup(first.kind).has_memory != lookup(second.kind).has_memory:
        return (
            "Move slowly to and fro with growing amplitude, ten cycles each: only memory makes "
            "the path depend on the reversal before."
        )
    return (
        "Repeat with a multisine of the same band at a third and at three times the amplitude: "
        "the two forces grow differently."
    )
