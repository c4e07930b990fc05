"""Complex responses drawn over frequency and in the plane."""

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

from robustpolish.plots.frequency import plot_bode, plot_nyquist

LINES = np.linspace(1.0, 10.0, 50)
RESPONSE = xr.DataArray(1 / (25.0 - LINES**2 + 0.5j * LINES), {"frequency": LINES}, "frequency")


def test_magnitude_stands_above_phase():
    spread = xr.full_like(RESPONSE.real, 1e-3)
    ax = plot_bode({"measured": RESPONSE}, name="magnitude", unit="m/N", spread=spread)
    upper, lower = ax.figure.axes
    assert upper is ax
    assert (upper.get_xscale(), upper.get_yscale()) == ("log", "log")
    assert lower.get_ylabel() == "phase [deg]"
    np.testing.assert_allclose(upper.lines[0].get_ydata(), np.abs(RESPONSE))
    phase = lower.lines[0].get_ydata()
    assert -180 <= np.nanmin(phase) < -170
    assert len(upper.lines) == 2
    plt.close(ax.figure)


def test_jumps_of_a_turn_are_gaps():
    turning = xr.DataArray(np.exp(-1j * LINES), {"frequency": LINES}, "frequency")
    ax = plot_bode({"x": turning})
    assert np.isnan(ax.figure.axes[1].lines[0].get_ydata()).sum() == 2  # at pi and 3 pi
    plt.close(ax.figure)


def test_the_plane_keeps_circles_round():
    ax = plot_nyquist({"measured": RESPONSE, "model": RESPONSE}, name="x/F", unit="m/N")
    assert ax.get_aspect() == 1.0
    assert ax.get_xlabel() == "real part of x/F [mm/N]"
    assert len(ax.get_legend().get_texts()) == 2
    plt.close(ax.figure)
