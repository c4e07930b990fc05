"""Laws that no catalogue holds, drawn at random on the machines of `several.py`.

Each shows, as the effects there do, and a cubic and a quadratic spring at its place, fitted with
all other springs, dampers and the start of the motion, leave visibly more than the noise: a fifth
power that the record does not tell from a third is a cubic spring as far as anybody can know. And
the second record moves the place no farther than the first: elsewhere no record shows the law. (Of
24 drawn without that one went 45 % farther, and left fifty noises under a law that was right.)
"""

from dataclasses import replace
from functools import cache

import numpy as np

from .cases import Case
from .drawn import effect_of, sizes
from .motion import motion
from .several import (
    LARGER,
    LEAST_LEFT,
    ROUNDS,
    add_noise,
    chain,
    drive,
    shows,
    until_it_shows,
    with_sensors,
    wrong_numbers,
)
from .visible import STEPS, apart, change_without, chaotic, left_by_springs, sound, spring_at

SEEN_LAWS = 20261127
"""Rules of the diagnosis may be changed while looking at cases of this seed."""
UNSEEN_LAWS = 20261129
"""Chosen before any of its cases had been drawn or run, on rules that have not been changed since.
Once they are, it has been seen, and a new one takes its place before the next examination."""

FARTHER = 0.05
"""Share of the range of a place by which the second record may leave what the first one shows."""

DEAD_ZONE = "dead_zone_spring"
SPRINGS = ("fifth_power_stiffness", "saturating_spring")
KINDS = (*SPRINGS, "drifting_stiffness", DEAD_ZONE)
LAWS = KINDS * 6


@cache
def law_case(number, seed=SEEN_LAWS):
    """Return one case of the plan."""
    return until_it_shows(_attempt, number, seed)


def name_of_law(number):
    """Return what a case of the plan is called."""
    return f"law: {LAWS[number]} #{number:02d}"


def _attempt(number, seed, rng):
    """Draw a machine, everyday data and a law; None if it does not show."""
    machine = with_sensors(chain(rng, False), rng, False)
    case = Case(name_of_law(number), machine, verdict="unknown_law", seed=1000 * seed + number)
    add_noise(case, rng)
    drive(case, rng)
    if rng.random() < 0.4:
        case.wrong = wrong_numbers(rng)
    Q, V, force = sizes(case)
    for _ in range(ROUNDS):
        case = replace(case, effects=_law(LAWS[number], machine, rng, (Q, V, force)))
        if not (sound(case) and _seen(case)):
            return None
        if _has_no_name(case):
            return replace(case, chaotic=chaotic(case))
        force *= LARGER
    return None


def _seen(case):
    """Return whether the second record moves the place about as far as the first at most."""
    first, second = (
        apart(case.machine, case.effects[0][1], motion(case, which, steps=STEPS).displacement)
        for which in (0, 1)
    )
    room = FARTHER * np.ptp(first)
    return first.min() - room <= second.min() and second.max() <= first.max() + room


def _has_no_name(case):
    """Return whether all effects of a case show, and no springs with a name do what they do."""
    seen = all(shows(change_without(case, i)) for i in range(len(case.effects)))
    return seen and (case.effects[0][0] not in SPRINGS or left_by_springs(case) >= LEAST_LEFT)


def _law(kind, machine, rng, size):
    """Return the law at one place; a spring with a dead zone has friction beside it."""
    if kind != DEAD_ZONE:
        return [effect_of(kind, machine, rng, size)]
    friction, at, numbers = effect_of("coulomb_friction", machine, rng, size)
    stiffness, amplitude = spring_at(machine, at, size[0])
    return [(kind, at, [0.8 * stiffness, 0.7 * amplitude]), (friction, at, numbers)]
