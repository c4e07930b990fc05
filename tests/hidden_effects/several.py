"""A hundred cases drawn at random with up to three effects, mixed sensors, decays and blows.

Beside those of `drawn.py`, whose plan holds mostly single effects. Every effect shows: leaving it
out changes a signal by more than the noise, and springs, dampers and the start of the motion cannot
do its work (`visible.py`). Effects of one case differ in family or in place, so that there is one
truth. The start was added after the first examination, and two cases were drawn anew by that:
behind velocity sensors a constant force is another place to begin, which nobody can tell.
There are two groups, of two seeds: one that rules were tuned on, one that no rule has seen.
"""

from dataclasses import replace
from functools import cache

import numpy as np

from .cases import Case, Machine
from .drawn import AXES, DOF, PAIR, SIGNAL, effect_of, skeleton, two_axes
from .motion import motion, shown
from .visible import change_by_numbers, change_without, chaotic, sound

SEEN_SEED = 20261122
"""Chosen before any of its cases had been run. Rules of the diagnosis were changed while looking at
them since, so that they tell whether something got worse, and no more how good it is."""
UNSEEN_SEED = 20261129
"""Chosen before any of its cases had been drawn or run, on rules that have not been changed since.
Once they are, it has been seen, and a new one takes its place before the next examination."""

COUNTS = {"two": 2, "three": 3, "nothing": 0, "numbers": 0}
PLAN = (
    *(PAIR + DOF + AXES + SIGNAL) * 2,
    "cubic_stiffness", "coulomb_friction", "quadratic_damping", "elastic_coulomb_friction",
    "backlash", "contact_stop",
    *("two",) * 30, *("three",) * 10, *("nothing",) * 5, *("numbers",) * 5,
)  # fmt: skip
NUMBERS_OF_EFFECTS = ("one effect", "two effects", "three effects", "nothing missing")
FAMILIES = (
    ("coulomb_friction", "stribeck_friction", "elastic_coulomb_friction", "lugre_friction",
     "bouc_wen_hysteresis"),
    ("quadratic_damping", "displacement_dependent_damping"),
    ("cubic_stiffness", "quadratic_stiffness", "backlash", "contact_stop"),
)  # fmt: skip
"""Kinds that nothing but their fine structure tells apart: never two of one at one place."""
ONLY_ONE = (
    ("constant_force", "sensor_offset"),
    ("harmonic_force", "unbalance"),
    SIGNAL,
)
"""Kinds of which a case has one at most, wherever it is."""

LEAST_OVER_NOISE, LEAST_SHARE, LEAST_LEFT = 2.0, 0.03, 1.0
"""What leaving an effect out changes at least: in noises, as a share of the motion, and in noises
after a refit of springs and dampers, with which the error is 1.4 times the noise."""
LARGER, ROUNDS, ATTEMPTS = 1.6, 5, 200
"""An effect that does not show is drawn again, larger by this; then machine and data anew."""


def several_cases(count=None, seed=SEEN_SEED):
    """Return the cases of the plan in its order, or the first few."""
    return [several_case(i, seed) for i in range(len(PLAN) if count is None else count)]


@cache
def several_case(number, seed=SEEN_SEED):
    """Return one case of the plan."""
    return until_it_shows(_attempt, number, seed)


def until_it_shows(attempt, number, seed):
    """Return a case of which an attempt made something; each has random numbers of its own."""
    rng = np.random.default_rng([seed, number])
    for _ in range(ATTEMPTS):
        case = attempt(number, seed, rng)
        if case is not None:
            return case
    raise RuntimeError(f"Case {number} of seed {seed}: no machine shows its effects.")


def name_of(number):
    """Return what a case of the plan is called."""
    return f"{PLAN[number]} #{number:02d}"


def number_of_effects(case):
    """Return the class of a case: how many effects are missing."""
    return NUMBERS_OF_EFFECTS[len(case.effects) - 1]


def _attempt(number, seed, rng):
    """Draw a machine, everyday data and effects; None if they are not what a machine is."""
    kind = PLAN[number]
    axes = kind in AXES or (kind in COUNTS and rng.random() < 0.25)
    decay = kind not in ("input_gain", "input_delay") and rng.random() < 1 / 3
    machine = with_sensors(_two_axes(rng) if axes else chain(rng, decay), rng, axes)
    case = Case(name_of(number), machine, seed=1000 * seed + number)
    add_noise(case, rng)
    if decay:
        case.excitation = "blow" if axes or rng.random() < 0.4 else "none"
        case.start = 0.0 if case.excitation == "blow" else float(rng.uniform(0.005, 0.03))
        case.drive, case.samples = float(rng.uniform(100, 400)), 8000
    else:
        drive(case, rng)
    if kind == "numbers" or (kind != "nothing" and rng.random() < 0.4):
        case.wrong = wrong_numbers(rng)
    if kind in ("nothing", "numbers"):
        case.verdict = "adequate" if kind == "nothing" else "parameters"
        if decay:
            _end_with_the_motion(case)
        visible = kind == "nothing" or change_by_numbers(case) > LEAST_OVER_NOISE
        return case if visible else None
    return _with_effects(case, [kind] if kind not in COUNTS else None, COUNTS.get(kind, 1), rng)


def add_noise(case, rng):
    """Draw how loud the noise of a case is, and its colour."""
    case.noise_db = float(rng.uniform(20, 60))
    case.colour = float(rng.choice([0.0, 0.0, 0.6, 0.9]))


