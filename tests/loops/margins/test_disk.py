"""The disk margin in other words."""

import math

import pytest

from robustpolish.linear.norms.hinf import HinfNorm
from robustpolish.loops.disk_margins import DiskMargin, decibel, disk_of


def test_gain_and_phase_of_a_disk():
    disk = DiskMargin(0.5, 1.0, True)
    low, high = disk.gain
    assert (low, high) == (pytest.approx(0.6), pytest.approx(1 / 0.6))
    cosine = (1 + low * high) / (low + high)  # Seiler, Packard and Gahinet, (8)
    assert disk.phase_deg == pytest.approx(math.degrees(math.acos(cosine)))
    assert disk.gain_db == pytest.approx(20 * math.log10(high))


def test_a_half_plane_and_more():
    assert DiskMargin(2.0, 1.0, True).gain == (0.0, math.inf)
    assert DiskMargin(2.0, 1.0, True).phase_deg == pytest.approx(90)
    assert DiskMargin(3.0, 1.0, True).phase_deg > 90
    assert DiskMargin(math.inf, math.nan, True).phase_deg == 180
    assert (decibel(0), decibel(math.inf)) == (-math.inf, math.inf)


def test_the_disk_of_a_norm():
    found = disk_of(HinfNorm(4.0, 2 * math.pi, 4.0, 4.0, True, ""))
    assert (found.alpha, found.frequency_hz, found.proven) == (0.5, 1.0, True)
    assert disk_of(HinfNorm(0.0, 0.0, 0.0, 0.0, True, "")).alpha == math.inf
    assert not disk_of(HinfNorm(4.0, 1.0, 4.0, math.inf, True, "")).proven
