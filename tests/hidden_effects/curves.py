"""Curves of learned laws beside the true forces."""

from dataclasses import replace

import numpy as np

from .cases import model_of
from .integrator import CODES, force_of
from .intervals import SIGMAS, unit_at, units_of_case
from .judge import normal


def curve_shares(case, diagnosis):
    """Return the share of the range that was seen in which each learned curve's band has the truth.

    The true curve holds the effects at the place and what the model's spring and damper there lack.
    """
    true_model, units = model_of(replace(case, wrong={})), units_of_case(case, diagnosis)
    shares = []
    for law in diagnosis.laws:
        curve, contains = law.curve(), law.effect.definition.contains
        seen = {name: curve[name].values for name in law.seen}
        d = seen.get("displacement", np.zeros(1))
        v = seen.get("velocity", np.zeros(1))
        t = seen.get("time", np.zeros(1)) + case.warm_up * case.machine.dt
        if "time" in seen:  # what varies is the force of a unit of motion
            d, v = (np.ones(1) * (law.quantity == name) for name in ("stiffness", "damping"))
        d, v, t = (grid.ravel() for grid in np.meshgrid(d, v, t, indexing="ij"))
        sign = _direction(case, law.effect.at)
        unit = unit_at(units, law.effect.at)
        force = sign * unit * static_force(case, law.effect.at, sign * d, sign * v, t)
        place = set(law.effect.at)
        if "spring" in contains:
            lacks = unit * _part_at(true_model.springs, place, "stiffness")
            force += (lacks - _part_at(diagnosis.model.springs, place, "stiffness")) * d
        if "damper" in contains:
            lacks = unit * _part_at(true_model.dampers, place, "damping")
            force += (lacks - _part_at(diagnosis.model.dampers, place, "damping")) * v
        apart = np.abs(curve[law.quantity].values.ravel() - force)
        shares.append(float(np.mean(apart <= SIGMAS * curve["stderr"].values.ravel())))
    return shares


def static_force(case, at, d, v, time=None):
    """Return the restoring force of the effects of a case at a place, over relative motion.

    At times since the machine began to run; at the beginning if none are given.
    """
    time = np.zeros(len(d)) if time is None else time
    total = np.zeros(len(d))
    state, rates, force = np.zeros(2), np.zeros(2), np.zeros(1)
    for kind, where, p in case.effects:
        if normal("", where) != normal("", at) or kind not in CODES:
            continue
        numbers = np.zeros(6)
        numbers[: len(p)] = p
        for i, (q, s, t) in enumerate(zip(d, v, time, strict=True)):
            force[:] = 0.0
            force_of(
                CODES[kind], numbers, t, 0, -1, np.array([q]), np.array([s]), state, rates, force
            )
            total[i] -= force[0]
    return total


def _direction(case, at):
    """Return -1 if the first effect at a place is written the other way round, else 1."""
    first = next((w for _, w, _ in case.effects if normal("", w) == normal("", at)), at)
    return 1.0 if tuple(first) == tuple(at) else -1.0


def _part_at(parts, place, name):
    return sum(getattr(part, name) for part in parts if set(part.between) == place)
