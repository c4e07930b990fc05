"""Evaluate a law along a known motion, and the candidate forces for screening with it.

A signal behind a lag is evaluated here, too.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from functools import lru_cache
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic
from scipy.signal import lfilter

from robustpolish.base.arrays import Array
from robustpolish.base.checks import invalid
from robustpolish.base.jit import cache_of, njit
from robustpolish.machines.effects.kind import EffectKind, Motion, Shape

# Force laws as machine code that kernels call by address.
#
# All laws have one signature, of plain pointers: a kernel compiled for each law anew would fill
# Numba's cache with an entry from every process, and arrays as arguments would cost more than most
# laws do.

POINTER = types.CPointer(types.float64)
"""How a law sees motions, internal states, parameters, forces and rates."""
_ARRAY = types.float64[::1]
_SIGNATURE = types.void(types.float64, *[POINTER] * 6)


def machine_code(law: Callable[..., None], cache: bool = True) -> Any:
    """Return a law ``law(t, q, v, z, p, f, dz)`` as a C function with an ``address``.

    Parameters
    ----------
    law : callable
        It reads and writes single entries of what it is given, and asks for no lengths.
    cache : bool, optional
        Whether a file keeps the result for the next process.
    """
    with cache_of(law) if cache else nullcontext():
        return numba.cfunc(_SIGNATURE, cache=cache, error_model="numpy")(law)


@lru_cache(maxsize=256)
def compiled_law(kind: EffectKind) -> Any:
    """Return the law of a kind as a C function; its address holds as long as it is kept."""
    if kind.law is None:
        raise invalid("kind", kind.kind, "an effect with a force law", "Choose another kind.")
    compiled = getattr(kind.law, "compiled", None)  # of a law that no file holds as a function
    return machine_code(kind.law) if compiled is None else compiled()


def _call(typing_context, address, t, q, iq, v, iv, z, iz, p, ip, f, jf, dz, jz):  # type: ignore[no-untyped-def]  # compiled
    """Call the law at an address; every array comes with the entry at which the law's own begin."""
    places = [_ARRAY, types.intp] * 6

    def generate(context, builder, _, given):  # type: ignore[no-untyped-def]
        number = ir.DoubleType()
        pointers = [
            builder.gep(context.make_array(_ARRAY)(context, builder, array).data, [first])
            for array, first in zip(given[2::2], given[3::2], strict=True)
        ]
        law = ir.FunctionType(ir.VoidType(), [number, *[number.as_pointer()] * 6])
        builder.call(builder.inttoptr(given[0], law.as_pointer()), [given[1], *pointers])
        return context.get_dummy_value()

    return types.void(types.intp, types.float64, *places), generate


call_law: Any = intrinsic(_call)


_LEAST_SUBSTEPS = 4
MOST_SUBSTEPS = 64
"""Of a sample, in which internal states are followed along a motion."""

_ROUNDING_RATIO = 1e-12
"""A column this much smaller than another is rounding: the sine of a spin that stands still."""


@njit(cache=True, nogil=True)
def _interpolate_motion(q, v, n, x, qs, vs):  # type: ignore[no-untyped-def]  # compiled
    for i in range(qs.size):
        qs[i] = (1 - x) * q[i, n] + x * q[i, n + 1]
        vs[i] = (1 - x) * v[i, n] + x * v[i, n + 1]


@njit(cache=True, nogil=True, error_model="numpy")
def _run(law, t, q, v, p, z, f, substeps):  # type: ignore[no-untyped-def]  # compiled
    ports, samples = q.shape
    out = np.empty((ports, samples))
    k1, k2, ahead = np.zeros(z.size), np.zeros(z.size), np.zeros(z.size)
    qs, vs = np.empty(ports), np.empty(ports)
    for n in range(samples):
        for i in range(ports):
            qs[i], vs[i] = q[i, n], v[i, n]
        call_law(law, t[n], qs, 0, vs, 0, z, 0, p, 0, f, 0, k1, 0)
        for i in range(ports):
            out[i, n] = f[i]
        if z.size == 0 or n + 1 == samples:
            continue
        dt = (t[n + 1] - t[n]) / substeps
        for j in range(substeps):
            if j > 0:
                call_law(law, t[n] + j * dt, qs, 0, vs, 0, z, 0, p, 0, f, 0, k1, 0)
            for i in range(z.size):
                ahead[i] = z[i] + dt * k1[i]
            _interpolate_motion(q, v, n, (j + 1) / substeps, qs, vs)
            call_law(law, t[n] + (j + 1) * dt, qs, 0, vs, 0, ahead, 0, p, 0, f, 0, k2, 0)
            for i in range(z.size):
                z[i] += 0.5 * dt * (k1[i] + k2[i])
        if not np.isfinite(z.sum()):
            z[:] = 0.0  # values that no step can follow: start from rest again
    return out


def force_along(kind: EffectKind, motion: Motion, values: Array) -> Array:
    """Return the force of a law along a given motion, shape (ports, samples).

    Internal states start at rest and are stepped with the motion (Heun).

    Parameters
    ----------
    kind : EffectKind
    motion : Motion
    values : ndarray
        Of the parameters, in the kind's order.

    Returns
    -------
    ndarray, shape (ports, samples)
    """
    q, v = np.ascontiguousarray(motion.q), np.ascontiguousarray(motion.v)
    values = np.ascontiguousarray(values, dtype=float)
    law = compiled_law(kind)
    substeps = _substeps(kind, motion, values)
    start, force = np.zeros(kind.states), np.zeros(len(q))
    return _run(law.address, motion.time, q, v, values, start, force, substeps)