def drive(case, rng):
    """Draw what drives a case all the time."""
    case.excitation = str(rng.choice(["noise", "multisine", "sweep"]))
    case.drive, case.samples = float(rng.uniform(5, 40)), int(rng.integers(4000, 9000))
    case.warm_up = int(rng.choice([0, 0, 1500]))
    case.held = bool(rng.random() < 0.3)


def wrong_numbers(rng):
    """Draw by which shares the numbers of a model are off."""
    return {
        "mass": float(rng.choice([-1, 1]) * rng.uniform(0.03, 0.05)),
        "stiffness": float(rng.uniform(-0.1, 0.1)),
        "damping": float(rng.uniform(-0.3, 0.3)),
    }


def _with_effects(case, kinds, count, rng):
    """Return the case with effects all of which show, None if none was found."""
    size = _sizes(case)
    scales = [1.0] * count
    kinds = list(kinds or [str(k) for k in rng.choice(_possible(case), count, replace=False)])
    drawn = [None] * count
    samples = case.samples
    for _ in range(ROUNDS):
        for i in range(count):
            if drawn[i] is None:
                others = [effect for effect in drawn if effect is not None]
                drawn[i] = _fitting(kinds[i], case, rng, size, scales[i], others)
                if drawn[i] is None:
                    return None
        case = replace(case, effects=list(drawn), samples=samples)
        if case.excitation in ("none", "blow"):
            _end_with_the_motion(case)
        if not sound(case):
            return None
        changes = [change_without(case, i) for i in range(count)]
        if all(shows(change) for change in changes):
            return replace(case, chaotic=chaotic(case))
        for i, change in enumerate(changes):
            if not shows(change):
                drawn[i], scales[i] = None, LARGER * scales[i]
    return None


def shows(change):
    """Return whether a change is large enough for anybody to see it."""
    return (
        change.over_noise >= LEAST_OVER_NOISE
        and change.share >= LEAST_SHARE
        and change.left >= LEAST_LEFT
    )


def _possible(case):
    """Return the kinds that may be missing in a case."""
    axes = AXES if case.machine.spin else ()
    inputs = SIGNAL[2:] if case.excitation == "none" else SIGNAL
    return PAIR + DOF + axes + inputs


def _fitting(kind, case, rng, size, scale, others):
    """Return an effect that is neither at the place nor of the family of another."""
    Q, V, drive, seen = size
    for _ in range(20):
        effect = effect_of(kind, case.machine, rng, (Q, V, scale * drive))
        if kind in ("sensor_offset", "sensor_gain"):
            name = str(rng.choice(list(seen)))
            value = 0.6 * scale * seen[name] if kind == "sensor_offset" else effect[2][0]
            effect = (kind, (name,), [value])
        if not any(_conflict(effect, other) for other in others):
            return effect
    return None


def _conflict(one, other):
    """Return whether two effects of a case could stand for each other."""
    kinds = {one[0], other[0]}
    if one[0] == other[0] or any(kinds <= set(group) for group in ONLY_ONE):
        return True
    return one[1] == other[1] and any(kinds <= set(family) for family in FAMILIES)


def _sizes(case):
    """Return motions, a force to compare with, and sizes of the signals without any effect."""
    moved = motion(case)
    force = case.drive
    if case.excitation in ("none", "blow"):  # the drive says nothing: a share of the springs'
        name, _, k = case.machine.springs[0]
        force = 0.3 * k * float(np.std(moved.displacement[:, case.machine.names.index(name)]))
    seen = {name: float(np.std(y)) for name, y in shown(case, moved).items()}
    return moved.displacement, moved.velocity, force, seen


def _end_with_the_motion(case):
    """Cut a decay where it is over, so that noise is measured by what moves."""
    moved = np.abs(motion(case).displacement)
    near = moved > 0.03 * np.max(moved, axis=0)
    last = int(np.flatnonzero(near.any(axis=1))[-1]) if near.any() else 0
    case.samples = int(np.clip(last, 1500, case.samples))


def chain(rng, decay):
    """A chain of one to three masses to ground without sensors; lightly damped for a decay."""
    n = int(rng.choice([1, 2, 3]))
    names, mass, springs, dampers = skeleton(rng, n, (0.003, 0.012) if decay else (0.004, 0.04))
    return Machine(
        names, mass, springs, dampers, [names[int(rng.integers(n))]], [],
        f_max=float(rng.uniform(22, 40)), dt=float(rng.choice([1e-3, 2e-3, 4e-3])),
    )  # fmt: skip


def _two_axes(rng):
    return replace(two_axes(rng), dt=float(rng.choice([1e-3, 2e-3])))


def with_sensors(machine, rng, all_seen):
    """Give every mass a sensor of some quantity, one of them two, and sometimes one none.

    Where there are two masses or more, there are two sensors or more: one alone leaves masses and
    springs open, and with them the place of what is missing.
    """
    kinds = ("displacement", "velocity", "acceleration")
    measured = [(name, str(rng.choice(kinds, p=[0.5, 0.2, 0.3]))) for name in machine.names]
    if len(measured) > 1 and not all_seen and rng.random() < 0.2:
        unseen = int(rng.integers(len(measured)))
        if len(measured) > 2:
            del measured[unseen]
    if rng.random() < 0.2:
        name, quantity = measured[int(rng.integers(len(measured)))]
        measured.append((name, str(rng.choice([k for k in kinds if k != quantity]))))
    return replace(machine, measured=measured)
