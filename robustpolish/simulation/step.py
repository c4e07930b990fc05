"""Compiled stepping of a linear system with nonlinear port forces.

The linear part is integrated exactly (the inputs are linear between samples), the port
forces by the exponential Runge-Kutta method ETDRK4 of Cox and Matthews (2002), J. Comput.
Phys. 176, 430-455, their internal states by the matching classical stages. Stiff linear modes
therefore cost no small steps; only stiff or sharp effects do.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
from scipy.linalg import expm, matrix_balance

from robustpolish.arrays import Array


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
    E, p1, p2, p3 = _phi(A, columns, step)
    E2, h1, h2, _ = _phi(A, columns, step / 2)
    b, g = slice(0, m), slice(m, None)
    parts = (
        E2, E,
        h1[:, b] - h2[:, b], h2[:, b],
        p1[:, b] - p2[:, b], p2[:, b],
        h1[:, g],
        (p1 - 3 * p2 + 4 * p3)[:, g], (2 * p2 - 4 * p3)[:, g], (4 * p3 - p2)[:, g],
    )  # fmt: skip
    return StepMatrices(*(np.ascontiguousarray(part) for part in parts))


def _phi(A: Array, B: Array, h: float) -> tuple[Array, Array, Array, Array]:
    """Return exp(A h) and h phi_k(A h) B for k = 1, 2, 3."""
    n, m = B.shape
    if n == 0:
        empty = np.zeros((0, m))
        return np.zeros((0, 0)), empty, empty, empty
    weights = np.asarray(np.diag(matrix_balance(A, permute=False)[1]), dtype=np.float64)
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


@numba.njit(cache=True, fastmath={"contract"})
def _mul(M, x, out):  # type: ignore[no-untyped-def]  # compiled
    for i in range(M.shape[0]):
        total = 0.0
        for j in range(M.shape[1]):
            total += M[i, j] * x[j]
        out[i] = total


@numba.njit(cache=True, fastmath={"contract"})
def _add(M, x, out):  # type: ignore[no-untyped-def]  # compiled
    for i in range(M.shape[0]):
        total = 0.0
        for j in range(M.shape[1]):
            total += M[i, j] * x[j]
        out[i] += total


@numba.njit(cache=True)
def _sum(x, factor, y, out):  # type: ignore[no-untyped-def]  # compiled
    for i in range(out.size):
        out[i] = x[i] + factor * y[i]


@numba.njit(cache=True)
def _forces(laws, layout, p, t, motion, s, w, q, v, z, f, dz):  # type: ignore[no-untyped-def]
    """Evaluate all laws; `layout` rows: port, ports, state, states, parameter, parameters."""
    _mul(motion[0], s, q)
    _add(motion[1], w, q)
    _mul(motion[2], s, v)
    _add(motion[3], w, v)
    if len(laws) == 1:  # spares the slices
        laws[0](t, q, v, z, p, f, dz)
        return
    for i in range(len(laws)):
        a, na, b, nb, c, nc = layout[i]
        laws[i](
            t, q[a : a + na], v[a : a + na], z[b : b + nb], p[c : c + nc],
            f[a : a + na], dz[b : b + nb],
        )  # fmt: skip


@numba.njit(cache=True, nogil=True, error_model="numpy")
def run_steps(m, motion, output, laws, layout, p, W, Y, K, s0, z0, t0, dt, substeps, keep):  # type: ignore[no-untyped-def]
    """Step through the samples and return predictions, states and internal states.

    Without feedback (K all zero) this is a free run; otherwise K times the prediction error
    is added to the states after every sample.
    """
    half, full, hn, hl, fn, fl, hf, first, middle, last = m
    C, D, H = output
    samples, ny = W.shape[0], C.shape[0]
    n, ports, nz = s0.size, H.shape[1], z0.size
    feedback = np.any(K != 0.0)
    predicted = np.empty((samples, ny))
    kept = np.empty((samples if keep else 0, n))
    kept_z = np.empty((samples if keep else 0, nz))
    s, z = s0.copy(), z0.copy()
    a, c, new, base = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    q, v = np.empty(ports), np.empty(ports)
    f0, fa, fb, fc = np.zeros(ports), np.zeros(ports), np.zeros(ports), np.zeros(ports)
    d0, da, db, dc = np.zeros(nz), np.zeros(nz), np.zeros(nz), np.zeros(nz)
    fs, zs = np.zeros(ports), np.zeros(nz)
    w0, wh, w1 = W[0].copy(), W[0].copy(), W[0].copy()
    e, y = np.empty(ny), np.empty(ny)
    h = dt / substeps
    for k in range(samples):
        t = t0 + k * dt
        for i in range(w0.size):
            w0[i] = W[k, i]
        _forces(laws, layout, p, t, motion, s, w0, q, v, z, f0, d0)
        _mul(C, s, y)
        _add(D, w0, y)
        _add(H, f0, y)
        for i in range(ny):
            predicted[k, i] = y[i]
        if feedback:
            for i in range(ny):
                e[i] = Y[k, i] - y[i]
            _add(K, e, s)
        if keep:
            kept[k] = s
            kept_z[k] = z
        if k + 1 == samples:
            break
        for j in range(substeps):
            x0, x1 = j / substeps, (j + 1) / substeps
            for i in range(w0.size):
                w0[i] = (1 - x0) * W[k, i] + x0 * W[k + 1, i]
                w1[i] = (1 - x1) * W[k, i] + x1 * W[k + 1, i]
                wh[i] = 0.5 * (w0[i] + w1[i])
            tj = t + j * h
            if j > 0 or feedback:
                _forces(laws, layout, p, tj, motion, s, w0, q, v, z, f0, d0)
            _mul(half, s, base)
            _add(hn, w0, base)
            _add(hl, wh, base)
            if ports == 0:
                _mul(full, s, new)
                _add(fn, w0, new)
                _add(fl, w1, new)
                s, new = new, s
                continue
            for i in range(n):
                a[i] = base[i]
            _add(hf, f0, a)
            _sum(z, h / 2, d0, zs)
            _forces(laws, layout, p, tj + h / 2, motion, a, wh, q, v, zs, fa, da)
            for i in range(n):
                c[i] = base[i]
            _add(hf, fa, c)
            _sum(z, h / 2, da, zs)
            _forces(laws, layout, p, tj + h / 2, motion, c, wh, q, v, zs, fb, db)
            _mul(half, a, c)
            _add(hn, wh, c)
            _add(hl, w1, c)
            for i in range(ports):
                fs[i] = 2 * fb[i] - f0[i]
            _add(hf, fs, c)
            _sum(z, h, db, zs)
            _forces(laws, layout, p, tj + h, motion, c, w1, q, v, zs, fc, dc)
            _mul(full, s, new)
            _add(fn, w0, new)
            _add(fl, w1, new)
            _add(first, f0, new)
            for i in range(ports):
                fs[i] = fa[i] + fb[i]
            _add(middle, fs, new)
            _add(last, fc, new)
            s, new = new, s
            for i in range(nz):
                z[i] += h / 6 * (d0[i] + 2 * da[i] + 2 * db[i] + dc[i])
        if not np.isfinite(s.sum() + z.sum()):
            predicted[k + 1 :] = np.nan
            kept[k + 1 :] = np.nan
            break
    return predicted, kept, kept_z


@numba.njit(cache=True, nogil=True, error_model="numpy")
def run_pieces(m, motion, output, laws, layout, p, W, S0, Z0, t0, marks, dt, substeps, keep):  # type: ignore[no-untyped-def]
    """Step freely through pieces that follow each other in W, each from a start of its own."""
    ny, n, nz = output[0].shape[0], S0.shape[1], Z0.shape[1]
    samples = W.shape[0]
    predicted = np.empty((samples, ny))
    kept = np.empty((samples if keep else 0, n))
    kept_z = np.empty((samples if keep else 0, nz))
    Y, K = np.zeros((1, ny)), np.zeros((n, ny))
    for i in range(len(S0)):
        a, b = marks[i], marks[i + 1]
        y, s, z = run_steps(
            m, motion, output, laws, layout, p, W[a:b], Y, K, S0[i], Z0[i], t0[i], dt, substeps,
            keep,
        )  # fmt: skip
        predicted[a:b] = y
        if keep:
            kept[a:b] = s
            kept_z[a:b] = z
    return predicted, kept, kept_z
