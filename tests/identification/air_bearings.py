"""Records of an air bearing under the brush, by an integrator that is not the package's.

The linear part is exact over a step of 0.5 us (matrix exponential), nonlinear forces are pushes
before and after it (Strang splitting), dry friction is an impulse that stops the body or has its
largest size (J. J. Moreau 1988, Unilateral contact and dry friction in finite freedom dynamics).
"""

from functools import lru_cache

import numba
import numpy as np
from scipy.linalg import expm

import robustpolish as rp

MODEL = rp.polishing.air_bearing_model()
NAMES = MODEL.dof_names
STEP, STEPS = 5e-5, 100


@lru_cache
def brush(run=4, duration=0.4):
    """Forces of the brush on a rigid machine."""
    signals = rp.polishing.simulate_brush(run=run, duration=duration)
    return signals[["F_x", "F_y", "F_z", "F_p"]]


@numba.njit(cache=True)
def _push(code, p, a, b, q, v, mass, h):
    """Change the velocities by what a force does in a time h; b is -1 for ground."""
    d = q[a] - (q[b] if b >= 0 and code not in (4, 5) else 0.0)
    f = 0.0
    if code == 1:  # Coulomb friction: an impulse that stops the body, or of the largest size
        s = v[a] - (v[b] if b >= 0 else 0.0)
        give = 1 / mass[a] + (1 / mass[b] if b >= 0 else 0.0)
        impulse = min(max(-s / give, -p[0] * h), p[0] * h)
        v[a] += impulse / mass[a]
        if b >= 0:
            v[b] -= impulse / mass[b]
        return
    if code == 2:  # stop at p[0]
        f = -p[1] * (max(d - p[0], 0.0) if p[0] > 0 else min(d - p[0], 0.0))
    elif code == 3:
        f = -p[0] * d**3
    elif code == 4:  # cross stiffness
        v[a], v[b] = v[a] - h * p[0] * q[b] / mass[a], v[b] - h * p[0] * q[a] / mass[b]
        return
    elif code == 5:  # gyroscopic coupling: the velocities turn
        turn = p[0] * h / mass[a]
        c, s = np.cos(turn), np.sin(turn)
        v[a], v[b] = c * v[a] - s * v[b], s * v[a] + c * v[b]
        return
    v[a] += h * f / mass[a]
    if b >= 0:
        v[b] -= h * f / mass[b]


@numba.njit(cache=True)
def _integrate(F, G0, G1, U, steps, mass, x, h, code, p, a, b):
    n = len(mass)
    found = np.empty((len(U), n))
    for k in range(len(U)):
        found[k] = x[:n]
        if k + 1 == len(U):
            break
        for j in range(steps):
            u = U[k] + (U[k + 1] - U[k]) * (j / steps)
            slope = (U[k + 1] - U[k]) / (steps * h)
            _push(code, p, a, b, x[:n], x[n:], mass, 0.5 * h)
            x[:] = F @ x + G0 @ u + G1 @ slope
            _push(code, p, a, b, x[:n], x[n:], mass, 0.5 * h)
    return found


KINDS = ("", "coulomb_friction", "contact_stop", "cubic_stiffness", "cross_stiffness",
         "gyroscopic_coupling")  # fmt: skip


def measured(
    kind="", at=("x", "ground"), numbers=(0.0,), masses=None, late=0, gains=None, noise=20e-9,
    sensors=("x", "y", "z"), run=4, duration=0.4, seed=0,
):  # fmt: skip
    """Return a record of the bearing with an effect of a kind, from rest under the first load."""
    load = brush(run, duration)
    model = MODEL.with_parameters({f"dof.{name}.mass": m for name, m in (masses or {}).items()})
    m, n = model.matrices, len(NAMES)
    mass, B = np.diag(m.M), np.zeros((n, len(model.inputs)))
    for j, item in enumerate(model.inputs):
        B[NAMES.index(item.on[0]), j] = item.gain
    U = np.stack([load[name].values for name in model.input_names], 1)
    acting = np.vstack([np.repeat(U[:1], late, 0), U[: len(U) - late]])
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-m.K / mass[:, None], -m.C / mass[:, None]]])
    E = np.vstack([np.zeros_like(B), B / mass[:, None]])
    h, k = STEP / STEPS, B.shape[1]
    large = np.zeros((2 * n + 2 * k,) * 2)
    large[: 2 * n, : 2 * n], large[: 2 * n, 2 * n : 2 * n + k] = A, E
    large[2 * n : 2 * n + k, 2 * n + k :] = np.eye(k)
    F, G0, G1 = np.split(expm(large * h)[: 2 * n], [2 * n, 2 * n + k], axis=1)
    x = np.concatenate([np.linalg.solve(m.K, B @ acting[0]), np.zeros(n)])
    a, b = (NAMES.index(name) if name != "ground" else -1 for name in at)
    parts = (np.ascontiguousarray(part) for part in (F, G0, G1))
    q = _integrate(
        *parts, acting, STEPS, mass.copy(), x, h, KINDS.index(kind), np.array(numbers), a, b
    )
    random, data = np.random.default_rng(seed), load.copy()
    for name in sensors:
        reading = q[:, NAMES.index(name)] * (gains or {}).get(name, 1.0)
        data[name] = ("time", reading + noise * random.standard_normal(len(q)), {"units": "m"})
    return data
