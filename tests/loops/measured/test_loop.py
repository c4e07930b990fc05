"""Nyquist's count on lines against the poles of the loop."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.loops.measured import MeasuredLoop


def lines_of(system, lines):
    response = control.frd(system, lines)
    return rp.GeneralizedPlant(response, system.noutputs, system.ninputs)


def test_the_count_is_right_on_random_loops():
    rng = np.random.default_rng(0)
    verdicts = []
    for _ in range(40):
        n = int(rng.integers(2, 6))
        A, B, C = (rng.standard_normal(shape) for shape in ((n, n), (n, 2), (2, n)))
        K = rng.standard_normal((2, 2)) * 10 ** rng.uniform(-1, 1)
        plant = lines_of(control.ss(A, B, C, 0), np.logspace(-3, 4, 3000))
        unstable = int((np.linalg.eigvals(A).real > 0).sum())
        found = MeasuredLoop.of(plant, K, unstable).stability
        truth = int((np.linalg.eigvals(A + B @ K @ C).real > 0).sum())
        assert f"{truth} of the closed one" in found.reason
        assert bool(found) == (truth == 0)
        verdicts.append(bool(found))
    assert 2 <= sum(verdicts) <= 38


@pytest.mark.parametrize("gain", [-0.1, -30.0])
def test_a_discrete_controller_is_taken_up_to_half_its_rate(gain):
    dt = 0.05
    model = control.c2d(control.ss([[0, 1], [0, -1]], [[0], [1]], [[1, 0]], 0), dt)
    omega = np.logspace(-2, 2, 2000)
    values = np.array([model(np.exp(1j * w * dt)) for w in omega])
    response = control.FrequencyResponseData(values[None, None], omega)
    K = control.ss([[1.0]], [[0.001]], [[gain]], [[gain]], dt)
    found = MeasuredLoop.of(rp.GeneralizedPlant(response, 1, 1), K, 0)
    assert found.omega.max() < np.pi / dt
    truth = rp.loop_analysis(model, K).stable
    assert bool(found.stability) == truth


def test_a_count_below_zero_and_jumps_between_lines_are_told():
    plant = lines_of(control.ss([[1.0]], [[1.0]], [[1.0]], 0), np.logspace(-2, 3, 400))
    wrong = MeasuredLoop.of(plant, [[-3.0]], 0).stability
    assert not wrong
    assert "that cannot be" in wrong.reason
    coarse = lines_of(control.ss([[0, 1], [-1, -1e-3]], [[0], [1]], [[1, 0]], 0), [0.5, 2.0, 9.0])
    assert "jumps by" in MeasuredLoop.of(coarse, [[-5.0]], 0).stability.reason


def test_too_few_lines_are_refused():
    plant = lines_of(control.ss([[-1.0]], [[1.0]], [[1.0]], 0), [0.0, 1.0])
    with pytest.raises(rp.InvalidInputError, match="two or more"):
        MeasuredLoop.of(plant, [[-1.0]], 0)
