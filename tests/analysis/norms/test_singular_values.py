"""Singular values of a frequency response."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError


def test_each_is_that_of_the_response():
    rng = np.random.default_rng(0)
    A = rng.standard_normal((4, 4)) * 100 - 300 * np.eye(4)
    system = control.ss(A, rng.standard_normal((4, 2)), rng.standard_normal((3, 4)), 0)
    hertz = np.array([0.0, 7.0, 300.0])
    found = rp.singular_values(system, hertz)
    assert found.dims == ("frequency", "singular_value")
    for f, values in zip(hertz, found.values, strict=True):
        expected = np.linalg.svd(system(2j * np.pi * f), compute_uv=False)
        np.testing.assert_allclose(values, expected, rtol=1e-10)


def test_sampled_systems_count_in_hertz_too():
    system = control.ss(0.5, 1.0, 1.0, 0.0, 0.01)
    found = rp.singular_values(system, [0.0, 50.0])  # the second is half the sampling rate
    np.testing.assert_allclose(found.isel(singular_value=0), [2.0, 1 / 1.5])


def test_the_grid_sees_a_narrow_resonance():
    zeta, w = 1e-6, 300.0
    system = control.ss([[0, 1], [-w * w, -2 * zeta * w]], [[0], [w * w]], [[1, 0]], 0)
    found = rp.singular_values(system)
    assert float(found.max()) == pytest.approx(1 / (2 * zeta), rel=1e-3)
    frequency = found["frequency"].values
    assert frequency[0] <= w / (20 * np.pi) * 1.001
    assert frequency[-1] >= 10 * w / (2 * np.pi) * 0.999


def test_a_pole_on_the_boundary_has_an_infinite_gain():
    assert float(rp.singular_values(control.ss(0.0, 1.0, 1.0, 0.0), [0.0])[0, 0]) == np.inf


@pytest.mark.parametrize("bad", [[-1.0], [np.nan], [[1.0, 2.0]]])
def test_bad_frequencies_are_named(bad):
    with pytest.raises(InvalidInputError, match="frequencies_hz: got"):
        rp.singular_values(control.ss(-1.0, 1.0, 1.0, 0.0), bad)
