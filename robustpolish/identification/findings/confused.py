"""Pairs of effects that data may not separate, and the experiment that would."""

from __future__ import annotations

from robustpolish.effects import Effect
from robustpolish.identification.findings.findings import Confusion

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


def confused(first: Effect, second: Effect) -> Confusion:
    """Return two effects as a pair that data cannot tell apart, with an experiment that would."""
    return Confusion(first, second, _experiment(first, second))


def _experiment(first: Effect, second: Effect) -> str:
    """Propose an excitation that would tell two effects apart."""
    known = _EXPERIMENTS.get(frozenset({first.kind, second.kind}))
    if known is not None:
        return known
    if first.kind == second.kind:
        places = sorted(set(first.at) ^ set(second.at))
        ends = " and ".join(places)
        return f"Measure, or hold still, {ends}: the place shows in the relative motion."
    if first.definition.has_memory != second.definition.has_memory:
        return (
            "Move slowly to and fro with growing amplitude, ten cycles each: only memory makes "
            "the path depend on the reversal before."
        )
    return (
        "Repeat with a multisine of the same band at a third and at three times the amplitude: "
        "the two forces grow differently."
    )
