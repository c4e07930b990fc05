"""The compiled kernel against the stages of ETDRK4 written out (Cox and Matthews 2002)."""

import numpy as np

from robustpolish.machines.effects.evaluate import compiled_law
from robustpolish.machines.effects.kind import EffectKind, Parameter
from robustpolish.machines.simulation import linear_interpolation
from robustpolish.machines.stepper import (
    kernel_matrices,
    run_steps,
    step_matrices,
)

RNG = np.random.default_rng(3)
N, SIGNALS, PORTS, STEP = 3, 2, 2, 0.02
A = RNG.standard_normal((N, N)) - 5 * np.eye(N)
B, G = RNG.standard_normal((N, SIGNALS)), 0.3 * RNG.standard_normal((N, PORTS))
C, D = RNG.standard_normal((2, N)), RNG.standard_normal((2, SIGNALS))
H = RNG.standard_normal((2, PORTS))
MOTION = tuple(RNG.standard_normal((PORTS, width)) for width in (N, SIGNALS, N, SIGNALS))
W = RNG.standard_normal((30, SIGNALS))
LINES = linear_interpolation(W)
START, MEMORY = RNG.standard_normal(N), np.array([0.3])
LAYOUT = np.array([[0, 1, 0, 1, 0, 2, 0], [1, 1, 1, 0, 2, 1, 0]])
P = np.array([0.7, 2.0, 0.4])


def _lag(t, q, v, z, p, f, dz):
    f[0] = -p[0] * z[0] + 0.1 * t
    dz[0] = p[1] * (v[0] - z[0] * q[0])


def _cube(t, q, v, z, p, f, dz):
    f[0] = -p[0] * np.sin(q[0]) ** 3


KINDS = [EffectKind("lag", "Lag", "pair", (Parameter("a", "F", "one"),), _lag),
         EffectKind("cube", "Cube", "pair", (Parameter("a", "F", "one"),), _cube)]  # fmt: skip
LAWS = [compiled_law(kind) for kind in KINDS]
ADDRESSES = np.array([law.address for law in LAWS])


def forces(t, s, w, z):
    Qs, Qw, Vs, Vw = MOTION
    q, v = Qs @ s + Qw @ w, Vs @ s + Vw @ w
    f, g, dz = np.zeros(1), np.zeros(1), np.zeros(1)
    _lag(t, q, v, z, P, f, dz)
    _cube(t, q[1:], v[1:], z, P[2:], g, dz)
    return np.concatenate([f, g]), dz


def written_out(substeps, gain=None, measured=None):
    h = STEP / substeps
    m = step_matrices(A, B, G, h)
    s, z, outputs, states = START.copy(), MEMORY.copy(), [], []
    for k in range(len(W)):
        t = k * STEP
        y = C @ s + D @ W[k] + H @ forces(t, s, W[k], z)[0]
        outputs.append(y)
        states.append(s)
        if gain is not None:
            s = s + gain @ (measured[k] - y)
        for j in range(substeps if k + 1 < len(W) else 0):
            w0, w1 = (W[k] + x / substeps * (W[k + 1] - W[k]) for x in (j, j + 1))
            wh, at = (w0 + w1) / 2, t + j * h
            base = m.half @ s + m.half_now @ w0 + m.half_later @ wh
            f0, d0 = forces(at, s, w0, z)
            a = base + m.half_force @ f0
            fa, da = forces(at + h / 2, a, wh, z + h / 2 * d0)
            fb, db = forces(at + h / 2, base + m.half_force @ fa, wh, z + h / 2 * da)
            c = m.half @ a + m.half_now @ wh + m.half_later @ w1 + m.half_force @ (2 * fb - f0)
            fc, dc = forces(at + h, c, w1, z + h * db)
            s = m.full @ s + m.full_now @ w0 + m.full_later @ w1
            s = s + m.first @ f0 + m.middle @ (fa + fb) + m.last @ fc
            z = z + h / 6 * (d0 + 2 * da + 2 * db + dc)
    return np.array(outputs), np.array(states)


def kernel(substeps, gain=None, measured=None):
    matrices = kernel_matrices(step_matrices(A, B, G, STEP / substeps), MOTION)
    K = np.zeros((N, 2)) if gain is None else gain
    Y = np.zeros((1, 2)) if measured is None else measured
    return run_steps(
        matrices, (C, D, H), ADDRESSES, LAYOUT, P, *LINES, Y, K, START, MEMORY, 0.0, STEP, substeps,
        True,
    )  # fmt: skip


def test_a_free_run_is_the_stages_written_out():
    for substeps in (1, 3):
        y, s, z = kernel(substeps)
        wanted, states = written_out(substeps)
        np.testing.assert_allclose(y, wanted, rtol=1e-10, atol=1e-10)
        np.testing.assert_allclose(s, states, rtol=1e-10, atol=1e-10)
        assert z.shape == (30, 1)


def test_what_leads_the_run_moves_the_state_after_every_sample():
    gain, measured = RNG.standard_normal((N, 2)) * 0.03, RNG.standard_normal((30, 2))
    y, s, _ = kernel(2, gain, measured)
    wanted, states = written_out(2, gain, measured)
    np.testing.assert_allclose(y, wanted, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(s, states, rtol=1e-10, atol=1e-10)


def test_a_run_that_diverges_ends_in_nothing():
    matrices = kernel_matrices(step_matrices(A + 60 * np.eye(N), B, G, 1.0), MOTION)
    y, *_ = run_steps(
        matrices, (C, D, H), ADDRESSES, LAYOUT, P, *LINES, np.zeros((1, 2)), np.zeros((N, 2)),
        START, MEMORY, 0.0, 1.0, 1, False,
    )  # fmt: skip
    assert np.isfinite(y[0]).all()
    assert np.isnan(y[-1]).all()
