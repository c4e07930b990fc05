"""The matrices of a step of a linear system with nonlinear port forces.

The linear part is integrated exactly (the inputs are linear between samples), the port
forces by the exponential Runge-Kutta method ETDRK4 of Cox and Matthews (2002), J. Comput.
Phys. 176, 430-455, their internal states by the matching classical stages. Stiff linear modes
therefore cost no small steps; only stiff or sharp effects do.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import expm, matrix_balance

from robustpolish.base.arrays import Array
from robustpolish.base.jit import njit
from robustpolish.machines.effects.evaluate import call_law

# Dry friction over one step: sliding on, turning round, or resting until the force gives way.
#
# The force of ideal dry friction is no function of the velocity: at rest it is whatever holds, up
# to its limit. A steep curve in its place creeps under every load. Over a step the velocity is
# nearly linear in time, so that when the body stops, and what it does then, follow from its
# velocity at both ends; the friction is then a force that jumps within the step, and what of it
# acts on the state is its mean and its first moment (a time-stepping method with the events inside
# the step; Acary, Brogliato (2008), Numerical Methods for Nonsmooth Dynamical Systems, chapters 8
# and 10).

LEAST = 1e-200
"""A velocity that is as good as none and says a direction."""


@njit(cache=True, nogil=True, error_model="numpy")
def friction_over_step(begin, free, mobility, now, forward, backward):  # type: ignore[no-untyped-def]
    """Return the friction over a step as a mean, its change over the step, and what it is at last.

    Parameters
    ----------
    begin : float
        Velocity at the beginning of the step; 0 of a body at rest.
    free : float
        Velocity at its end without the friction.
    mobility : float
        Velocity at the end that a unit of constant force gives; positive.
    now : float
        The friction while the body slides on as it does at the beginning.
    forward, backward : float
        The friction on a body that begins to slide in the one and the other direction;
        ``forward <= backward``.

    Returns
    -------
    mean, change, last : float
        ``mean + change (t - 1/2)`` over the step, t from 0 to 1, has the friction's impulse and
        moves the body as far. `last` is the force at the end.
    """
    end = free + mobility * now
    if begin * end > 0.0:
        return now, 0.0, now
    gained = free - begin
    stops = 0.0 if begin == 0.0 else begin / (begin - end)
    if gained + mobility * forward > 0.0:
        last = forward
    elif gained + mobility * backward < 0.0:
        last = backward
    else:
        last = -gained / mobility
    left = 1.0 - stops
    mean = stops * now + left * last
    moment = now * (stops - 0.5 * stops * stops) + 0.5 * last * left * left
    return mean, 6.0 * mean - 12.0 * moment, last


# Compiled stepping of a linear system with nonlinear port forces: see :mod:`.step`.

_SWEEPS = 20
# Share of its limit to which frictions that hold each other are found, and below which speed, as a
# share of what friction does in a step, a body rests.
_HELD = 1e-6
# Rows that processors add at once: those of a step come in whole vectors, zeros behind.
_VECTOR = 4


@njit(cache=True, error_model="numpy")
def _force(laws, layout, p, t, motion, at, ports, z, f, dz, i):  # type: ignore[no-untyped-def]
    """Evaluate one law."""
    port, state, own = layout[i, 0], layout[i, 2], layout[i, 4]
    q = at + port
    call_law(laws[i], t, motion, q, motion, q + ports, z, state, p, own, f, port, dz, state)


@njit(cache=True, error_model="numpy")
def _forces(laws, layout, p, t, motion, at, ports, z, f, dz):  # type: ignore[no-untyped-def]
    """Evaluate all laws at motions that begin at an entry: displacements, then velocities.

    `layout` rows: port, ports, state, states, parameter, parameters, whether it is dry friction.
    """
    for i in range(len(laws)):
        _force(laws, layout, p, t, motion, at, ports, z, f, dz, i)


@njit(cache=True, error_model="numpy")
def _limits(laws, layout, p, t, motion, at, ports, z, f, dz, dry, forward, backward):  # type: ignore[no-untyped-def]
    """Evaluate the frictions on bodies that begin to slide, in either direction."""
    for d in range(len(dry)):
        v = at + ports + layout[dry[d], 0]
        kept = motion[v]
        motion[v] = LEAST
        _force(laws, layout, p, t, motion, at, ports, z, f, dz, dry[d])
        forward[d] = f[layout[dry[d], 0]]
        motion[v] = -LEAST
        _force(laws, layout, p, t, motion, at, ports, z, f, dz, dry[d])
        backward[d] = f[layout[dry[d], 0]]
        motion[v] = kept


@njit(cache=True, error_model="numpy")
def _slide_on(motion, ports, layout, dry, v0):  # type: ignore[no-untyped-def]
    """Let bodies that slide slide on, until it is known where in the step they stop."""
    for d in range(len(dry)):
        v = ports + layout[dry[d], 0]
        if v0[d] > 0.0:
            motion[v] = max(motion[v], LEAST)
        elif v0[d] < 0.0:
            motion[v] = min(motion[v], -LEAST)


@njit(cache=True, error_model="numpy")
def _hold(f, layout, dry, v0, held):  # type: ignore[no-untyped-def]
    """Set the frictions of bodies at rest to what held them last."""
    for d in range(len(dry)):
        if v0[d] == 0.0:
            f[layout[dry[d], 0]] = held[d]


@njit(cache=True, error_model="numpy")
def _at_end(ahead, out, x, n, column):  # type: ignore[no-untyped-def]
    """Return a motion at the end of a step, `out` beginning with the next state."""
    total = 0.0
    for c in range(n):
        total += ahead[c, column] * out[c]
    signals = (x.size - n) // 2
    for c in range(signals):
        total += ahead[n + c, column] * x[n + signals + c]
    return total


@njit(cache=True, error_model="numpy")
def _impulses(m, layout, dry, n, ports):  # type: ignore[no-untyped-def]
    """Return what constant and tilted frictions do to the state, and to the sliding velocities."""
    ahead, first, middle, last = m[0], m[4], m[5], m[6]
    push, tilt = np.empty((len(dry), n)), np.empty((len(dry), n))
    by_push, by_tilt = np.zeros((len(dry), len(dry))), np.zeros((len(dry), len(dry)))
    for d in range(len(dry)):
        port = layout[dry[d], 0]
        for r in range(n):
            push[d, r] = first[port, r] + 2 * middle[port, r] + last[port, r]
            tilt[d, r] = (last[port, r] - first[port, r]) / 2
        for e in range(len(dry)):
            column = n + ports + layout[dry[e], 0]
            for r in range(n):
                by_push[d, e] += push[d, r] * ahead[r, column]
                by_tilt[d, e] += tilt[d, r] * ahead[r, column]
    return push, tilt, by_push, by_tilt


@njit(cache=True, error_model="numpy")
def _hold_at_start(ahead, layout, dry, out, x, n, ports, by_push, ends, slow, held):  # type: ignore[no-untyped-def]
    """Set below which speeds bodies rest, and what holds those that rest at first."""
    for d in range(len(dry)):
        slow[d] = _HELD * by_push[d, d] * (ends[1][d] - ends[0][d])
        column = n + ports + layout[dry[d], 0]
        gained = _at_end(ahead, out, x, n, column) - out[column]
        held[d] = min(max(-gained / by_push[d, d], ends[0][d]), ends[1][d])


@njit(cache=True, error_model="numpy")
def _apply_stopping(out, v0, v1, mean, push, tilt, by_push, by_tilt, ends, slow, last, held):  # type: ignore[no-untyped-def]
    """Put into the next state what frictions do that stop, turn round or hold within a step.

    On entry `mean` holds what acted on it so far, and `v1` the velocities that came of it. What
    several frictions do follows from what the others do: they are gone through again and again.
    """
    now, before, change = mean.copy(), last.copy(), np.zeros(len(mean))
    for _ in range(_SWEEPS):
        worst = 0.0
        for d in range(len(mean)):
            free = v1[d] - by_push[d, d] * mean[d]
            new, tilted, last[d] = friction_over_step(
                v0[d], free, by_push[d, d], now[d], ends[0][d], ends[1][d]
            )
            more, turned = new - mean[d], tilted - change[d]
            for r in range(push.shape[1]):
                out[r] += push[d, r] * more + tilt[d, r] * turned
            for e in range(len(mean)):
                v1[e] += by_push[d, e] * more + by_tilt[d, e] * turned
            mean[d], change[d] = new, tilted
            slow[d] = _HELD * by_push[d, d] * (ends[1][d] - ends[0][d])
            worst = max(worst, abs(more) - _HELD * (ends[1][d] - ends[0][d]))
        if worst <= 0.0:
            break
    for d in range(len(mean)):
        # what holds a body is known in the middle of steps: half a step on, half the rise is added
        more = (last[d] - before[d]) / 2 if v0[d] == 0.0 else 0.0
        held[d] = min(max(last[d] + more, ends[0][d]), ends[1][d])


# Sampled controllers in a loop with the machine.


class LoopMatrices(NamedTuple):
    """Sampled controllers, one behind the other, for substeps of a given length.

    What controllers see, v, are references, outputs, and the commands of those before them:
    ``command = C x + D v``, ``x = A x + B v + W (command within its limits - command)``.

    Attributes
    ----------
    every, whole : ndarray of int, shape (loops,)
        Substeps of a period, and whole substeps of the delay.
    part : ndarray, shape (loops,)
        What is left of the delay, in substeps.
    A, B, C, D, W : ndarray
        Shapes (loops, nx, nx), (loops, nx, nv), (loops, nc, nx), (loops, nc, nv), (loops, nx, nc).
    owner, signal : ndarray of int, shape (nc,)
        Loop of each command, and the input signal that it drives, -1 if none.
    low, high, rise, step : ndarray, shape (nc,)
        Limits of commands and of their change over a period, and what they are rounded to.
    seen : ndarray, shape (3, ny)
        Gain and offset of sensors, and what they are rounded to.
    actuator : ndarray, shape (4, nc)
        Gain, dead zone and limit of actuators, and what is left of their lag after a substep.
    """

    every: Any
    whole: Any
    part: Array
    A: Array
    B: Array
    C: Array
    D: Array
    W: Array
    owner: Any
    signal: Any
    low: Array
    high: Array
    rise: Array
    step: Array
    seen: Array
    actuator: Array


@njit(cache=True, error_model="numpy")
def _rounded(value, step):  # type: ignore[no-untyped-def]
    return step * np.floor(value / step + 0.5) if step > 0.0 else value


@njit(cache=True, error_model="numpy")
def _sample(loops, now, v, y, x, sent):  # type: ignore[no-untyped-def]
    """Let those controllers act that are due at a substep; `sent` is a ring of their commands."""
    ny, nc, ring = y.size, loops.owner.size, sent.shape[1]
    first = v.size - nc
    for i in range(ny):
        seen = loops.seen[0, i] * y[i] + loops.seen[1, i]
        v[first - ny + i] = _rounded(seen, loops.seen[2, i])
    for k in range(loops.every.size):
        if now % loops.every[k] != 0:
            continue
        at = now // loops.every[k]
        ahead = loops.A[k] @ x[k] + loops.B[k] @ v
        for c in range(nc):
            if loops.owner[c] != k:
                continue
            wanted, before = 0.0, sent[c, (at - 1) % ring]
            for i in range(x.shape[1]):
                wanted += loops.C[k, c, i] * x[k, i]
            for i in range(v.size):
                wanted += loops.D[k, c, i] * v[i]
            given = min(max(wanted, before - loops.rise[c]), before + loops.rise[c])
            given = min(max(given, loops.low[c]), loops.high[c])
            sent[c, at % ring] = given = _rounded(given, loops.step[c])
            for i in range(x.shape[1]):
                ahead[i] += loops.W[k, i, c] * (given - wanted)
            v[first + c] = given
        x[k] = ahead


@njit(cache=True, error_model="numpy")
def _seen(loops, asked, ny, now, sent):  # type: ignore[no-untyped-def]
    """Return what controllers see before a substep: the commands of those before them."""
    nc, ring = loops.owner.size, sent.shape[1]
    v = np.zeros(asked + ny + nc)
    for c in range(nc):
        v[asked + ny + c] = sent[c, ((now - 1) // loops.every[loops.owner[c]]) % ring]
    return v


@njit(cache=True, error_model="numpy")
def _driven(loops, now, c, sent, before):  # type: ignore[no-untyped-def]
    """Return the ends of the line of what a command drives, an actuator's lag included."""
    begin, end = _acting(loops, now, c, sent)
    left = loops.actuator[3, c]
    if left > 0.0:
        return before, (1 - left) * (begin + end) / 2 + left * before
    return begin, end


