"""Filters before the samplers."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.implementation.sampled.certificate import filter_system, with_filter
from tests.implementation.designs import servo


@pytest.mark.parametrize("order", range(1, 9))
def test_butterworth_filters_have_their_corner(order):
    found = filter_system((order, 50.0), 1)
    corner = abs(np.squeeze(found(2j * np.pi * 50.0)))
    assert found.nstates == order
    assert corner == pytest.approx(np.sqrt(0.5), rel=1e-9)
    assert abs(np.squeeze(found(0))) == pytest.approx(1.0)
    assert abs(np.squeeze(found(2j * np.pi * 5e4))) == pytest.approx(1e-3**order, rel=1e-3)


def test_every_measurement_passes_it():
    found = filter_system(control.tf([1.0], [0.1, 1.0]), 3)
    assert (found.ninputs, found.nstates) == (3, 3)
    np.testing.assert_allclose(found(0), np.eye(3))
    assert filter_system(None, 3) is None


def test_the_filtered_plant_is_plant_and_filter():
    plant = servo()
    found = with_filter(plant, filter_system(2.0, 1))
    assert found.nx == plant.nx + 2
    assert not found.D21.any()
    s = 3j
    lag = filter_system(2.0, 1)(s)
    whole, before = found.system(s), plant.system(s)
    np.testing.assert_allclose(whole[:2], before[:2], atol=1e-15)
    np.testing.assert_allclose(whole[2], np.squeeze(lag) * before[2], atol=1e-15)
    assert found.units == plant.units


@pytest.mark.parametrize(
    "bad",
    [
        -1.0, 0.0, "fast", True, (2, -1.0), (0, 10.0), (2.5, 10.0), (1, 2, 3), np.nan,
        control.ss([[1.0]], [[1.0]], [[1.0]], 0), control.ss([[0.5]], [[1]], [[1]], 0, 0.1),
        control.ss(-np.eye(2), np.eye(2), np.eye(2), 0),
    ],
)  # fmt: skip
def test_what_is_no_filter_is_refused(bad):
    with pytest.raises(rp.InvalidInputError, match="anti_aliasing"):
        filter_system(bad, 3)
