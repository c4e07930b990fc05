"""The public way to a sampled certificate: its arguments."""

import control
import numpy as np
import pytest

import robustpolish as rp
from tests.implementation.designs import sampled_servo, servo


def test_it_agrees_with_the_design():
    sampled = sampled_servo()
    found = rp.implementation.certify_sampled(servo(), sampled.controller, delay=0.02)
    assert found.bound == sampled.certificate.bound
    assert found.upper == found.bound
    assert found.spectral_radius < 1
    assert found.plot().get_xlabel() == "real part"


def test_arguments_that_do_not_fit_are_refused():
    plant, K = servo(), sampled_servo().controller
    with pytest.raises(rp.InvalidInputError, match="period"):
        rp.implementation.certify_sampled(plant, [[-1.0]])
    with pytest.raises(rp.InvalidInputError, match="period"):
        rp.implementation.certify_sampled(plant, K, period=0.1)
    with pytest.raises(rp.InvalidInputError, match="discrete one"):
        rp.implementation.certify_sampled(
            plant, control.ss([[-1.0]], [[1.0]], [[1.0]], 0), period=0.1
        )
    with pytest.raises(rp.InvalidInputError, match="inputs"):
        rp.implementation.certify_sampled(plant, control.ss([[0.5]], [[1.0, 1]], [[1.0]], 0, 0.1))
    with pytest.raises(rp.InvalidInputError, match="norm"):
        rp.implementation.certify_sampled(plant, K, norm="h3")
    with pytest.raises(rp.InvalidInputError, match="GeneralizedPlant"):
        rp.implementation.certify_sampled(plant.system, K)
    direct = rp.GeneralizedPlant.from_matrices(
        [[-1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]], D11=[[1.0]]
    )
    with pytest.raises(rp.InvalidInputError, match="D11"):
        rp.implementation.certify_sampled(direct, [[0.0]], period=0.1, norm="h2")
    assert rp.implementation.certify_sampled(direct, [[0.0]], period=0.1).bound == pytest.approx(
        2.0, rel=1e-4
    )
    assert np.isfinite(rp.implementation.certify_sampled(plant, K).bound)
