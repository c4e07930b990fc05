"""Bounds of rounding in single precision, against numpy's own."""

import control
import numpy as np
import pytest

from robustpolish.implementation.realization import (
    UNIT,
    controller_outputs,
    realized,
    rounded,
    roundoff_bound,
    single_precision,
)
from tests.implementation.designs import sampled_servo, servo, static_gain


def in_single(K, y):
    A, B, C, D = (np.asarray(M, np.float32) for M in (K.A, K.B, K.C, K.D))
    x, out = np.zeros(len(A), np.float32), []
    for row in y.astype(np.float32):
        out.append(C @ x + D @ row)
        x = A @ x + B @ row
    return np.array(out, float)


@pytest.mark.parametrize("form", ["balanced", "modal", "sections"])
def test_no_run_leaves_the_bound(form):
    K = realized(sampled_servo().controller, form)
    bound = roundoff_bound(K)
    for seed in range(3):
        y = np.sign(np.random.default_rng(seed).normal(size=(5000, 1)))
        expected = controller_outputs(K, y)
        error = np.abs(in_single(K, y) - expected).max()
        assert 0 < error <= bound.outputs[0]
        assert np.abs(expected).max() <= bound.size[0]
    assert bound.per_sample[0] < bound.outputs[0] < 1e-2 * bound.size[0]


def test_a_gain_loses_a_few_units():
    bound = roundoff_bound(static_gain().controller)
    assert bound.outputs[0] < 10 * UNIT * 3


def test_a_controller_that_grows_has_no_bound():
    K = control.ss([[1.5]], [[1.0]], [[1.0]], 0, 1.0)
    assert roundoff_bound(K).outputs[0] == np.inf


def test_the_loss_is_that_of_the_rounded_loop():
    K = sampled_servo().controller
    before = sampled_servo().certificate.achieved
    loss = single_precision(servo(), K, 0.02, "hinf", before)
    assert loss.certificate.valid
    shift = np.abs(np.sort(np.linalg.eigvals(K.A)) - np.sort(np.linalg.eigvals(rounded(K).A))).max()
    assert loss.pole_shift == pytest.approx(shift, rel=1e-6)
    assert abs(loss.norm_change) < 1e-3
    assert "single precision" in loss.sentence