@njit(cache=True, error_model="numpy")
def _acting(loops, now, c, sent):  # type: ignore[no-untyped-def]
    """Return the ends of the line that acts like a command over a substep, as late as it is.

    A command that changes within the substep gets the line of the same mean and first moment.
    """
    k, ring = loops.owner[c], sent.shape[1]
    part, late = loops.part[k], now - loops.whole[k]
    after = _acted(loops, c, sent[c, (late // loops.every[k]) % ring])
    if part == 0.0:
        return after, after
    before = _acted(loops, c, sent[c, ((late - 1) // loops.every[k]) % ring])
    mean, rise = part * before + (1 - part) * after, 6 * part * (1 - part) * (after - before)
    return mean - rise / 2, mean + rise / 2


@njit(cache=True, error_model="numpy")
def _acted(loops, c, command):  # type: ignore[no-untyped-def]
    """Return what an actuator makes of a command at once: its gain, dead zone and limit."""
    dead, most = loops.actuator[1, c], loops.actuator[2, c]
    size = loops.actuator[0, c] * command
    size -= min(max(size, -dead), dead)
    return min(max(size, -most), most)


@njit(cache=True, nogil=True, error_model="numpy")
def replay_loops(loops, R, Y, x, sent, substeps):  # type: ignore[no-untyped-def]
    """Run controllers along measured outputs, linear between samples.

    Returns their states and rings of commands before every sample, and the commands after it.
    """
    samples, nc = len(Y), loops.owner.size
    xs = np.empty((samples, *x.shape))
    rings = np.empty((samples, *sent.shape))
    commands = np.empty((samples, nc))
    v = _seen(loops, R.shape[1], Y.shape[1], 0, sent)
    x, sent = x.copy(), sent.copy()
    for k in range(samples):
        xs[k], rings[k], later = x, sent, min(k + 1, samples - 1)
        for j in range(substeps):
            share = j / substeps
            for i in range(R.shape[1]):
                v[i] = (1 - share) * R[k, i] + share * R[later, i]
            _sample(loops, k * substeps + j, v, (1 - share) * Y[k] + share * Y[later], x, sent)
            if j == 0:
                commands[k] = v[v.size - nc :]
    return xs, rings, commands


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def run_steps(
    m, output, laws, layout, p, W, E, loops, R, phase, controller, sent, Y, K, s0, z0, t0, dt,
    substeps, keep,
):  # type: ignore[no-untyped-def]  # fmt: skip
    """Step through the samples and return predictions, states, internal states and commands.

    Signals are lines from W at a sample to E at the end of the step that begins there; controllers
    in the loop, the first sample being `phase` of theirs, see references R and put theirs in place.

    Without feedback (K all zero) this is a free run; otherwise K times the prediction error
    is added to the states after every sample.
    """
    ahead, by_force, by_first, by_last, first, middle, last = m
    C, D, H = output
    samples, signals, ny = W.shape[0], W.shape[1], C.shape[0]
    n, ports, nz = s0.size, H.shape[1], z0.size
    known, motions = n + 2 * signals, 2 * ports
    rows = -(-ahead.shape[1] // _VECTOR) * _VECTOR
    wide = np.zeros((known, rows))
    wide[:, : ahead.shape[1]] = ahead
    feedback = np.any(K != 0.0)
    predicted = np.empty((samples, ny))
    kept = np.empty((samples if keep else 0, n))
    kept_z = np.empty((samples if keep else 0, nz))
    x, out, now = np.empty(known), np.empty(rows), np.empty(motions)
    x[:n] = s0
    z, zs = z0.copy(), np.zeros(nz)
    f0, fa, fb, fc = np.zeros(ports), np.zeros(ports), np.zeros(ports), np.zeros(ports)
    d0, da, db, dc = np.zeros(nz), np.zeros(nz), np.zeros(nz), np.zeros(nz)
    e = np.empty(ny)
    h = dt / substeps
    dry = np.flatnonzero(layout[:, 6])
    any_dry = len(dry) > 0
    push, tilt, by_push, by_tilt = _impulses(m, layout, dry, n, ports)
    v0, slow, held = np.zeros(len(dry)), np.zeros(len(dry)), np.zeros(len(dry))
    v1, mean, mid = np.empty(len(dry)), np.empty(len(dry)), np.zeros(len(dry))
    ends = np.empty(len(dry)), np.empty(len(dry))
    nc = loops.owner.size
    commands, lagging, y = np.empty((samples if nc else 0, nc)), np.zeros(nc), np.zeros(ny)
    v = _seen(loops, R.shape[1], ny, phase * substeps, sent)
    for c in range(nc):
        lagging[c] = _acting(loops, phase * substeps - 1, c, sent)[1]
    for k in range(samples):
        for j in range(substeps):
            t = t0 + k * dt + j * h
            x0, x1 = j / substeps, (j + 1) / substeps
            for i in range(signals):
                x[n + i] = (1 - x0) * W[k, i] + x0 * E[k, i]
                x[n + signals + i] = (1 - x1) * W[k, i] + x1 * E[k, i]
            for c in range(nc):  # as it was, until controllers have seen the outputs
                if loops.signal[c] >= 0:
                    x[n + loops.signal[c]] = x[n + signals + loops.signal[c]] = lagging[c]
            for turn in range(2):  # again where feedback moves the state
                for r in range(rows):
                    out[r] = 0.0
                for c in range(known):
                    for r in range(rows):
                        out[r] += wide[c, r] * x[c]
                _forces(laws, layout, p, t, out, n, ports, z, f0, d0)
                if any_dry:
                    if k == 0 and j == 0 and turn == 0:
                        _limits(laws, layout, p, t, out, n, ports, z, fa, da, dry, *ends)
                        _hold_at_start(
                            ahead, layout, dry, out, x, n, ports, by_push, ends, slow, held
                        )
                        mid[:] = held
                    for d in range(len(dry)):
                        v0[d] = out[n + ports + layout[dry[d], 0]]
                        if abs(v0[d]) <= slow[d]:
                            v0[d] = 0.0
                    _hold(f0, layout, dry, v0, held)
                if turn > 0 or (j > 0 and nc == 0):
                    break
                here, due = (phase + k) * substeps + j, False
                for i in range(loops.every.size):
                    due = due or here % loops.every[i] == 0
                for i in range(ny if due or j == 0 else 0):
                    total = 0.0
                    for c in range(n):
                        total += C[i, c] * x[c]
                    for c in range(signals):
                        total += D[i, c] * x[n + c]
                    for c in range(ports):
                        total += H[i, c] * f0[c]
                    y[i] = total
                if nc > 0:
                    if due:
                        for i in range(R.shape[1]):
                            v[i] = (1 - x0) * R[k, i] + x0 * R[min(k + 1, samples - 1), i]
                        _sample(loops, here, v, y, controller, sent)
                    for c in range(nc):
                        begin, end = _driven(loops, here, c, sent, lagging[c])
                        at = loops.signal[c]
                        if at >= 0:
                            first_change = begin - x[n + at]
                            last_change = end - x[n + signals + at]
                            for r in range(rows if first_change != 0 or last_change != 0 else 0):
                                out[r] += wide[n + at, r] * first_change
                                out[r] += wide[n + signals + at, r] * last_change
                            x[n + at], x[n + signals + at] = begin, end
                        lagging[c] = end
                        if j == 0:
                            commands[k, c] = begin
                if j > 0:
                    break
                predicted[k] = y
                if keep:
                    for i in range(n):
                        kept[k, i] = x[i]
                    for i in range(nz):
                        kept_z[k, i] = z[i]
                if not feedback:
                    break
                for i in range(ny):
                    e[i] = Y[k, i] - predicted[k, i]
                for r in range(n):
                    for i in range(ny):
                        x[r] += K[r, i] * e[i]
            if k + 1 == samples:
                break
            if ports > 0:
                at = n + motions
                force, rate = f0, d0
                for next_force, next_rate in ((fa, da), (fb, db)):  # both in the middle of the step
                    for r in range(motions):
                        total = out[at + r]
                        for i in range(ports):
                            total += by_force[i, r] * force[i]
                        now[r] = total
                    for i in range(nz):
                        zs[i] = z[i] + h / 2 * rate[i]
                    if any_dry:
                        _slide_on(now, ports, layout, dry, v0)
                    _forces(laws, layout, p, t + h / 2, now, 0, ports, zs, next_force, next_rate)
                    if any_dry:
                        _hold(next_force, layout, dry, v0, held)
                    force, rate = next_force, next_rate
                at += motions
                for r in range(motions):
                    total = out[at + r]
                    for i in range(ports):
                        total += by_first[i, r] * f0[i] + by_last[i, r] * fb[i]
                    now[r] = total
                for i in range(nz):
                    zs[i] = z[i] + h * db[i]
                if any_dry:
                    _slide_on(now, ports, layout, dry, v0)
                _forces(laws, layout, p, t + h, now, 0, ports, zs, fc, dc)
                if any_dry:
                    _hold(fc, layout, dry, v0, held)
                for i in range(ports):
                    both = fa[i] + fb[i]
                    for r in range(n):
                        out[r] += first[i, r] * f0[i] + middle[i, r] * both + last[i, r] * fc[i]
                for i in range(nz):
                    z[i] += h / 6 * (d0[i] + 2 * da[i] + 2 * db[i] + dc[i])
                if any_dry:
                    stops = False
                    for d in range(len(dry)):
                        port = layout[dry[d], 0]
                        v1[d] = _at_end(ahead, out, x, n, n + ports + port)
                        mean[d] = (f0[port] + 2 * (fa[port] + fb[port]) + fc[port]) / 6
                        stops = stops or not v0[d] * v1[d] > 0.0
                    if stops:
                        _limits(laws, layout, p, t + h, now, 0, ports, zs, fc, dc, dry, *ends)
                        _apply_stopping(
                            out, v0, v1, mean, push, tilt, by_push, by_tilt, ends, slow, mid, held
                        )
            for r in range(n):
                x[r] = out[r]
        total = 0.0
        for r in range(n):
            total += x[r]
        for i in range(nz):
            total += z[i]
        if not np.isfinite(total):
            predicted[k + 1 :] = np.nan
            kept[k + 1 :] = np.nan
            commands[k + 1 :] = np.nan
            break
    return predicted, kept, kept_z, commands


@njit(cache=True, nogil=True, error_model="numpy")
def run_pieces(
    m, output, laws, layout, p, W, E, loops, R, phase, controller, sent, S0, Z0, t0, marks, dt,
    substeps, keep,
):  # type: ignore[no-untyped-def]  # fmt: skip
    """Step freely through pieces that follow each other in W, each from a start of its own.

    What controllers are and have sent is left as it is at the ends of the pieces.
    """
    ny, n, nz = output[0].shape[0], S0.shape[1], Z0.shape[1]
    samples = W.shape[0]
    predicted = np.empty((samples, ny))
    kept = np.empty((samples if keep else 0, n))
    kept_z = np.empty((samples if keep else 0, nz))
    Y, K = np.zeros((1, ny)), np.zeros((n, ny))
    commands = np.empty((samples if loops.owner.size else 0, loops.owner.size))
    for i in range(len(S0)):
        a, b = marks[i], marks[i + 1]
        y, s, z, c = run_steps(
            m, output, laws, layout, p, W[a:b], E[a:b], loops, R[a:b], phase[i],
            controller[i], sent[i], Y, K, S0[i], Z0[i], t0[i], dt, substeps, keep,
        )  # fmt: skip
        predicted[a:b] = y
        if len(c):
            commands[a:b] = c
        if keep:
            kept[a:b] = s
            kept_z[a:b] = z
    return predicted, kept, kept_z, commands


class StepMatrices(NamedTuple):
    """Transition matrices of one substep, see :func:`step_matrices`."""

    half: Array
    full: Array
    half_now: Array
    half_later: Array
    full_now: Array
    full_later: Array
    half_force: Array
    first: Array
    middle: Array
    last: Array


class KernelMatrices(NamedTuple):
    """What a substep needs, put together once: products and sums are the kernel's whole cost.

    Motions at the ports, first all displacements and then all velocities, are linear in the state,
    the signals at both ends and the forces at the stages before, like the next state. All matrices
    are transposed: rows are what is known, columns what follows.

    Attributes
    ----------
    linear : ndarray, shape (n + 2 signals, n + 6 ports)
        State and signals to the next state without forces, and to the motions at the start, the
        middle and the end.
    by_force : ndarray, shape (ports, 2 ports)
        The force of the stage before to the motions in the middle.
    by_first, by_last : ndarray, shape (ports, 2 ports)
        The force at the start, and the second one in the middle, to the motions at the end.
    first, middle, last : ndarray, shape (ports, n)
        Forces at the start, in the middle (the sum of both) and at the end to the next state.
    """

    linear: Array
    by_force: Array
    by_first: Array
    by_last: Array
    first: Array
    middle: Array
    last: Array


def kernel_matrices(m: StepMatrices, motion: Sequence[Array]) -> KernelMatrices:
    """Return the matrices of a substep as the kernel takes them.

    Parameters
    ----------
    m : StepMatrices
    motion : sequence of ndarray
        (Qs, Qw, Vs, Vw): displacements ``Qs s + Qw w`` and velocities ``Vs s + Vw w`` at the ports.
    """
    of_state, of_signals = np.vstack(motion[::2]), np.vstack(motion[1::2])
    none = np.zeros_like(of_signals)
    # the signal in the middle is the mean of those at both ends
    middle = np.hstack([m.half, m.half_now + m.half_later / 2, m.half_later / 2])
    end = m.half @ middle
    end[:, len(m.half) :] += np.hstack([m.half_now / 2, m.half_now / 2 + m.half_later])
    rows = (
        np.hstack([m.full, m.full_now, m.full_later]),
        np.hstack([of_state, of_signals, none]),
        of_state @ middle + np.hstack([0 * of_state, of_signals / 2, of_signals / 2]),
        of_state @ end + np.hstack([0 * of_state, none, of_signals]),
    )
    parts = (
        np.vstack(rows),
        of_state @ m.half_force,
        of_state @ (m.half @ m.half_force - m.half_force),
        2 * of_state @ m.half_force,
        m.first, m.middle, m.last,
    )  # fmt: skip
    return KernelMatrices(*(np.ascontiguousarray(part.T) for part in parts))


def step_matrices(A: Array, B: Array, G: Array, step: float) -> StepMatrices:
    """Return the matrices of a substep of ``dx/dt = A x + B w + G f(x)``.

    Parameters
    ----------
    A, B, G : ndarray, shapes (n, n), (n, signals), (n, ports)
    step : float
        Length of the substep in s.
    """
    m = B.shape[1]
    columns = np.hstack([B, G])
    weights = _balanced(A)
    E, p1, p2, p3 = _phi(A, columns, step, weights)
    E2, h1, h2, _ = _phi(A, columns, step / 2, weights)
    b, g = slice(0, m), slice(m, None)
    parts = (
        E2, E,
        h1[:, b] - h2[:, b], h2[:, b],
        p1[:, b] - p2[:, b], p2[:, b],
        h1[:, g],
        (p1 - 3 * p2 + 4 * p3)[:, g], (2 * p2 - 4 * p3)[:, g], (4 * p3 - p2)[:, g],
    )  # fmt: skip
    return StepMatrices(*(np.ascontiguousarray(part) for part in parts))


def _balanced(A: Array) -> Array:
    """Return the sizes of states with which the norm of A is smallest."""
    if not A.size:
        return np.ones(0)
    return np.asarray(np.diag(matrix_balance(A, permute=False)[1]), dtype=np.float64)


def _phi(A: Array, B: Array, h: float, weights: Array) -> tuple[Array, Array, Array, Array]:
    """Return exp(A h) and h phi_k(A h) B for k = 1, 2, 3, states being of these sizes."""
    n, m = B.shape
    if n == 0:
        empty = np.zeros((0, m))
        return np.zeros((0, 0)), empty, empty, empty
    scaled = B * h / weights[:, None]
    size = np.max(np.abs(scaled), axis=0, initial=0.0)
    size[size == 0] = 1.0
    big = np.zeros((n + 3 * m, n + 3 * m))
    big[:n, :n] = A * h * (weights / weights[:, None])
    big[:n, n : n + m] = scaled / size
    big[n : n + m, n + m : n + 2 * m] = np.eye(m)
    big[n + m : n + 2 * m, n + 2 * m :] = np.eye(m)
    exponential: Array = np.array(expm(big)[:n], dtype=float)
    E = exponential[:, :n] * (weights[:, None] / weights)
    phis = [exponential[:, n + k * m : n + (k + 1) * m] * weights[:, None] * size for k in range(3)]
    return E, phis[0], phis[1], phis[2]
