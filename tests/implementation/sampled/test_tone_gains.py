"""Gains for one frequency at a time."""

import control
import numpy as np

import robustpolish as rp
from robustpolish.implementation.sampled.certificate import sinusoid_gains
from tests.implementation.designs import sampled_servo


def test_without_control_they_are_those_of_the_plant():
    plant = rp.GeneralizedPlant.from_matrices(
        [[0, 1], [-1, -0.1]], [[0], [1]], [[0], [1]], [[1, 0], [0, 1]], [[1, 0]]
    )
    found = sinusoid_gains(plant, control.ss([], [], [], [[0.0]], 0.3), 0.1)
    for hertz, gain in zip(found["frequency"].values, found.values, strict=True):
        true = np.linalg.norm(plant.open_loop(2j * np.pi * hertz), 2)
        np.testing.assert_allclose(gain, true, rtol=1e-8)


def test_no_tone_has_more_than_the_norm():
    sampled = sampled_servo()
    found = sinusoid_gains(sampled.plant, sampled.controller, sampled.delay)
    assert found.max() <= sampled.certificate.bound
    assert found.max() > 0.9 * sampled.certificate.lower
