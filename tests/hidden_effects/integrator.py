"""An integrator of its own for the hidden cases: classical Runge-Kutta, many small steps.

Nothing of the package is used here, so that a mistake in its force laws or its stepping
cannot hide.
"""

import numba
import numpy as np

KINDS = """
    coulomb_friction stribeck_friction elastic_coulomb_friction lugre_friction
    quadratic_damping displacement_dependent_damping bouc_wen_hysteresis cubic_stiffness
    quadratic_stiffness backlash contact_stop pendulum_gravity constant_force harmonic_force
    unbalance parametric_stiffness gyroscopic_coupling cross_stiffness attached_resonator
    drifting_stiffness fifth_power_stiffness random_walk_force fading_damping
    saturating_spring dead_zone_spring power_damping maxwell_element
"""
CODES = {kind: code for code, kind in enumerate(KINDS.split())}


@numba.njit(cache=True)
def force_of(code, p, t, a, b, q, v, z, dz, f):
    """Add the force of one effect; a and b are coordinates, -1 is ground."""
    d, s = q[a], v[a]
    if b >= 0 and code not in (14, 16, 17):
        d, s = d - q[b], s - v[b]
    g = 0.0
    if code == 0:
        g = -p[0] * np.tanh(s / p[1])
    elif code == 1:
        g = -(p[0] + (p[1] - p[0]) * np.exp(-((s / p[2]) ** 2))) * np.tanh(s / p[3])
    elif code == 2:  # z is the slider's position
        stretch = d - z[0]
        limit = p[0] / p[1]
        if stretch > limit:
            z[0] = d - limit
        elif stretch < -limit:
            z[0] = d + limit
        g = -p[1] * (d - z[0])
    elif code == 3:  # z is the mean bristle deflection
        curve = (p[0] + (p[1] - p[0]) * np.exp(-((s / p[2]) ** 2))) / p[3]
        dz[0] = s - abs(s) * z[0] / curve
        g = -p[3] * z[0] - p[4] * dz[0]
    elif code == 4:
        g = -p[0] * abs(s) * s
    elif code == 5:
        g = -p[0] * d * d * s
    elif code == 6:  # z is dimensionless, p: stiffness, yield displacement, n
        dz[0] = (
            s - 0.5 * abs(s) * abs(z[0]) ** (p[2] - 1) * z[0] - 0.5 * s * abs(z[0]) ** p[2]
        ) / p[1]
        g = -p[0] * p[1] * z[0]
    elif code == 7:
        g = -p[0] * d**3
    elif code == 8:
        g = -p[0] * d**2
    elif code == 9:  # p: gap, stiffness of the spring that is already there
        g = p[1] * (d if abs(d) < p[0] else p[0] * np.sign(d))
    elif code == 10:
        g = -p[1] * max(d - p[0], 0.0) if p[0] > 0 else -p[1] * min(d - p[0], 0.0)
    elif code == 11:
        g = -p[0] * np.sin(d)
    elif code == 12:
        g = p[0]
    elif code == 13:
        g = p[0] * np.sin(p[1] * t + p[2])
    elif code == 14:
        f[a] += p[0] * p[1] ** 2 * np.cos(p[1] * t + p[2])
        f[b] += p[0] * p[1] ** 2 * np.sin(p[1] * t + p[2])
        return
    elif code == 15:
        g = -p[0] * np.cos(p[1] * t + p[2]) * d
    elif code == 16:
        f[a] -= p[0] * v[b]
        f[b] += p[0] * v[a]
        return
    elif code == 17:
        f[a] -= p[0] * q[b]
        f[b] -= p[1] * q[a]
        return
    elif code == 18:
        g = p[1] * (z[0] - q[a]) + p[2] * (z[1] - v[a])
        dz[0] = z[1]
        dz[1] = -g / p[0]
    elif code == 19:
        g = -p[0] * t / p[1] * d
    elif code == 20:
        g = -p[0] * d**5
    elif code == 21:  # a force that wanders: sum of slow sines with golden frequencies
        for i in range(12):
            g += p[0] * np.sin(p[1] * (1.0 + 0.618 * i) * t + 2.4 * i * i) / np.sqrt(6.0)
    elif code == 22:
        g = -p[0] * (1 + np.sin(p[1] * t)) * s
    elif code == 23:
        g = p[0] * d - p[0] * p[1] * np.tanh(d / p[1])
    elif code == 24:  # p: stiffness, half width of the zone without force
        g = -p[0] * np.sign(d) * max(abs(d) - p[1], 0.0)
    elif code == 25:  # p: force at 1 m/s, power
        g = -p[0] * np.sign(s) * abs(s) ** p[1]
    elif code == 26:  # z is how far the damper is pulled out, p: stiffness, relaxation time
        g = -p[0] * (d - z[0])
        dz[0] = (d - z[0]) / p[1]
    f[a] += g
    if b >= 0:
        f[b] -= g


