"""The wanted gain of a loop: its crossovers, its band, and distances from it."""

import control
import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.synthesis.loop_shaping.coprime import consistent_matrices
from robustpolish.synthesis.loop_shaping.loop_shaping import TargetLoop, gains

s = control.tf("s")


def wanted(system, dt=0, band_hz=None):
    return TargetLoop.checked(consistent_matrices(control.ss(system)), dt, band_hz)


def test_crossovers_and_band_follow_from_the_target():
    found = wanted(10 / s)
    assert found.crossovers == pytest.approx((10, 10))
    assert found.band == pytest.approx((0.1, 100))
    two = wanted(control.ss(np.zeros((2, 2)), np.diag([1.0, 20.0]), np.eye(2), 0))
    assert two.crossovers == pytest.approx((1, 20))
    assert two.band == pytest.approx((0.01, 200))
    assert wanted(10 / s, band_hz=(1, 2)).band == pytest.approx((2 * np.pi, 4 * np.pi))


def test_the_band_of_a_discrete_target_ends_at_half_the_sample_rate():
    found = wanted(control.c2d(control.ss(10 / s), 0.1), 0.1)
    assert found.crossovers[0] == pytest.approx(10, rel=0.1)
    assert found.band[1] == pytest.approx(np.pi / 0.1, rel=1e-5)


def test_distance_counts_both_ways_and_shortfall_only_what_harms():
    target = wanted(10 / s)
    more = consistent_matrices(control.ss(20 / s))
    assert target.distance_of(more)[0] == pytest.approx(2)
    # Twice the gain helps below 10 rad/s and harms above.
    factor, where = target.shortfall_of(more)
    assert factor == pytest.approx(2)
    assert where > 10
    assert target.shortfall_of(consistent_matrices(control.ss(5 / s)))[1] < 10
    lagged = consistent_matrices(control.ss(10 / s / (0.01 * s + 1)))
    assert target.distance_of(lagged)[0] == pytest.approx(np.sqrt(2), rel=1e-6)
    assert target.shortfall_of(lagged)[0] < 1.006


def test_gains_are_infinite_at_a_pole():
    sizes = gains(consistent_matrices(control.ss(1 / s)), np.array([0.0, 2.0]), 0)
    assert sizes.ravel().tolist() == [np.inf, 0.5]


@pytest.mark.parametrize(
    ("target", "words"),
    [
        (10 / (s - 1), "unstable system.*mirror the pole"),
        (1 / (s + 2), "never falls from above 1"),
        (control.tf([5], [1]), "never falls from above 1"),
    ],
)
def test_targets_that_no_loop_can_have(target, words):
    with pytest.raises(InvalidInputError, match=f"(?s)target: got .*{words}"):
        wanted(target)


@pytest.mark.parametrize("band", [(2, 1), (0, 1), 5, (1, np.inf), "ab", (1, 2, 3)])
def test_bands_that_are_none(band):
    with pytest.raises(InvalidInputError, match=r"band_hz: got .*\(low, high\)"):
        wanted(10 / s, band_hz=band)
