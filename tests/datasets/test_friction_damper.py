"""The friction damper with its clearance."""

import numpy as np
import pytest

import robustpolish as rp

TESTS = [(1, 1.5), (0.5, 0.5), (1, 1), (1, 0.5), (0.5, 1)]


@pytest.mark.parametrize(("frequency", "amplitude"), TESTS)
def test_the_damper_moves_as_its_name_says(frequency, amplitude):
    test = rp.datasets.friction_damper(frequency, amplitude)
    assert float(np.ptp(test["x"].values)) / 2 == pytest.approx(0.0254 * amplitude, rel=0.05)
    spectrum = np.abs(np.fft.rfft(test["x"].values * np.hanning(test.sizes["time"])))
    frequencies = np.fft.rfftfreq(test.sizes["time"], 1 / 1024)
    assert frequencies[np.argmax(spectrum)] == pytest.approx(frequency, rel=0.08)
    assert float(np.mean(test["v"] * test["F"])) > 0  # it takes energy
    assert [test[name].attrs["units"] for name in ("x", "v", "F")] == ["m", "m/s", "N"]


def test_a_test_that_was_not_made_is_refused():
    with pytest.raises(rp.InvalidInputError, match=r"1 Hz 1\.5 inch"):
        rp.datasets.friction_damper(0.5, 1.5)
