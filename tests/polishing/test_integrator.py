"""The pair of Dormand and Prince, against the conditions of its orders."""

import numpy as np
import pytest

from robustpolish.polishing.contact import (
    COUPLING,
    DENSE,
    ERROR,
    NODES,
    STAGES,
    inside_step,
    stage_state,
    step_error,
)

WEIGHTS = np.append(COUPLING[-1], 0.0)


def test_every_stage_stands_at_its_node():
    np.testing.assert_allclose(COUPLING.sum(axis=1), NODES, atol=1e-14)


@pytest.mark.parametrize("power", range(5))
def test_the_solution_is_of_order_five_and_its_companion_of_order_four(power):
    assert WEIGHTS @ NODES**power == pytest.approx(1 / (power + 1), abs=1e-14)
    companion = (WEIGHTS - ERROR) @ NODES**power
    if power < 4:
        assert companion == pytest.approx(1 / (power + 1), abs=1e-14)
    else:
        assert abs(companion - 1 / 5) > 1e-4  # else the error would say nothing


@pytest.mark.parametrize("fraction", [0.0, 0.3, 0.5, 1.0])
def test_values_inside_a_step_are_of_order_four(fraction):
    inside = DENSE @ fraction ** np.arange(1, 5)
    for power in range(4):
        exact = fraction ** (power + 1) / (power + 1)
        assert inside @ NODES**power == pytest.approx(exact, abs=1e-14)
    np.testing.assert_allclose(DENSE.sum(axis=1), WEIGHTS, atol=1e-14)


def one_step(rate, start, step):
    """Fill the slopes of a step from time 0; return them and the state at its end."""
    slopes, state = np.zeros((STAGES, start.size)), start.copy()
    for stage in range(STAGES):
        stage_state(slopes, stage, start, step, state)
        slopes[stage] = rate(NODES[stage] * step, state)
    return slopes, state


def test_a_step_has_an_error_of_the_sixth_power():
    def decay(_, y):
        return -y

    errors = []
    for step in (0.2, 0.1):
        slopes, end = one_step(decay, np.array([1.0, 2.0]), step)
        errors.append(abs(end[0] - np.exp(-step)))
        estimate = step_error(slopes, step, np.array([1.0, np.inf]))
        assert estimate > errors[-1]  # it is that of the order below
        middle = np.zeros(1)
        inside_step(slopes, np.array([1.0, 2.0]), step, 0.5, 1, middle)
        assert middle[0] == pytest.approx(2 * np.exp(-step / 2), rel=1e-5)
    assert 50 < errors[0] / errors[1] < 75  # 2^6 = 64


def test_an_error_that_is_undefined_is_infinite():
    slopes = np.zeros((STAGES, 2))
    assert step_error(slopes, 0.1, np.ones(2)) == 0.0
    slopes[3, 1] = np.nan
    assert step_error(slopes, 0.1, np.ones(2)) == np.inf
