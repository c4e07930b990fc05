import numpy as np
import pytest

from robustpolish.synthesis.problem.matrices import Controller
from robustpolish.synthesis.uncertain.scaled_gain import ModalGain, controller_from_matrix


def _response(K, s):
    return K.D + K.C @ np.linalg.solve(s * np.eye(len(K.A)) - K.A, K.B)


@pytest.mark.parametrize("states", [0, 1, 2, 5, 6])
def test_form_keeps_the_controller(states):
    random = np.random.default_rng(states)
    K = Controller(
        *(random.standard_normal(s) for s in ((states, states), (states, 2), (3, states), (3, 2)))
    )
    form, theta = ModalGain.of(K)
    again = controller_from_matrix(form.gain(theta), form.order)
    for s in (0.3j, 5.0 + 1j):
        assert _response(again, s) == pytest.approx(_response(K, s), rel=1e-9)
    blocks = np.kron(np.eye(3), np.ones((2, 2)))[:states, :states]
    assert not again.A[blocks == 0].any()


def test_double_pole_keeps_the_controller():
    K = Controller(
        np.array([[-1.0, 1], [0, -1]]), np.ones((2, 1)), np.ones((1, 2)), np.zeros((1, 1))
    )
    form, theta = ModalGain.of(K)
    again = controller_from_matrix(form.gain(theta), 2)
    assert _response(again, 0.7j) == pytest.approx(_response(K, 0.7j), rel=1e-7)


def test_adjoint_belongs_to_the_form():
    random = np.random.default_rng(1)
    K = Controller(*(random.standard_normal(s) for s in ((4, 4), (4, 1), (2, 4), (2, 1))))
    form, theta = ModalGain.of(K)
    step, weights = random.standard_normal(form.size), random.standard_normal(form.shape)
    moved = form.gain(theta + step) - form.gain(theta)
    assert (weights * moved).sum() == pytest.approx(form.back(theta, weights) @ step)
