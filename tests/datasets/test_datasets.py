"""The records that come with the package."""

from importlib.resources import files

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.measurements import read_measurement

TESTS = [(1, 1.5), (0.5, 0.5), (1, 1), (1, 0.5), (0.5, 1)]


def test_the_decay_has_the_published_frequencies():
    beam = rp.datasets.magnetic_beam()
    strain, time = beam["strain_beam"].values, beam["time"].values
    rising = np.flatnonzero((strain[:-1] < 0) & (strain[1:] >= 0))
    crossings = time[rising] - strain[rising] * 1e-3 / (strain[rising + 1] - strain[rising])
    first = 5 / (crossings[5] - crossings[0])
    assert first == pytest.approx(41.0, abs=0.3)
    assert 5 / (crossings[-1] - crossings[-6]) < 38


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


def test_each_file_has_its_licence_beside_it():
    folder = files("robustpolish.datasets") / "files"
    for name in ("magnetic_beam", "friction_damper"):
        assert (folder / f"{name}.npz").is_file()
        assert "icense" in (folder / f"{name}.LICENSE.txt").read_text()


@pytest.mark.shared
def test_the_records_are_those_that_were_measured(shared):
    beam = read_measurement(shared / "data/magnetic_beam/decay.npz").isel(time=slice(2180, 5680))
    own = rp.datasets.magnetic_beam()
    for name in own:
        assert np.array_equal(own[name].values, beam[name].values)
    for frequency, amplitude in TESTS:
        name = f"{frequency:g}Hz36lbtension{amplitude:g}amplitude".replace(".", "p")
        path = shared / "data/friction_damper_backlash/brfd.npz"
        original = read_measurement(path, table=name)
        test = rp.datasets.friction_damper(frequency, amplitude)
        for mine, theirs, step in (("x", "x_m", 2e-6), ("v", "v_mps", 1e-5), ("F", "F_N", 1.0)):
            assert np.max(np.abs(test[mine].values - original[theirs].values)) < 0.51 * step
