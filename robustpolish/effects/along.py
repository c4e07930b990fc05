"""Evaluate a compiled law along a known motion."""

from __future__ import annotations

import numba
import numpy as np
from numba import types
from numba.typed import List

from robustpolish.arrays import Array
from robustpolish.effects.kind import EffectKind, compiled_law, law_signature
from robustpolish.effects.shapes import Motion

_LEAST_SUBSTEPS, _MOST_SUBSTEPS = 8, 64


@numba.njit(cache=True)
def _between(q, v, n, x, qs, vs):  # type: ignore[no-untyped-def]  # compiled
    for i in range(qs.size):
        qs[i] = (1 - x) * q[i, n] + x * q[i, n + 1]
        vs[i] = (1 - x) * v[i, n] + x * v[i, n + 1]


@numba.njit(cache=True, error_model="numpy")
def _run(laws, t, q, v, p, z, f, substeps):  # type: ignore[no-untyped-def]  # compiled
    ports, samples = q.shape
    out = np.empty((ports, samples))
    k1 = np.zeros(z.size)
    k2 = np.zeros(z.size)
    qs = np.empty(ports)
    vs = np.empty(ports)
    for n in range(samples):
        qs[:] = q[:, n]
        vs[:] = v[:, n]
        laws[0](t[n], qs, vs, z, p, f, k1)
        out[:, n] = f
        if z.size and n + 1 < samples:
            dt = (t[n + 1] - t[n]) / substeps
            for j in range(substeps):
                _between(q, v, n, j / substeps, qs, vs)
                laws[0](t[n] + j * dt, qs, vs, z, p, f, k1)
                predicted = z + dt * k1
                _between(q, v, n, (j + 1) / substeps, qs, vs)
                laws[0](t[n] + (j + 1) * dt, qs, vs, predicted, p, f, k2)
                z += 0.5 * dt * (k1 + k2)
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
    # In a list all laws have one type: a kernel compiled for each of them anew would fill Numba's
    # cache with an entry from every process, and take longer to load each time.
    laws = List.empty_list(types.FunctionType(law_signature()))
    laws.append(compiled_law(kind))
    substeps = _substeps(kind, motion, values)
    return _run(laws, motion.time, q, v, values, np.zeros(kind.states), np.zeros(len(q)), substeps)


def _substeps(kind: EffectKind, motion: Motion, values: Array) -> int:
    """Return steps per sample that follow the fastest rate of the internal states."""
    rate = 0.0
    if kind.states:
        numbers = dict(zip((p.name for p in kind.parameters), values.tolist(), strict=False))
        fastest = float(np.max(np.abs(motion.v), initial=0.0))
        rate = kind.gains(numbers, motion.amplitude, fastest)[2]
    wanted = np.nan_to_num(np.ceil(rate * (motion.time[1] - motion.time[0])), posinf=1e9)
    return int(np.clip(wanted, _LEAST_SUBSTEPS, _MOST_SUBSTEPS))
