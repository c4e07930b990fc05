"""Loops around -1, in the plane and in Nichols's."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr

from robustpolish.plots.frequency import plot_nichols, plot_nyquist_disks

OMEGA = np.geomspace(0.01, 100, 400)
VALUES = 1 / (1j * OMEGA * (1j * OMEGA + 1))
LOOP = {"u": xr.DataArray(VALUES, {"frequency": OMEGA}, "frequency")}


def test_the_disk_lies_around_the_critical_point():
    ax = plot_nyquist_disks(LOOP, {"u": 0.5})
    corners = ax.patches[0].get_xy()
    real = corners[:, 0]
    assert (real.min(), real.max()) == (pytest.approx(-1 / 0.6), pytest.approx(-0.6))
    assert ax.get_aspect() == 1.0
    assert ax.get_xlim()[0] < -1.5  # the critical point is seen, the integrator's end is not
    assert ax.get_ylim()[0] > -10
    plt.close(ax.figure)


def test_disks_of_other_loops_and_half_planes_are_left_out():
    for disks in (None, {"v": 0.5}, {"u": 2.0}):
        ax = plot_nyquist_disks(LOOP, disks)
        assert len(ax.patches) == 0
        plt.close(ax.figure)


def test_nichols_shows_gain_over_phase():
    ax = plot_nichols(LOOP, {"u": 0.5})
    phase, gain = ax.lines[0].get_xdata(), ax.lines[0].get_ydata()
    np.testing.assert_allclose(gain, 20 * np.log10(np.abs(VALUES)))
    np.testing.assert_allclose(phase, -90 - np.degrees(np.arctan(OMEGA)))
    corners = ax.patches[0].get_xy()
    assert corners[:, 1].max() == pytest.approx(20 * np.log10(1 / 0.6))
    np.testing.assert_allclose(ax.lines[1].get_xdata(), [-180])
    plt.close(ax.figure)
