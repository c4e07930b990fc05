"""What an effect changes in what sensors show: what changes nothing cannot be found."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from .motion import excitation, motion, shown

FIRST, GROWTH = 200, 4
"""Samples of the first fit, and by how much the next ones grow, as free runs have many minima."""
LAST, CLOSE = 12, 1e-5
"""Most steps of the last fit, and how little they have to change to be the last one: after two, a
constant force seen by accelerometers was left at four noises, though another start of the motion
does all that it does."""
STEPS = 6
"""Steps between two samples: this asks how large a change is, to a per cent."""


class Change(NamedTuple):
    """What leaving an effect out changes, the largest of all outputs.

    Attributes
    ----------
    over_noise : float
        Change of a signal over its noise, both as standard deviations.
    share : float
        The same over the signal itself.
    left : float
        What is left of it over the noise once springs, dampers and the start of the motion are
        fitted in its place: a drag that is a damper as far as the record tells is no missing
        effect, nor is a constant force that only moves where velocities begin and end.
    """

    over_noise: float
    share: float
    left: float


def change_without(case, index):
    """Return what leaving one of the effects of a case out changes in the first record."""
    inputs = _inputs(case)
    truth, size = _signals(case, inputs), _sizes(case, inputs)
    others = [effect for i, effect in enumerate(case.effects) if i != index]
    without = replace(case, effects=others)
    share = float(np.max(_rms(truth - _signals(without, inputs)) / size))
    left = float(np.max(_rms(_fitted(without, inputs, truth, size) - truth) / size))
    noise = 10 ** (-case.noise_db / 20)
    return Change(share / noise, share, min(left, share) / noise)


def left_by_springs(case):
    """Return what a cubic and a quadratic spring leave of a law at its place, over the noise.

    They are fitted with everything else that a refit of springs and dampers moves.
    """
    inputs = _inputs(case)
    truth, size = _signals(case, inputs), _sizes(case, inputs)
    (_, at, _), *others = case.effects
    springs = [("cubic_stiffness", at, [0.0]), ("quadratic_stiffness", at, [0.0])]
    named = replace(case, effects=[*others, *springs])
    left = float(np.max(_rms(_fitted(named, inputs, truth, size, len(springs)) - truth) / size))
    return left * 10 ** (case.noise_db / 20)


def change_by_numbers(case):
    """Return what the wrong numbers of a model change in a signal, over its noise."""
    inputs, wrong = _inputs(case), case.wrong
    m = case.machine
    taken = replace(
        m,
        mass=[v * (1 + wrong.get("mass", 0.0)) for v in m.mass],
        springs=[
            (a, b, k * (1 + wrong.get("stiffness", 0.0) * (-1) ** i))
            for i, (a, b, k) in enumerate(m.springs)
        ],
        dampers=[(a, b, c * (1 + wrong.get("damping", 0.0))) for a, b, c in m.dampers],
    )
    change = _signals(case, inputs) - _signals(replace(case, machine=taken), inputs)
    return float(np.max(_rms(change) / _sizes(case, inputs))) * 10 ** (case.noise_db / 20)


def sound(case):
    """Return whether both records stay finite and move about as much as without the effects."""
    for which in (0, 1):
        inputs = _inputs(case, which)
        with np.errstate(all="ignore"):
            moved = _signals(case, inputs, which)
        plain = _sizes(replace(case, effects=[]), inputs, which)
        if not np.isfinite(moved).all():
            return False
        if np.any(moved.std(axis=0) < 0.1 * plain) or np.any(moved.std(axis=0) > 10 * plain):
            return False
        half = len(moved) // 2
        first, second = _rms(moved[:half]), _rms(moved[half:])
        if case.excitation != "sweep" and np.any(second > 3 * first):
            return False
    return True


def chaotic(case):
    """Return whether motions a millionth apart end up further apart than a tenth of the noise."""
    inputs = _inputs(case, 1)
    truth, size = _signals(case, inputs, 1), _sizes(case, inputs, 1)
    moved = motion(replace(case, effects=[]), 1, inputs=inputs, steps=STEPS).displacement
    beside = replace(case, start=case.start + 1e-6 * float(np.std(moved[:, -1])))
    apart = np.max(_rms(_signals(beside, inputs, 1) - truth) / size)
    return bool(apart > 0.1 * 10 ** (-case.noise_db / 20))


def _fitted(case, inputs, truth, size, named=0):
    """Return the signals of a case whose springs, dampers and start are fitted to another's.

    So are the last few of its effects, springs that grow with a power. Where a warm-up is cut off
    the motion has forgotten its start.
    """
    machine = case.machine
    moved = motion(case, inputs=inputs, steps=STEPS)
    typical = np.array([_rms(moved.displacement), _rms(moved.velocity)])
    springs, dampers = machine.springs, machine.dampers
    effects = case.effects[: len(case.effects) - named]
    bent = case.effects[len(effects) :]
    units = [_unit(machine, effect, moved.displacement) for effect in bent]
    parts = np.cumsum([len(springs), len(dampers), named])
    numbers = np.zeros(parts[-1] + (0 if case.warm_up else typical.size))

    def run(x, samples):
        k, c, p, start = np.split(x, parts)
        begin = (0.0, 0.0) if case.warm_up else start.reshape(typical.shape) * typical
        fitted = replace(
            machine,
            springs=[(a, b, v * g) for (a, b, v), g in zip(springs, np.exp(k), strict=True)],
            dampers=[(a, b, v * g) for (a, b, v), g in zip(dampers, np.exp(c), strict=True)],
        )
        sized = zip(bent, p * units, strict=True)
        added = [*effects, *((kind, at, [value]) for (kind, at, _), value in sized)]
        changed = replace(case, machine=fitted, samples=samples, effects=added)
        return _signals(changed, inputs[: case.warm_up + samples], begin=begin) / size

    spans = [case.samples]
    while spans[0] > FIRST * GROWTH:
        spans.insert(0, spans[0] // GROWTH)
    with np.errstate(all="ignore"):
        for samples in spans:
            for _ in range(2 if samples < case.samples else LAST):
                before = numbers
                numbers = _step(run, numbers, samples, truth[:samples] / size)
                if np.allclose(numbers, before, rtol=0.0, atol=CLOSE):
                    break
        return run(numbers, case.samples) * size


def spring_at(machine, at, displacements):
    """Return the stiffness of the spring at a place, and how far it is typically bent."""
    (stiffness,) = (k for a, b, k in machine.springs if (a, b) == at)
    return stiffness, float(np.std(apart(machine, at, displacements)))


def apart(machine, at, displacements):
    """Return the displacement between the two ends of a place, shape (samples,)."""
    columns = [displacements[:, machine.names.index(n)] for n in at if n in machine.names]
    return columns[0] - columns[1] if len(columns) > 1 else columns[0]


def _unit(machine, effect, displacements):
    """Return the number of a spring with which it is as strong as the linear one at its place."""
    kind, at, _ = effect
    stiffness, amplitude = spring_at(machine, at, displacements)
    return stiffness / amplitude ** {"quadratic_stiffness": 1, "cubic_stiffness": 2}[kind]


def _step(run, x, samples, wanted):
    """Return the numbers after one step of Gauss and Newton, halved until it helps."""
    here = run(x, samples)
    wide = 1e-3
    columns = [(run(x + wide * e, samples) - here).ravel() / wide for e in np.eye(x.size)]
    error = (wanted - here).ravel()
    if not np.isfinite(error).all() or not np.isfinite(columns).all():
        return x
    # a weak leash keeps dampers that do not show from running away
    leash = 1e-3 * np.sqrt(error.size) * np.eye(x.size)
    rows, right = np.vstack([np.transpose(columns), leash]), np.append(error, 0.0 * x)
    step = np.clip(np.linalg.lstsq(rows, right, rcond=None)[0], -1.0, 1.0)
    for share in (1.0, 0.5, 0.25, 0.125):
        left = wanted - run(x + share * step, samples)
        if np.isfinite(left).all() and np.sum(left**2) < np.sum(error**2):
            return x + share * step
    return x


def _inputs(case, which=0):
    rng = np.random.default_rng(1000 * case.seed + which)
    return excitation(case, rng, case.samples + case.warm_up)


def _signals(case, inputs, which=0, begin=(0.0, 0.0)):
    """What the sensors show without noise, shape (samples, ny)."""
    moved = motion(case, which, inputs=inputs, steps=STEPS, begin=begin)
    return np.column_stack(list(shown(case, moved).values()))


def _sizes(case, inputs, which=0):
    """What the noise of each sensor is measured by, shape (ny,)."""
    moved = motion(case, which, inputs=inputs, steps=STEPS)
    return np.std(np.column_stack(list(shown(case, moved, bare=True).values())), axis=0)


def _rms(x):
    return np.sqrt(np.mean(x**2, axis=0))
