import numpy as np
import pytest
from uncertain_plants import two_masses

from robustpolish.synthesis.problem.matrices import Controller, close_static_loop
from robustpolish.synthesis.uncertain.scaled_gain import LoopResponses, RobustProblem

OMEGA = np.array([0.0, 0.3, 1.4, 20.0, np.inf])


@pytest.fixture
def loop():
    random = np.random.default_rng(0)
    problem = RobustProblem.of(two_masses(), 1, 1, 1.0)
    K = Controller(
        -np.eye(2) + 0.1 * random.standard_normal((2, 2)),
        random.standard_normal((2, 1)),
        random.standard_normal((1, 2)),
        np.array([[0.3]]),
    )
    return problem.loop(K)


def test_responses_are_those_of_the_loop(loop):
    M = LoopResponses.of(loop, OMEGA).M
    for omega, one in zip(OMEGA[:-1], M, strict=False):
        inner = np.linalg.solve(1j * omega * np.eye(len(loop.A)) - loop.A, loop.B)
        assert one == pytest.approx(loop.D + loop.C @ inner, rel=1e-10)
    assert M[-1] == pytest.approx(loop.D)


def test_gradients_over_k_are_those_of_differences(loop):
    random = np.random.default_rng(1)
    responses = LoopResponses.of(loop, OMEGA)
    shape = responses.M.swapaxes(1, 2).shape
    weights = random.standard_normal(shape) + 1j * random.standard_normal(shape)
    gradient = responses.back(weights)

    def value(K):
        M = LoopResponses.of(close_static_loop(loop.plant, K), OMEGA).M
        return np.einsum("kwz,kzw->", weights, M).real

    step, h = random.standard_normal(loop.K.shape), 1e-6
    slope = (value(loop.K + h * step) - value(loop.K - h * step)) / (2 * h)
    assert slope == pytest.approx((gradient * step).sum(), rel=1e-5)
