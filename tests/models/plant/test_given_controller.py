"""A controller may be a system, a transfer function or a gain."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from robustpolish.plants.controllers import controller_system


@pytest.fixture
def plant():
    return rp.GeneralizedPlant.from_matrices([[-1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])


def test_a_system_is_taken_as_it_is_and_a_gain_gets_names(plant):
    K = control.ss([[-2.0]], [[1.0]], [[1.0]], 0)
    assert controller_system(plant, K) is K
    gain = controller_system(plant, [[-3.0]])
    assert (gain.nstates, gain.input_labels, gain.output_labels) == (0, ["y1"], ["u1"])


def test_a_transfer_function_closes_the_loop_as_its_realisation_does(plant):
    K = control.tf([-3.0], [1.0, 2.0])
    loop = plant.closed_loop(K)
    assert (loop.input_labels, loop.output_labels) == (["w1"], ["z1"])
    np.testing.assert_allclose(sorted(loop.poles().imag), [-np.sqrt(2.75), np.sqrt(2.75)])
    delayed = plant.with_delay("u1", 0.01).delayed_loop(K)
    assert bool(rp.linear.delay_stability(delayed))


def test_what_does_not_fit_is_named(plant):
    with pytest.raises(InvalidInputError, match="a TransferFunction with 1 outputs and 2 inputs"):
        plant.closed_loop(control.tf([[[1.0], [1.0]]], [[[1.0, 1.0], [1.0, 2.0]]]))
    measured = control.frd([1.0, 2.0], [1.0, 2.0])
    with pytest.raises(InvalidInputError, match="Fit or linearise it first"):
        plant.closed_loop(measured)
