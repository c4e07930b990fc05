"""A plant at its samples agrees with the sampled loop that is certified."""

import control
import numpy as np
import pytest

import robustpolish as rp


@pytest.mark.parametrize("delay", [0.0, 0.04, 0.1, 0.25])
def test_poles_are_those_of_the_certificate(delay):
    plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    sampled = rp.implementation.plant_at_samples(plant, 0.1, delay)
    loop = control.feedback(sampled, control.ss([], [], [], [[-2.0]], 0.1), sign=1)
    found = np.abs(np.linalg.eigvals(loop.A)).max()
    certificate = rp.implementation.certify_sampled(plant, [[-2.0]], 0.1, delay)
    assert found == pytest.approx(certificate.spectral_radius, rel=1e-9)
