"""Evaluate a compiled law along a known motion."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from robustpolish.effects.shapes import Motion


@numba.njit(cache=True, error_model="numpy")
def _run(law, t, q, v, p, z, f):  # type: ignore[no-untyped-def]  # compiled
    ports, samples = q.shape
    out = np.empty((ports, samples))
    k1 = np.zeros(z.size)
    k2 = np.zeros(z.size)
    qs = np.empty(ports)
    vs = np.empty(ports)
    for n in range(samples):
        qs[:] = q[:, n]
        vs[:] = v[:, n]
        law(t[n], qs, vs, z, p, f, k1)
        out[:, n] = f
        if z.size and n + 1 < samples:
            dt = t[n + 1] - t[n]
            predicted = z + dt * k1
            qs[:] = q[:, n + 1]
            vs[:] = v[:, n + 1]
            law(t[n + 1], qs, vs, predicted, p, f, k2)
            z += 0.5 * dt * (k1 + k2)
    return out


def run(law: Any, states: int, motion: Motion, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the force along the motion, shape (ports, samples)."""
    q = np.ascontiguousarray(motion.q)
    v = np.ascontiguousarray(motion.v)
    return _run(law, motion.time, q, v, values, np.zeros(states), np.zeros(q.shape[0]))
