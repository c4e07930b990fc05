"""Compiled stepping of a linear system with nonlinear port forces: see :mod:`.step`."""

from __future__ import annotations

import numba
import numpy as np

from robustpolish.effects import call_law


@numba.njit(cache=True, error_model="numpy")
def _forces(laws, layout, p, t, motion, at, ports, z, f, dz):  # type: ignore[no-untyped-def]
    """Evaluate all laws at motions that begin at an entry: displacements, then velocities.

    `layout` rows: port, ports, state, states, parameter, parameters.
    """
    for i in range(len(laws)):
        port, state, own = layout[i, 0], layout[i, 2], layout[i, 4]
        q = at + port
        call_law(laws[i], t, motion, q, motion, q + ports, z, state, p, own, f, port, dz, state)


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def run_steps(m, output, laws, layout, p, W, Y, K, s0, z0, t0, dt, substeps, keep):  # type: ignore[no-untyped-def]
    """Step through the samples and return predictions, states and internal states.

    Without feedback (K all zero) this is a free run; otherwise K times the prediction error
    is added to the states after every sample.
    """
    ahead, by_force, by_first, by_last, first, middle, last = m
    C, D, H = output
    samples, signals, ny = W.shape[0], W.shape[1], C.shape[0]
    n, ports, nz = s0.size, H.shape[1], z0.size
    known, rows, motions = n + 2 * signals, ahead.shape[1], 2 * ports
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
    for k in range(samples):
        later = min(k + 1, samples - 1)
        for j in range(substeps):
            t = t0 + k * dt + j * h
            x0, x1 = j / substeps, (j + 1) / substeps
            for i in range(signals):
                x[n + i] = (1 - x0) * W[k, i] + x0 * W[later, i]
                x[n + signals + i] = (1 - x1) * W[k, i] + x1 * W[later, i]
            for turn in range(2):  # again where feedback moves the state
                for r in range(rows):
                    out[r] = 0.0
                for c in range(known):
                    for r in range(rows):
                        out[r] += ahead[c, r] * x[c]
                _forces(laws, layout, p, t, out, n, ports, z, f0, d0)
                if j > 0 or turn > 0:
                    break
                for i in range(ny):
                    total = 0.0
                    for c in range(n):
                        total += C[i, c] * x[c]
                    for c in range(signals):
                        total += D[i, c] * x[n + c]
                    for c in range(ports):
                        total += H[i, c] * f0[c]
                    predicted[k, i] = total
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
                for r in range(motions):
                    total = out[at + r]
                    for i in range(ports):
                        total += by_force[i, r] * f0[i]
                    now[r] = total
                for i in range(nz):
                    zs[i] = z[i] + h / 2 * d0[i]
                _forces(laws, layout, p, t + h / 2, now, 0, ports, zs, fa, da)
                for r in range(motions):
                    total = out[at + r]
                    for i in range(ports):
                        total += by_force[i, r] * fa[i]
                    now[r] = total
                for i in range(nz):
                    zs[i] = z[i] + h / 2 * da[i]
                _forces(laws, layout, p, t + h / 2, now, 0, ports, zs, fb, db)
                at += motions
                for r in range(motions):
                    total = out[at + r]
                    for i in range(ports):
                        total += by_first[i, r] * f0[i] + by_last[i, r] * fb[i]
                    now[r] = total
                for i in range(nz):
                    zs[i] = z[i] + h * db[i]
                _forces(laws, layout, p, t + h, now, 0, ports, zs, fc, dc)
                for i in range(ports):
                    both = fa[i] + fb[i]
                    for r in range(n):
                        out[r] += first[i, r] * f0[i] + middle[i, r] * both + last[i, r] * fc[i]
                for i in range(nz):
                    z[i] += h / 6 * (d0[i] + 2 * da[i] + 2 * db[i] + dc[i])
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
            break
    return predicted, kept, kept_z


@numba.njit(cache=True, nogil=True, error_model="numpy")
def run_pieces(m, output, laws, layout, p, W, S0, Z0, t0, marks, dt, substeps, keep):  # type: ignore[no-untyped-def]
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
            m, output, laws, layout, p, W[a:b], Y, K, S0[i], Z0[i], t0[i], dt, substeps, keep
        )
        predicted[a:b] = y
        if keep:
            kept[a:b] = s
            kept_z[a:b] = z
    return predicted, kept, kept_z
