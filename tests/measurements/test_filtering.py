"""The same filter on all channels, without a delay."""

import numpy as np
import pytest
import xarray as xr

from robustpolish.errors import InvalidInputError
from robustpolish.signals.filtering import decimate, lowpass

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


def record(samples, rate, *frequencies):
    time = 3.0 + np.arange(samples) / rate
    return xr.Dataset(
        {
            name: ("time", 7 + np.sin(2 * np.pi * f * time), {"units": "m"})
            for name, f in zip("xyz", frequencies, strict=False)
        },
        {"time": ("time", time, {"units": "s"})},
    )


@pytest.mark.parametrize("every", [2, 3, 10, 25])
@pytest.mark.parametrize("samples", [5000, 5001, 5013])
def test_slow_signals_are_kept_and_fast_ones_leave_nothing(every, samples):
    rate = 1000.0 * every
    data = record(samples, rate, 40.0, 399.0, 601.0)
    fewer = decimate(data, 1000.0)
    time = fewer["time"].values
    np.testing.assert_allclose(np.diff(time), 1e-3, rtol=1e-9)
    assert np.isin(time, data["time"].values).all()
    assert abs(time[0] - 3.013) < 1.1e-3  # 13 samples at the beginning
    assert data["time"].values[-1] - time[-1] < 0.0145
    for name, frequency in (("x", 40.0), ("y", 399.0)):
        slow = 7 + np.sin(2 * np.pi * frequency * time)
        np.testing.assert_allclose(fewer[name], slow, atol=2e-4)
    np.testing.assert_allclose(fewer["z"], 7, atol=2e-4)
    assert fewer["x"].attrs["units"] == "m"
    assert fewer["time"].attrs["units"] == "s"


def test_the_rate_is_never_below_the_wanted_one():
    data = record(5000, 10_000.0, 40.0)
    data.attrs["notes"] = ["resampled"]
    fewer = decimate(data, 3000.0)
    assert 1 / float(np.diff(fewer["time"])[0]) == pytest.approx(10_000 / 3)
    assert fewer.attrs["notes"] == [
        "resampled",
        "decimated from 10000 to 3333.33 Hz: every 3rd sample, no delay, unchanged up to "
        "1333.33 Hz",
    ]
    assert data.attrs["notes"] == ["resampled"]
    assert decimate(data, 6000.0) is data
    assert decimate(data, 10_000.0) is data


@pytest.mark.parametrize("rate", [0.0, -1.0, "a", np.nan, 10.0])
def test_bad_rates_are_refused(rate):
    with pytest.raises(InvalidInputError, match="rate"):
        decimate(record(5000, 10_000.0, 40.0), rate)
