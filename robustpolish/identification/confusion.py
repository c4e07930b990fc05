"""Pairs of effects that data may not separate, and the experiment that would."""

from __future__ import annotations

from collections.abc import Sequence

from robustpolish.effects import Effect, lookup
from robustpolish.identification.diagnosis import Confusion, FoundEffect

_DRY = ("coulomb_friction", "stribeck_friction")
_EXPERIMENTS: dict[frozenset[str], str] = {
    frozenset({"sensor_offset", "constant_force"}): "Start the record at rest, before the "
    "force acts: an offset is there from the first sample, a force moves the machine.",
    frozenset({"coulomb_friction", "stribeck_friction"}): "Excite slowly, with velocities "
    "down to a tenth of those of this record: only Stribeck friction rises there.",
    frozenset({"coulomb_friction", "constant_force"}): "Move at several constant speeds in both "
    "directions, and let the machine rest after each: friction that differs with the direction "
    "vanishes at rest, a constant force does not.",
    frozenset({"cubic_stiffness", "backlash"}): "Excite at two or three times the amplitude and at "
    "a third of it: a cubic spring changes with the square, a clearance matters less and less.",
    frozenset({"input_gain", "sensor_gain"}): "Load with a known weight, or add a known mass.",
}


def asymmetries(found: Sequence[FoundEffect]) -> list[Confusion]:
    """Return the constant forces that friction of unlike size in the two directions would be.

    Only the friction in each direction plus or minus the force shows while something slides.
    """
    pairs = []
    for force in found:
        for friction in found:
            if (
                force.kind == "constant_force"
                and friction.kind in _DRY
                and (force.at[0] in friction.at)
            ):
                size = force.parameters["force"].value
                lopsided = Effect("coulomb_friction", friction.at, {"asymmetry": -size})
                here = Effect(force.kind, force.at, {"force": size})
                pairs.append(Confusion(here, lopsided, experiment(here, lopsided)))
    return pairs


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
