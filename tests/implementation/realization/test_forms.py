"""Other coordinates, the same controller."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.implementation.realization import FORMS, realized
from tests.implementation.designs import sampled_servo, servo_design


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
