"""Random uncertain loops, and what is judged of their margins."""

from dataclasses import replace

import control
import numpy as np
from scipy.linalg import block_diag

import robustpolish as rp
from robustpolish.plants.uncertain.lft import (
    ComplexElement,
    DynamicElement,
    Lft,
    RealElement,
    UncertainBlock,
)


def random_loop(seed):
    """A stable loop of up to twelve states around one to three blocks of any kind."""
    random = np.random.default_rng(seed)
    n, blocks = int(random.integers(1, 13)), []
    for i in range(int(random.integers(1, 4))):
        kind = random.choice(["real", "complex", "dynamic", "full"])
        copies = int(random.integers(1, 4))
        if kind == "real":
            blocks.append(UncertainBlock(RealElement(f"real_{i}", 0.0, -1.0, 1.0), copies))
        elif kind == "complex":
            blocks.append(UncertainBlock(ComplexElement(f"complex_{i}", 0.0, 1.0), copies))
        elif kind == "dynamic":
            blocks.append(UncertainBlock(DynamicElement(f"dynamic_{i}"), copies))
        else:
            shape = int(random.integers(1, 4)), int(random.integers(1, 4))
            blocks.append(UncertainBlock(DynamicElement(f"full_{i}", shape), 1))
    nw, nz = sum(b.rows for b in blocks), sum(b.columns for b in blocks)
    A = random.standard_normal((n, n))
    A -= (max(np.linalg.eigvals(A).real.max(), 0) + random.uniform(0.05, 1)) * np.eye(n)
    D = 0.1 * random.standard_normal((nz, nw)) * (random.uniform() < 0.5)
    F = np.block([[A, random.standard_normal((n, nw))], [random.standard_normal((nz, n)), D]])
    G, H = np.vstack([np.ones((n, 1)), np.zeros((nz, 1))]), np.ones((1, n + nw))
    states = tuple(f"x{i}" for i in range(n))
    return rp.uncertain.UncertainSystem(Lft(F, G, H, np.zeros((1, 1)), states, tuple(blocks), 0))


def singular(loop, margin):
    """How singular the loop is with its witness at the critical frequency, and its size."""
    omega, deltas, sizes = margin.critical_frequency, [], []
    for block in loop.blocks:
        value = margin.witness[block.element.name]
        if isinstance(value, control.StateSpace):
            assert not value.nstates or value.poles().real.max() < 0
            assert rp.hinf_norm(value).value <= margin.upper * (1 + 1e-9)
            delta = value.D if np.isinf(omega) else np.atleast_2d(value(1j * omega))
        elif block.element.kind == "real":
            delta = np.array([[block.element.delta(value)]])
        else:
            delta = np.array([[(value - block.element.nominal) / block.element.radius]])
        deltas.append(np.kron(np.eye(block.copies), delta))
        sizes.append(np.linalg.norm(delta, 2))
    one, n = loop.matrices, loop.nstates
    M = one.F[n:, n:].astype(complex)
    if np.isfinite(omega):
        M = M + one.F[n:, :n] @ np.linalg.solve(
            1j * omega * np.eye(n) - one.F[:n, :n], one.F[:n, n:]
        )
    loop_gain = M @ block_diag(*deltas)
    left = np.linalg.svd(np.eye(len(M)) - loop_gain, compute_uv=False)[-1]
    return left / max(1.0, np.linalg.norm(loop_gain, 2)), max(sizes)


def covers(intervals):
    """Whether intervals leave no frequency out."""
    ends = [0.0]
    for low, high in sorted(intervals):
        if low > ends[-1]:
            return False
        ends.append(max(ends[-1], high))
    return bool(np.isinf(ends[-1]))


def in_other_units(loop, seed):
    """The loop with states, the signals around each block and time in units 10^+-3 as large.

    Also how many of the new units of time one second is.
    """
    random = np.random.default_rng(1000 + seed)
    one, n = loop.matrices, loop.nstates
    states, time = 10.0 ** random.choice([-3, 3], n), 10.0 ** random.choice([-3, 3])
    units = 10.0 ** random.choice([-3, 3], len(loop.blocks))
    rows = np.repeat(units, [block.columns for block in loop.blocks])
    columns = np.repeat(units, [block.rows for block in loop.blocks])
    rows, columns = np.concatenate([states, rows]), np.concatenate([states, columns])
    F, G, H = one.F * rows[:, None] / columns, one.G * rows[:, None], one.H / columns
    F[:n], G[:n] = F[:n] / time, G[:n] / time
    return rp.uncertain.UncertainSystem(replace(one, F=F, G=G, H=H)), time
