"""The same filter on all channels, without a delay."""

import numpy as np
import pytest
import xarray as xr

from robustpolish.errors import InvalidInputError
from robustpolish.measurements import lowpass

DATA = xr.Dataset({"x": ("time", np.arange(100.0))}, {"time": np.arange(100) * 0.01})


@pytest.mark.parametrize("cutoff", [0.0, -1.0, 50.0, 1e9, "a", 0.5])
def test_bad_filters_are_refused(cutoff):
    with pytest.raises(InvalidInputError, match="cutoff"):
        lowpass(DATA, cutoff)


def test_slow_signals_pass_and_fast_ones_do_not():
    time = np.arange(2000) * 1e-3
    slow, fast = np.sin(2 * np.pi * 3 * time), np.sin(2 * np.pi * 200 * time)
    data = xr.Dataset({"x": ("time", slow + fast, {"units": "m"})}, {"time": time})
    smooth = lowpass(data, 40.0)
    kept = slice(100, 1900)  # four periods of 25 samples at both ends
    np.testing.assert_array_equal(smooth["time"], time[kept])
    np.testing.assert_allclose(smooth["x"], slow[kept], atol=1e-4)
    assert smooth["x"].attrs["units"] == "m"


def test_the_amplitude_is_halved_at_the_cutoff():
    time = np.arange(4000) * 1e-3
    data = xr.Dataset({"x": ("time", np.sin(2 * np.pi * 40 * time))}, {"time": time})
    assert float(abs(lowpass(data, 40.0)["x"]).max()) == pytest.approx(0.5, abs=0.005)