@numba.njit(cache=True)
def _rates(t, u, q, v, z, M, C, K, B, codes, places, params, acc, dz, f):
    f[:] = 0.0
    dz[:] = 0.0
    for i in range(codes.size):
        a, b, own = places[i, 0], places[i, 1], slice(2 * i, 2 * i + 2)
        force_of(codes[i], params[i], t, a, b, q, v, z[own], dz[own], f)
    for i in range(M.size):
        total = f[i]
        for j in range(M.size):
            total -= K[i, j] * q[j] + C[i, j] * v[j]
        for j in range(u.size):
            total += B[i, j] * u[j]
        acc[i] = total / M[i]


@numba.njit(cache=True)
def integrate(M, C, K, B, U, dt, oversample, codes, places, params, q0, v0, held=False):
    """Return displacements, velocities and accelerations at the samples.

    Inputs are linear between samples, or held.
    """
    n, samples = M.size, U.shape[0]
    Q, V, A = np.empty((samples, n)), np.empty((samples, n)), np.empty((samples, n))
    q, v, z = q0.copy(), v0.copy(), np.zeros(2 * codes.size)
    for i in range(codes.size):
        if codes[i] in (2, 26):
            z[2 * i] = q[places[i, 0]] - (q[places[i, 1]] if places[i, 1] >= 0 else 0.0)
    f = np.zeros(n)
    a1, a2, a3, a4 = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    d1, d2, d3, d4 = (np.zeros(z.size), np.zeros(z.size), np.zeros(z.size), np.zeros(z.size))
    h = dt / oversample
    for k in range(samples):
        t = k * dt
        _rates(t, U[k], q, v, z, M, C, K, B, codes, places, params, a1, d1, f)
        Q[k], V[k], A[k] = q, v, a1
        if k + 1 == samples:
            break
        for j in range(oversample):
            x = j / oversample
            u0 = U[k] if held else (1 - x) * U[k] + x * U[k + 1]
            x += 1 / oversample
            u1 = U[k] if held else (1 - x) * U[k] + x * U[k + 1]
            uh = 0.5 * (u0 + u1)
            tj = t + j * h
            _rates(tj, u0, q, v, z, M, C, K, B, codes, places, params, a1, d1, f)
            v2 = v + h / 2 * a1
            _rates(tj + h / 2, uh, q + h / 2 * v, v2, z + h / 2 * d1, M, C, K, B,
                   codes, places, params, a2, d2, f)  # fmt: skip
            v3 = v + h / 2 * a2
            _rates(tj + h / 2, uh, q + h / 2 * v2, v3, z + h / 2 * d2, M, C, K, B,
                   codes, places, params, a3, d3, f)  # fmt: skip
            v4 = v + h * a3
            _rates(tj + h, u1, q + h * v3, v4, z + h * d3, M, C, K, B,
                   codes, places, params, a4, d4, f)  # fmt: skip
            q = q + h / 6 * (v + 2 * v2 + 2 * v3 + v4)
            v = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
            z = z + h / 6 * (d1 + 2 * d2 + 2 * d3 + d4)
    return Q, V, A