def force_with(kind: EffectKind, values: Mapping[str, float], motion: Motion) -> Array:
    """Return the force of a law along a motion, what it asks of its model taken from there.

    Parameters
    ----------
    kind : EffectKind
    values : mapping of str to float
        Of the parameters by name, in the kind's order.
    motion : Motion

    Returns
    -------
    ndarray, shape (ports, samples)
    """
    known = [motion.context.get(name, 0.0) for name in kind.context]
    return force_along(kind, motion, np.array([*values.values(), *known]))


def _substeps(kind: EffectKind, motion: Motion, values: Array) -> int:
    """Return steps per sample that follow the fastest rate of the internal states."""
    rate = 0.0
    if kind.states:
        numbers = dict(zip((p.name for p in kind.parameters), values.tolist(), strict=False))
        fastest = float(np.max(np.abs(motion.v), initial=0.0))
        rate = kind.steepness(numbers, motion.amplitude, fastest)[2]
    wanted = np.nan_to_num(np.ceil(rate * (motion.time[1] - motion.time[0])), posinf=1e9)
    return int(np.clip(wanted, _LEAST_SUBSTEPS, MOST_SUBSTEPS))


def shapes_along(kind: EffectKind, motion: Motion) -> list[Shape]:
    """Return the candidate forces of a kind along a given motion, for every choice of its scan.

    Parameters
    ----------
    kind : EffectKind
    motion : Motion

    Returns
    -------
    list of Shape
        Without those that the motion does not excite. Columns of an effect on a signal are what
        it adds to the signal.
    """
    if kind.shapes is not None:
        return kind.shapes(motion)
    if not (kind.linear_in or kind.scan):
        return []
    choices = itertools.product(*(scan.values(motion) for scan in kind.scan))
    excited = []
    for shape in (_shape(kind, motion, choice) for choice in choices):
        sizes = np.abs(shape.columns).max(axis=(1, 2))
        if np.isfinite(sizes).all() and sizes.min() > _ROUNDING_RATIO * sizes.max():
            excited.append(shape)
    return excited


def _shape(kind: EffectKind, motion: Motion, choice: tuple[float, ...]) -> Shape:
    """Return a column for a unit of each entry of `linear_in`, the scanned values as chosen."""
    chosen = {scan.parameter: value for scan, value in zip(kind.scan, choice, strict=True)}
    entries = [(entry,) if isinstance(entry, str) else entry for entry in kind.linear_in]
    linear = [p for p in kind.parameters if any(p.name in names for names in entries)]
    first = {p.name: p.default for p in kind.parameters} | chosen
    rest = dict(first)  # what is there when all coefficients are 0
    if not kind.acts_on_signals:
        growing = [p for p in kind.parameters if p.name in chosen and p.counts_force]
        rest.update((p.name, 0.0) for p in (*linear, *growing))
        first.update((p.name, 0.0) for p in linear)
    units = [first | {name: first[name] + 1.0 for name in names} for names in entries] or [first]
    signs = (1 if all(p.lower >= 0 for p in linear) else 0,) * len(units)
    angle = next((p.name for p in kind.parameters if p.dimension == "rad"), None)
    if angle is not None:  # a cosine with any phase is one with none and one a quarter turn on
        units, signs = [units[0], units[0] | {angle: np.pi / 2}], (0, 0)
    kept = [scan.parameter for scan in kind.scan if scan.kept]
    told = [p.name for p in kind.parameters if p in linear or p.name in kept]

    def values(c: Array) -> dict[str, float]:
        turned = {} if angle is None else {angle: float(np.arctan2(c[1], c[0]))}
        sizes = c if angle is None else [np.hypot(c[0], c[1]), 0.0]
        moves = list(zip(sizes, units, strict=True))
        moved = {n: sum((size * (u[n] - rest[n]) for size, u in moves), rest[n]) for n in told}
        return {name: float(value) for name, value in moved.items()} | turned

    if kind.on_signal is not None:
        signals = [kind.on_signal(motion.q[0], motion.time, u) for u in (*units, rest)]
        columns = [(signal - signals[-1])[None] for signal in signals[:-1]]
    else:
        columns = [force_with(kind, u, motion) for u in units]
    return Shape(np.stack(columns), values, signs)


def first_order_lag(begin: Array, end: Array, step: float, lag: float) -> Array:
    """Return a signal behind a first-order lag, at its samples: exact for lines between them.

    Parameters
    ----------
    begin, end : ndarray, shape (samples,)
        The line over the step after each sample.
    step, lag : float
        Time between samples and time constant, in s.

    Returns
    -------
    ndarray, shape (samples,)
        It has followed the first sample for long.

    Examples
    --------
    >>> ramp = np.arange(4.0)
    >>> (ramp - first_order_lag(ramp, ramp + 1, 1.0, 0.1)).round(3).tolist()
    [0.0, 0.1, 0.1, 0.1]
    """
    if not lag > 0:
        return begin
    kept = np.exp(-step / lag)
    behind = (end - begin) * (lag / step)
    driven = end - behind - kept * (begin - behind)
    return np.asarray(lfilter([1.0], [1.0, -kept], np.concatenate([begin[:1], driven[:-1]])))
