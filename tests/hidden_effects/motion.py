"""How a case moves: its matrices, what drives it, and what its sensors show without noise."""

from typing import NamedTuple

import numpy as np
from scipy.signal import butter, sosfilt

from .integrator import CODES, integrate


class Moved(NamedTuple):
    """Displacements, velocities and accelerations, and the recorded inputs, by sample."""

    displacement: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    inputs: np.ndarray


def matrices(machine):
    n = len(machine.names)
    K, C = np.zeros((n, n)), np.zeros((n, n))
    for target, items in ((K, machine.springs), (C, machine.dampers)):
        for a, b, value in items:
            i = machine.names.index(a)
            target[i, i] += value
            if b != "ground":
                j = machine.names.index(b)
                target[j, j] += value
                target[i, j] -= value
                target[j, i] -= value
    B = np.zeros((n, len(machine.forced)))
    for j, name in enumerate(machine.forced):
        B[machine.names.index(name), j] = 1.0
    return np.array(machine.mass), C, K, B


def excitation(case, rng, samples):
    """A forcing whose band covers the modes: noise, multisine, sweep, or one blow."""
    m = case.machine
    t = np.arange(samples) * m.dt
    columns = []
    for _ in m.forced:
        if case.excitation == "multisine":
            f = np.arange(1, int(m.f_max * 8)) / 8
            u = sum(np.cos(2 * np.pi * g * t + rng.uniform(0, 6.28)) for g in f)
        elif case.excitation == "sweep":
            u = np.sin(2 * np.pi * (0.5 * t + 0.5 * (m.f_max - 0.5) / t[-1] * t**2))
        elif case.excitation == "blow":  # half a sine, whose spectrum reaches the modes
            length = 0.75 / m.f_max
            u = np.where((t > 0.02) & (t < 0.02 + length), np.sin(np.pi * (t - 0.02) / length), 0)
            columns.append(rng.uniform(0.7, 1.3) * u)  # the drive is its peak
            continue
        else:
            sos = butter(4, m.f_max * 2 * m.dt, output="sos")
            u = sosfilt(sos, rng.standard_normal(samples))
        columns.append(u / np.std(u))
    if case.excitation == "none":
        return np.zeros((samples, 0))
    return case.drive * np.column_stack(columns)


def motion(case, which=0, rng=None, inputs=None, steps=12, begin=(0.0, 0.0)):
    """Return the motion of one of the two records of a case, the warm-up cut off.

    A generator that is given goes on with the noise of the record. Inputs that are given stand in
    place of the excitation, warm-up included. `steps` is the least number of steps between two
    samples. `begin` is added to displacements and velocities at the start.
    """
    m = case.machine
    M, C, K, B = matrices(m)
    U = inputs
    if U is None:
        rng = rng or np.random.default_rng(1000 * case.seed + which)
        U = excitation(case, rng, case.samples + case.warm_up)
    if U.shape[1] == 0:
        B = np.zeros((len(M), 0))
    effects = [e for e in case.effects if e[0] in CODES]
    codes = np.array([CODES[e[0]] for e in effects], dtype=np.int64)
    places = np.full((len(effects), 2), -1, dtype=np.int64)
    params = np.zeros((len(effects), 6))
    for i, (_, at, p) in enumerate(effects):
        for j, name in enumerate(at):
            places[i, j] = m.names.index(name) if name != "ground" else -1
        params[i, : len(p)] = p
    q0, v0 = np.zeros(len(M)), np.zeros(len(M))
    q0[-1] = case.start * (1.0 if which == 0 else 0.8)
    q0, v0 = q0 + begin[0], v0 + begin[1]
    stiffest = np.sqrt(np.max(np.diag(K) / M))
    over = max(steps, int(np.ceil(m.dt * stiffest * steps / 3)))
    others = {e[0]: e for e in case.effects if e[0] not in CODES}
    forces, dt, fine = _forces(m, others, U), m.dt, 1
    for kind in others.keys() & BETWEEN:  # one at most
        forces = BETWEEN[kind](case, others[kind], forces, over)
        dt, fine, over = dt / over, over, 1
    moved = integrate(M, C, K, B, forces, dt, over, codes, places, params, q0, v0, case.held)
    moved = (signal[::fine] for signal in moved)
    return Moved(*(signal[case.warm_up :] for signal in (*moved, U)))


