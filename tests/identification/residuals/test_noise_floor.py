import numpy as np
import pytest
from scipy.signal import lfilter

from robustpolish.identification.residuals.tests import noise_floor
from tests.identification.oscillators import record

MOTION = record(4000)["x"].values
NONE = np.zeros(1)


def noise(pole, decibel, seed=0):
    """Noise of first order so many decibels below the motion of an oscillator."""
    white = np.random.default_rng(seed).standard_normal(MOTION.size + 300)
    coloured = lfilter([1.0], [1.0, -pole], white)[300:]
    return coloured * np.std(MOTION) * 10 ** (-decibel / 20) * np.sqrt(1 - pole**2)


@pytest.mark.parametrize("pole", [0.0, 0.6, 0.9])
@pytest.mark.parametrize("decibel", [20, 30, 40])
def test_noise_of_first_order_is_told_apart_from_what_a_model_does_wrong(pole, decibel):
    """A stiffness that is wrong by a part adds a share of the motion to the errors."""
    e = noise(pole, decibel)
    true = np.std(MOTION) * 10 ** (-decibel / 20)
    for wrong in (0.0, 0.3):
        (found,) = noise_floor((e + wrong * MOTION)[:, None], MOTION[:, None], NONE)
        assert true / 1.5 < found < 1.5 * true


@pytest.mark.parametrize("cubic", [3e5, 3e6])
def test_the_floor_of_a_wrong_model_is_at_most_its_error(cubic):
    wrong = record(4000, cubic=cubic)["x"].values - MOTION + noise(0.0, 40)
    (found,) = noise_floor(wrong[:, None], MOTION[:, None], NONE)
    assert found <= np.sqrt(np.mean(wrong**2))
    assert found > 0.5 * np.std(noise(0.0, 40))


def test_each_output_has_a_floor_of_its_own():
    errors = np.column_stack([noise(0.0, 20), 1e3 * noise(0.6, 40, seed=1)])
    motion = np.column_stack([MOTION, 1e3 * MOTION])
    found = noise_floor(errors, motion, np.zeros(2))
    np.testing.assert_allclose(found, np.std(errors, axis=0), rtol=0.1)


def test_where_the_motion_hides_all_noise_the_quietest_band_stands_for_it():
    e = noise(0.0, 20)
    loud = np.random.default_rng(5).standard_normal(MOTION.size)
    np.testing.assert_array_equal(noise_floor(e[:, None], loud[:, None], np.array([1e-5])), [1e-5])
    # and it is the least that is ever said, the error the most
    at_least = 0.99 * np.sqrt(np.mean(e**2))
    found = noise_floor(0.5 * e[:, None], MOTION[:, None], np.array([at_least]))
    np.testing.assert_allclose(found, np.sqrt(np.mean((0.5 * e) ** 2)))


def test_colours_that_look_alike_above_the_motion_are_told_by_the_errors_below():
    """A quiet end of the spectrum alone leaves a factor of two open."""
    true = np.std(noise(0.9, 30))
    (found,) = noise_floor(noise(0.9, 30)[:, None], MOTION[:, None], NONE)
    assert found == pytest.approx(true, rel=0.05)


def test_noise_is_no_louder_than_the_quietest_stretch():
    e = noise(0.9, 30)
    wrong = e.copy()
    wrong[: e.size // 2] *= 20  # a blow that the model does not follow, and then nothing
    (found,) = noise_floor(wrong[:, None], MOTION[:, None], NONE)
    assert found < 1.5 * np.std(e)


def test_a_run_that_diverged_tells_nothing():
    e = noise(0.0, 20)
    motion = MOTION.copy()
    motion[-1] = np.inf
    np.testing.assert_array_equal(noise_floor(e[:, None], motion[:, None], np.ones(1) * 1e-6), 1e-6)


def test_where_nothing_moves_a_sensor_that_counts_shows_less_than_it_rounds_away():
    time = np.arange(4000) * 1e-2
    swing = np.maximum(1 - time / 30, 0) * np.sin(8 * time)  # dry friction ends it
    step = 3e-3
    errors = step * np.round(swing / step) - swing
    steps = np.array([step / 12**0.5])
    (found,) = noise_floor(errors[:, None], swing[:, None], steps, steps=steps)
    assert found == pytest.approx(np.sqrt(np.mean(errors**2)), rel=0.25)
    (found,) = noise_floor(errors[:, None], swing[:, None], steps)
    assert found < 0.5 * step / 12**0.5


def test_a_short_record_may_lack_some_of_its_noise_by_chance():
    """The fewer stretches a spectrum is averaged over, the deeper the notches that chance makes."""
    kept = slice(0, 3000)
    for seed in range(20):
        e, motion = noise(0.9, 30, seed)[kept], MOTION[kept]
        (found,) = noise_floor(e[:, None], motion[:, None], NONE)
        assert found > np.std(e) / 1.5
