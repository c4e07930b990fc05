"""The controller in doubles, against python-control."""

import control
import numpy as np

from robustpolish.implementation.realization import controller_outputs
from tests.implementation.designs import sampled_servo, two_by_two


def test_it_is_the_response_of_the_system():
    for sampled in (sampled_servo(), two_by_two()):
        K = sampled.controller
        y = np.random.default_rng(0).normal(size=(500, K.ninputs))
        expected = control.forced_response(K, inputs=y.T).outputs.reshape(K.noutputs, -1).T
        found = controller_outputs(K, y)
        np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-10)