def _forces(m, others, U):
    """Return the forces behind the recorded inputs: their gain may be missing."""
    U = U.copy()
    if "input_gain" in others:
        gain = others["input_gain"]
        U[:, _acting(m, gain)] *= gain[2][0]
    return U


def _late(case, delay, U, fine):
    """Return forces of which one is late, `fine` of them per sample.

    What is linear or held between the samples stays so and is moved as a whole: a delayed force
    that was read off at the samples again would be a smoother one, which no delay explains.
    """
    m, p, late = case.machine, delay[2], _acting(case.machine, delay)
    t, h = np.arange(len(U)) * m.dt, m.dt / fine
    found = np.empty(((len(U) - 1) * fine + 1, U.shape[1]))
    for j, u in enumerate(U.T):
        now = np.arange(len(found)) * h - (p[0] if j == late else 0.0)
        if case.held:  # the mean over each step, in which a jump may lie
            pushed = np.concatenate([[-u[0] * p[0], 0.0], np.cumsum(u) * m.dt])
            ends = np.concatenate([[-p[0]], t, [t[-1] + m.dt]])
            found[:, j] = np.diff(np.interp([*now, now[-1] + h], ends, pushed)) / h
        else:
            found[:, j] = np.interp(now, t, u)
    return found


def _lagging(case, lag, U, fine):
    """Return forces of which one lags, `fine` of them per sample."""
    p = lag[2]
    m, j, found = case.machine, _acting(case.machine, lag), _finer(case, U, fine)
    n, driving = len(found), found[:, j].copy()
    kept = np.exp(-m.dt / fine / p[0])
    for i in range(1, n):  # the mean of what drives it over the step
        mean = driving[i - 1] if case.held else (driving[i - 1] + driving[i]) / 2
        found[i, j] = mean + kept * (found[i - 1, j] - mean)
    if case.held:  # over a step all forces are held: the lagging one at its mean
        found[:-1, j] = (found[:-1, j] + found[1:, j]) / 2
    return found


def _limited(case, limit, U, fine):
    """Return forces of which one never exceeds its limit, `fine` of them per sample."""
    j, found = _acting(case.machine, limit), _finer(case, U, fine)
    found[:, j] = np.clip(found[:, j], -limit[2][0], limit[2][0])
    return found


def _dead(case, zone, U, fine):
    """Return forces of which one does nothing within its dead zone, `fine` of them per sample."""
    j, found = _acting(case.machine, zone), _finer(case, U, fine)
    found[:, j] = np.sign(found[:, j]) * np.maximum(np.abs(found[:, j]) - zone[2][0], 0.0)
    return found


BETWEEN = {
    "input_delay": _late,
    "input_lag": _lagging,
    "input_saturation": _limited,
    "input_dead_zone": _dead,
}
"""Effects on an input that tell between its samples."""


def _acting(machine, effect):
    """Return which of the forces an effect acts on."""
    return machine.forced.index(effect[1][0].removeprefix("F_"))


def _finer(case, U, fine):
    """Return the forces as they are between their samples, `fine` of them per sample."""
    k = np.arange((len(U) - 1) * fine + 1) / fine
    return np.column_stack(
        [np.interp(np.floor(k) if case.held else k, range(len(U)), u) for u in U.T]
    )


def shown(case, moved, bare=False):
    """Return what the sensors show without noise by name; `bare` without gains and offsets too."""
    found = {}
    for name, quantity in case.machine.measured:
        signal = getattr(moved, quantity)[:, case.machine.names.index(name)]
        found[output_name(name, quantity)] = signal.copy()
    for kind, at, p in [] if bare else case.effects:
        if kind == "sensor_gain":
            found[at[0]] *= p[0]
    for kind, at, p in [] if bare else case.effects:
        if kind == "sensor_offset":
            found[at[0]] += p[0]
    return found


def output_name(name, quantity):
    """Return what an output is called."""
    return name if quantity == "displacement" else f"{name}_{quantity[0]}"
