import numpy as np
import pytest
import xarray as xr

from robustpolish.identification.residuals.tests import (
    band_shares,
    contact_shares,
    error_spectrum,
    line_shares,
    phase_shares,
    surface,
    value_shares,
    window_shares,
)


def residual(x, step=0.01):
    """An error over time; a second one without any error."""
    x = np.asarray(x, dtype=float)
    columns = {"x": ("time", x), "still": ("time", np.zeros(x.size))}
    return xr.Dataset(columns, {"time": step * np.arange(x.size)})


def test_windows_hold_their_part_of_the_squares():
    found = window_shares(residual([1, 1, 2, 2, 0, 0, 3, 3]), 4)
    np.testing.assert_allclose(found.sel(output="x"), np.array([2, 8, 0, 18]) / 28)
    np.testing.assert_allclose(found["begin"], [0.0, 0.02, 0.04, 0.06])
    np.testing.assert_allclose(found["end"], [0.01, 0.03, 0.05, 0.07])
    assert not found.sel(output="still").any()


def test_bands_and_lines_hold_the_power_of_their_frequencies():
    """Lines of 1 and 3 units of amplitude at 5 and 20 Hz have powers as 1 to 9."""
    time = 0.01 * np.arange(4000)
    error = residual(np.sin(2 * np.pi * 5 * time) + 3 * np.sin(2 * np.pi * 20 * time))
    found = band_shares(error, [0.0, 10.0, 30.0, 50.0]).sel(output="x")
    np.testing.assert_allclose(found, [0.1, 0.9, 0.0], atol=1e-4)
    lines = line_shares(error, [5.0, 12.0, 20.0], "mode")
    np.testing.assert_allclose(lines.sel(output="x"), [0.1, 0.0, 0.9], atol=1e-4)
    np.testing.assert_allclose(lines["frequency"], [5.0, 12.0, 20.0])
    assert line_shares(error, [], "harmonic").shape == (2, 0)


def test_a_mean_is_an_error_of_frequency_zero():
    frequency, power = error_spectrum(residual(np.ones(4000)), "x")
    assert power.sum() == pytest.approx(1.0)
    assert power[frequency < 0.5].sum() == pytest.approx(1.0)
    assert not error_spectrum(residual(np.ones(4000)), "still")[1].any()


def test_bins_hold_what_happens_at_their_values():
    found = value_shares(residual([1.0, 2.0, 3.0, 4.0]), np.array([0.0, 1.0, 9.0, 10.0]), 2, "q")
    np.testing.assert_allclose(found.sel(output="x"), [5 / 30, 25 / 30])
    np.testing.assert_allclose(found["q"], [2.5, 7.5])
    np.testing.assert_allclose(found["samples"], [0.5, 0.5])


def test_the_phase_is_that_of_the_spin():
    """At 2 Hz four samples of an eighth of a second make a turn."""
    found = phase_shares(residual([1.0, -2.0, 0.0, 5.0] * 10, 0.125), 2.0, 4)
    np.testing.assert_allclose(found.sel(output="x"), np.array([1, 4, 0, 25]) / 30)
    np.testing.assert_allclose(found["mean"].sel(output="x"), [1.0, -2.0, 0.0, 5.0])
    np.testing.assert_allclose(found["phase"], np.pi / 4 * np.array([1, 3, 5, 7]))
    np.testing.assert_allclose(found["samples"], 0.25)


def test_contact_and_flight():
    found = contact_shares(residual([1.0, 2.0, 3.0, 4.0]), np.array([True, False, False, True]))
    np.testing.assert_allclose(found.sel(output="x", state="contact"), 17 / 30)
    np.testing.assert_allclose(found.sel(output="x", state="flight"), 13 / 30)
    np.testing.assert_allclose(found["samples"], [0.5, 0.5])


def test_the_surface_is_the_mean_force_where_there_was_any_motion():
    q, v = np.array([0.0, 0.0, 2.0, 2.0]), np.array([-1.0, -1.0, -1.0, 1.0])
    found = surface(q, v, np.array([1.0, 3.0, 5.0, 7.0]), 2)
    np.testing.assert_array_equal(found["force"], [[2.0, np.nan], [5.0, 7.0]])
    np.testing.assert_array_equal(found["samples"], [[0.5, 0.0], [0.25, 0.25]])
    np.testing.assert_array_equal(found["displacement"], [0.5, 1.5])
    np.testing.assert_array_equal(found["velocity"], [-0.5, 0.5])
