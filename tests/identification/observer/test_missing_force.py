import numpy as np
import pytest
import xarray as xr
from scipy.signal import lsim

from robustpolish.identification.observer.kalman import Level, displacement_amplitude, scales_of
from robustpolish.identification.observer.missing_force import (
    best_observer_level,
    best_observer_run,
    known_forces,
    motion_of,
    smooth,
    smoothed_motion,
)
from robustpolish.identification.record import record_of
from tests.identification.oscillators import PLACE, RATE, of_rig, oscillator, record, rig

TIME = np.arange(3000) / RATE
LEVELS = tuple(Level(share) for share in (0.01, 0.1, 1.0))


def pushed(hidden, noise=1e-3):
    """An oscillator under a known force and a hidden one, by SciPy; and its true motion."""
    force = np.sin(9 * TIME) + np.sin(31 * TIME)
    system = ([[0.0, 1.0], [-400.0, -1.0]], [[0.0], [1.0]], np.eye(2), np.zeros((2, 1)))
    motion = lsim(system, force + hidden, TIME)[1].T
    x = motion[0] + noise * np.std(motion[0]) * np.random.default_rng(0).standard_normal(3000)
    data = xr.Dataset({"F": ("time", force), "x": ("time", x)}, {"time": TIME})
    return data, motion


def smoothed(model, data, levels=LEVELS):
    held = record_of(model, data)
    scales = scales_of(model, held)
    return smooth(
        model, held, scales, displacement_amplitude(model, held, scales.bandwidth), levels
    )


def test_a_hidden_force_is_found_with_the_motion():
    hidden = 0.5 * np.sin(13 * TIME)
    data, motion = pushed(hidden)
    found = smoothed(oscillator(), data)
    middle = slice(300, -300)
    assert np.std(found.force[0, middle] - hidden[middle]) < 0.1 * np.std(hidden)
    np.testing.assert_allclose(found.q[0], motion[0], atol=2e-3 * np.std(motion[0]))
    np.testing.assert_allclose(found.outputs[:, 0], found.q[0])
    # what model and record say of the acceleration, the hidden force left out
    expected = data["F"].values - 400 * found.q[0] - found.v[0]
    np.testing.assert_allclose(found.a[0], expected)
    start = found.start(oscillator(), 700)
    np.testing.assert_array_equal(start.state, [found.q[0, 700], found.v[0, 700]])


def test_each_of_several_records_is_smoothed_by_itself():
    one, other = (pushed(size * np.sin(13 * TIME))[0] for size in (0.5, -0.2))
    other = other.isel(time=slice(500, 2000))
    held = record_of(oscillator(), [one, other])
    scales = scales_of(oscillator(), held)
    amplitude = displacement_amplitude(oscillator(), held, scales.bandwidth)
    whole = smooth(oscillator(), held, scales, amplitude, LEVELS)
    parts = [smooth(oscillator(), part, scales, amplitude, LEVELS) for part in held.parts]
    assert whole.inputs.shape == (4500, 1)
    assert whole.internal.shape == (4500, 0)
    for name in ("q", "v", "a", "force"):
        both = np.hstack([getattr(part, name) for part in parts])
        np.testing.assert_array_equal(getattr(whole, name), both)
    assert smoothed_motion(oscillator(), held).q.shape == (1, 4500)
    stub = record_of(oscillator(), [one, other.isel(time=slice(0, 59))])
    assert smoothed_motion(oscillator(), stub) is None


def test_forces_of_the_model_s_own_effects_are_not_missing():
    hidden = np.full(TIME.size, 0.8)
    model = oscillator().with_effect("constant_force", PLACE, {"force": 0.8})
    data, _ = pushed(hidden)
    assert np.mean(smoothed(oscillator(), data).force[0]) == pytest.approx(0.8, rel=0.15)
    assert np.abs(smoothed(model, data).force[0, 300:-300]).max() < 0.05


def test_data_lead_no_more_than_they_have_to():
    level = []
    for hidden in (np.zeros(TIME.size), 3 * np.sin(40 * TIME)):
        held = record_of(oscillator(), pushed(hidden)[0])
        scales = scales_of(oscillator(), held)
        level.append(best_observer_level(oscillator(), held, scales, 0.01, LEVELS)[0])
    assert level[0] == Level(0.01)
    assert level[1].force > 0.01


def test_known_forces_are_those_of_the_laws():
    model = oscillator().with_effect("cubic_stiffness", PLACE, {"stiffness": 5.0})
    model = model.with_effect("quadratic_damping", PLACE, {"coefficient": 3.0})
    q, v = np.sin(9 * TIME)[None], 9 * np.cos(9 * TIME)[None]
    known = known_forces(model, q, v, TIME, 1 / RATE)
    assert known is not None
    assert known.pairs == [PLACE, PLACE]
    np.testing.assert_array_equal(known.rows, [[1.0], [1.0]])
    np.testing.assert_allclose(known.values, np.vstack([-5 * q**3, -3 * v * np.abs(v)]))
    assert known_forces(oscillator(), q, v, TIME, 1 / RATE) is None


def test_imposed_motion_is_taken_as_it_is():
    data = of_rig()
    signals = np.column_stack([data["x"], data["v"]])
    q, v = motion_of(rig(), np.zeros((1000, 0)), signals)
    np.testing.assert_array_equal(q[0], data["x"])
    np.testing.assert_array_equal(v[0], data["v"])
    assert smoothed(rig(stiffness=40.0), data).force[0] == pytest.approx(
        -10 * data["x"].values, abs=0.5
    )


def test_a_record_that_says_too_little_shows_no_motion():
    data = record(noise=0.01)
    assert smoothed_motion(oscillator(), record_of(oscillator(), data).part(0, 59)) is None
    found = smoothed_motion(oscillator(), record_of(oscillator(), data))
    assert found is not None
    spread = float(data["x"].std())
    clean = record()["x"].values
    assert np.std(found.q[0] - clean) < 0.01 * spread  # smoother than the sensor
    assert np.std(best_observer_run(oscillator(), record_of(oscillator(), data)).outputs[500:, 0]
                  - clean[500:]) < 0.02 * spread  # fmt: skip


@pytest.mark.parametrize("size", [1e12, 1e300])
def test_along_a_law_that_leaves_all_bounds_motion_is_smoothed_without_it(size):
    """A damping far stronger than all springs is no force known from a motion that lacks it."""
    data = pushed(np.zeros(3000))[0]
    held = oscillator().with_effect("displacement_dependent_damping", PLACE, {"coefficient": size})
    with np.errstate(all="ignore"):
        found = smoothed(held, data)
    without = smoothed(oscillator(), data).q
    assert np.max(np.abs(found.q - without)) < 0.2 * np.max(np.abs(without))
