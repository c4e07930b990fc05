"""The records that come with the package."""

from importlib.resources import files

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.machines.simulation import simulate_model as simulate
from robustpolish.signals.read import read_measurement

TESTS = [(1, 1.5), (0.5, 0.5), (1, 1), (1, 0.5), (0.5, 1)]


def test_each_file_has_its_licence_beside_it():
    folder = files("robustpolish") / "data"
    records = sorted(path.name for path in folder.iterdir() if path.name.endswith(".npz"))
    assert len(records) == 4
    for name in records:
        licence = (folder / name.replace(".npz", ".LICENSE.txt")).read_text()
        assert licence.startswith(name)
        assert "icense" in licence
        assert "https://github.com/" in licence


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


@pytest.mark.shared
def test_the_rounded_ones_are_within_single_precision(shared):
    pieces = {
        "pendulum_decay/train.csv": rp.datasets.pendulum_decay(),
        "pendulum_decay/test.csv": rp.datasets.pendulum_decay("rest"),
        "mr_damper_0v/train.csv": rp.datasets.mr_damper().isel(time=slice(0, 940)),
        "mr_damper_0v/test.csv": rp.datasets.mr_damper().isel(time=slice(940, None)),
    }
    for path, own in pieces.items():
        original = read_measurement(shared / "data/real" / path)
        assert set(own) == set(original)
        for name in own:
            np.testing.assert_allclose(own[name].values, original[name].values, rtol=1e-7)
            assert own[name].attrs["units"] == original[name].attrs["units"]
        assert float(own["time"][1] - own["time"][0]) == pytest.approx(0.01)


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


def test_the_decay_has_the_published_frequencies():
    beam = rp.datasets.magnetic_beam()
    strain, time = beam["strain_beam"].values, beam["time"].values
    rising = np.flatnonzero((strain[:-1] < 0) & (strain[1:] >= 0))
    crossings = time[rising] - strain[rising] * 1e-3 / (strain[rising + 1] - strain[rising])
    first = 5 / (crossings[5] - crossings[0])
    assert first == pytest.approx(41.0, abs=0.3)
    assert 5 / (crossings[-1] - crossings[-6]) < 38


def test_it_moves_to_and_fro_and_takes_energy():
    test = rp.datasets.mr_damper()
    assert test.sizes["time"] == 1340
    assert [test[name].attrs["units"] for name in ("x", "v", "F")] == ["m", "m/s", "N"]
    assert float(np.ptp(test["x"].values)) / 2 == pytest.approx(12.6e-3, rel=0.01)
    assert float(np.mean(test["v"] * test["F"])) > 3.0  # watts


def test_the_velocity_is_that_of_the_displacement():
    test = rp.datasets.mr_damper()
    slope = np.gradient(test["x"].values, 0.01)
    assert np.std(slope - test["v"].values) < 0.05 * np.std(slope)


def period(swing):
    """Return the time from one upward crossing to the next, one value a swing."""
    theta, time = swing["theta"].values, swing["time"].values
    rising = np.flatnonzero((theta[:-1] < 0) & (theta[1:] >= 0))
    return np.diff(time[rising] - 0.01 * theta[rising] / (theta[rising + 1] - theta[rising]))


def test_the_large_swings_are_slower_as_the_elliptic_integral_says():
    first, rest = rp.datasets.pendulum_decay(), rp.datasets.pendulum_decay("rest")
    assert (first.sizes["time"], rest.sizes["time"]) == (3667, 1834)
    large = float(abs(first["theta"][:200]).max())
    small = float(abs(rest["theta"][-200:]).max())

    def slower(amplitude):  # the first terms of the period over that of small swings
        return 1 + amplitude**2 / 16 + 11 * amplitude**4 / 3072

    ratio = period(first)[0] / period(rest)[-2:].mean()
    assert ratio == pytest.approx(slower(large) / slower(small), rel=0.01)


def test_the_rest_goes_on_where_the_first_part_ends():
    ends = (rp.datasets.pendulum_decay(part)["theta"].values for part in ("first", "rest"))
    before, after = ends
    assert abs(before[-80:]).max() > abs(after[:80]).max() > abs(after[-80:]).max()
    assert after[0] == pytest.approx(2 * before[-1] - before[-2], abs=0.01)


def test_another_part_is_refused():
    with pytest.raises(rp.InvalidInputError, match="'first', 'rest'"):
        rp.datasets.pendulum_decay("last")


def test_the_record_is_the_model_with_friction_and_a_micron_of_noise():
    model, data = rp.datasets.sticky_slide()
    assert not model.effects
    truth = model.with_effect("coulomb_friction", ("x", "ground"), {"force": 3.0})
    rest = data["x"].values - simulate(truth, data).outputs[:, 0]
    assert 0.95e-6 < np.std(rest) < 1.05e-6
    assert abs(np.corrcoef(rest[1:], rest[:-1])[0, 1]) < 0.07  # white
    assert np.std(data["x"].values - simulate(model, data).outputs[:, 0]) > 20e-6


def test_it_is_always_the_same():
    first, again = (rp.datasets.sticky_slide()[1] for _ in range(2))
    assert first.identical(again)
    assert (first.sizes["time"], float(first["time"][1])) == (2000, 1e-3)
