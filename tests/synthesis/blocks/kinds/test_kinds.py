"""Every kind of block: its matrices give its formula, and its adjoint the derivatives."""

import math

import numpy as np
import pytest

import robustpolish as rp

S = 0.4 + 1.7j
W = 2 * math.pi


def pid(kp=0.0, ki=0.0, kd=0.0, tf=1.0):
    return kp + ki / S + kd * S / (tf * S + 1)


def notch(f, depth, width):
    w = W * f
    return (S**2 + depth * width * w * S + w**2) / (S**2 + width * w * S + w**2)


def low_pass(f, damping=None):
    w = W * f
    return w / (S + w) if damping is None else w**2 / (S**2 + 2 * damping * w * S + w**2)


CASES = {
    "PID": (rp.tunable.pid("x"), [2.0, -3.0, 0.7, 0.2], pid(2.0, -3.0, 0.7, 0.2)),
    "PI": (rp.tunable.pid("x", kind="pi"), [2.0, -3.0], pid(2.0, -3.0)),
    "PD": (rp.tunable.pid("x", kind="PD"), [2.0, 0.7, 0.2], pid(2.0, 0.0, 0.7, 0.2)),
    "P": (rp.tunable.pid("x", kind="P"), [2.0], 2.0),
    "I": (rp.tunable.pid("x", kind="I"), [2.0], 2.0 / S),
    "D": (rp.tunable.pid("x", kind="D"), [0.7, 0.2], pid(kd=0.7, tf=0.2)),
    "ID": (rp.tunable.pid("x", kind="ID"), [-3.0, 0.7, 0.2], pid(0.0, -3.0, 0.7, 0.2)),
    "lead": (
        rp.tunable.lead_lag("x"),
        [1.5, 0.3, 0.9],
        1.5 * (1 + S / (W * 0.3)) / (1 + S / (W * 0.9)),
    ),
    "notch": (rp.tunable.notch("x"), [0.4, 0.1, 0.6], notch(0.4, 0.1, 0.6)),
    "first": (rp.tunable.low_pass("x", order=1), [0.4], low_pass(0.4)),
    "second": (rp.tunable.low_pass("x"), [0.4, 0.6], low_pass(0.4, 0.6)),
    "gain": (rp.tunable.static_gain("x", "u"), [1.5], 1.5),
    "order 1": (
        rp.tunable.fixed_order("x", "u", order=1),
        [-2.0, 1.1, 0.7, 0.3],
        0.77 / (S + 2.0) + 0.3,
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_matrices_give_the_formula(name):
    block, values, expected = CASES[name]
    stage = block.stages[0].sized(1, 1)
    M, n = stage.matrix(np.array(values)), len(stage.states)
    found = M[n:, :n] @ np.linalg.solve(S * np.eye(n) - M[:n, :n], M[:n, n:]) + M[n:, n:]
    assert found.item() == pytest.approx(expected, rel=1e-12)
    assert len(stage.slots) == len(values)


@pytest.mark.parametrize("name", CASES)
def test_adjoints_are_the_derivatives(name):
    block, values, _ = CASES[name]
    stage, values = block.stages[0].sized(1, 1), np.array(values)
    gradient = np.random.default_rng(0).normal(size=stage.matrix(values).shape)
    step = 1e-6
    slopes = [
        np.sum(gradient * (stage.matrix(values + step * e) - stage.matrix(values - step * e)))
        / (2 * step)
        for e in np.eye(len(values))
    ]
    assert stage.back(values, gradient) == pytest.approx(np.array(slopes), rel=1e-7, abs=1e-8)
