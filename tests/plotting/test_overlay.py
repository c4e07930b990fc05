"""Measured and simulated signals, what is left over, and their spectra."""

import numpy as np
import pytest
import xarray as xr

from robustpolish import plots as plotting
from tests.plotting.legends import names


def test_a_response_with_its_band():
    time = np.linspace(0, 1, 50)
    measured = xr.DataArray(np.sin(time), {"time": time}, "time", "x", {"units": "m"})
    ax = plotting.plot_response(measured, measured + 1, xr.zeros_like(measured) + 0.1)
    assert names(ax) == ["measured", "simulated", "95 % band"]


def test_the_spectrum_peaks_at_the_frequency_of_the_signal():
    time = np.arange(4096) / 1024
    values = 3.0 * np.sin(2 * np.pi * 64 * time)
    values[5] = np.nan  # left out, not drawn
    signal = xr.DataArray(values, {"time": time}, "time", "x", {"units": "V"})
    short = signal[:4]  # too short for a spectrum
    ax = plotting.plot_spectra({"signal": signal, "short": short}, plotting.new_axes(None))
    (line,) = ax.lines
    frequency, density = line.get_data()
    assert frequency[np.argmax(density)] == pytest.approx(64, abs=0.5)
    assert ax.get_ylabel() == "amplitude density [V/sqrt(Hz)]"


def test_every_signal_has_overlay_residual_and_spectra():
    time = np.arange(100) / 100
    measured = xr.Dataset({"x": ("time", np.sin(time), {"units": "m"})}, {"time": time})
    figure = plotting.plot_overlay(measured, measured * 0.75)
    overlay, rest, spectra = figure.axes
    assert [ax.get_title() for ax in figure.axes] == ["x", "residual", "spectra"]
    assert names(overlay) == ["measured", "simulated"]
    np.testing.assert_allclose(rest.lines[0].get_ydata(), 0.25 * np.sin(time))
    assert names(spectra) == ["measured", "residual"]
