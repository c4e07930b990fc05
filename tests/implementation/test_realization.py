"""Forms of a controller, single precision, limits, anti-windup, and fewer states."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.implementation.realization import (
    FORMS,
    anti_windup,
    control_limits,
    controller_outputs,
    realized,
    roundoff_bound,
)
from tests.implementation.designs import sampled_servo, two_by_two
from tests.reference.examples import servo_design


def responses(K):
    turns = np.exp(1j * np.array([1e-3, 0.1, 1.0, 3.0]))
    return np.array([K.C @ np.linalg.solve(z * np.eye(K.nstates) - K.A, K.B) + K.D for z in turns])


@pytest.mark.parametrize("form", FORMS)
def test_the_transfer_is_kept(form):
    rng = np.random.default_rng(3)
    for n in (1, 2, 5, 9):
        A = rng.normal(size=(n, n))
        A *= 0.99 / np.abs(np.linalg.eigvals(A)).max()
        scale = 10.0 ** rng.integers(-6, 6, n)
        A, B = A * scale / scale[:, None], rng.normal(size=(n, 2)) / scale[:, None]
        K = control.ss(A, B, rng.normal(size=(2, n)) * scale, rng.normal(size=(2, 2)), 0.1)
        found = realized(K, form)
        np.testing.assert_allclose(responses(found), responses(K), rtol=1e-7, atol=1e-9)
        assert max(np.abs(found.A).max(), np.abs(found.B).max(), np.abs(found.C).max()) < 1e3


@pytest.mark.parametrize("form", FORMS)
def test_multiple_poles_and_unstable_ones_do_no_harm(form):
    jordan = np.array([[1.0, 1.0, 0.0], [0, 1.0, 1.0], [0, 0, 0.3]])
    K = control.ss(jordan, [[0], [1.0], [1]], [[1.0, 0, 1]], [[0.0]], 1.0)
    np.testing.assert_allclose(responses(realized(K, form)), responses(K), rtol=1e-8)


def test_modes_are_blocks_of_one_or_two():
    K = realized(sampled_servo().controller, "modal")
    for i in range(K.nstates):
        assert np.count_nonzero(K.A[i]) <= 2


def test_single_precision_is_stated_and_sections_lose_less():
    sampled = servo_design().discretize(0.001)
    losses = {}
    for form in FORMS:
        found = sampled.realization(form)
        loss = found.details["single_precision"]
        assert loss.certificate.valid
        assert "single precision" in found.message
        assert abs(loss.norm_change) < 1e-2
        losses[form] = loss.pole_shift
    assert max(losses.values()) < 1e-4
    with pytest.raises(rp.InvalidInputError, match="form"):
        sampled.realization("companion")


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


def test_a_controller_that_grows_has_no_bound():
    K = control.ss([[1.5]], [[1.0]], [[1.0]], 0, 1.0)
    assert roundoff_bound(K).outputs[0] == np.inf


def test_limits_in_every_form():
    names = ("F", "M")
    for given in (2.0, (-2, 2), [2.0, (-2.0, 2.0)], {"F": 2.0, "M": (-2, 2)}):
        low, high = control_limits(given, names)
        np.testing.assert_array_equal(low, [-2, -2])
        np.testing.assert_array_equal(high, [2, 2])
    low, high = control_limits({"M": 1.0}, names)
    assert low[0] == -np.inf
    assert high.tolist() == [np.inf, 1.0]
    assert control_limits(None, names) is None


@pytest.mark.parametrize("bad", [0.0, -1.0, "x", (2, 1), [1.0], {"G": 1}, (1, 2, 3), np.nan])
def test_wrong_limits_are_refused(bad):
    with pytest.raises(rp.InvalidInputError, match="limits"):
        control_limits(bad, ("F", "M"))


def test_a_conditioned_pi_controller_forgets_at_once():
    # u = 2 e + sum of 0.1 e: conditioned, the state is what makes u just reach the limit.
    K = control.ss([[1.0]], [[0.1]], [[1.0]], [[2.0]], 0.1)
    found = anti_windup(K)
    assert found.form == "conditioned"
    assert found.L[0, 0] == pytest.approx(0.05)


def test_a_strictly_proper_controller_gets_an_observer():
    K = control.ss([[1.0, 0.1], [0, 0.5]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]], 0.1)
    found = anti_windup(K)
    assert found.form == "observer"
    assert np.abs(np.linalg.eigvals(K.A - found.L @ K.C)).max() < 0.99
    with pytest.raises(rp.InvalidInputError, match="conditioned"):
        anti_windup(K, "conditioned")
    assert not anti_windup(K, "none").L.any()
    with pytest.raises(rp.InvalidInputError, match="anti_windup"):
        anti_windup(K, "hanus?")


def test_it_is_the_response_of_the_system():
    for sampled in (sampled_servo(), two_by_two()):
        K = sampled.controller
        y = np.random.default_rng(0).normal(size=(500, K.ninputs))
        expected = control.forced_response(K, inputs=y.T).outputs.reshape(K.noutputs, -1).T
        found = controller_outputs(K, y)
        np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-10)
