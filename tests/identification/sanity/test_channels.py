"""A channel by itself: clipped, frozen, or nothing but noise."""

import numpy as np
import pytest
from scipy.signal import lfilter

from robustpolish.identification.sanity import clipping, dropouts, no_motion

TIME = np.arange(5000) / 500
RANDOM = np.random.default_rng(3)
NOISE = RANDOM.standard_normal(TIME.size)
SWING = np.cumsum(NOISE)
SWING = lfilter([1], [1, -1.99, 0.995], NOISE)


def held(values, first, length):
    values = values.copy()
    values[first : first + length] = values[first]
    return values


def stick_slip():
    """A mass that friction stops and holds: constant for long, and off again without a jump."""
    values, velocity, place = np.empty(5000), 0.0, 0.0
    for i in range(5000):
        force = 3 * np.sin(0.01 * i) - place
        drive = force - np.sign(velocity if velocity else force) * 2.0
        sticks = velocity == 0 and abs(force) < 2.0
        before, velocity = velocity, 0.0 if sticks else velocity + 0.05 * drive
        velocity = 0.0 if before * velocity < 0 else velocity
        place += 0.05 * velocity
        values[i] = place
    return values


def test_clipped_peaks_are_told_with_their_values():
    limit = 0.6 * np.abs(SWING).max()
    found = clipping("x", np.clip(SWING, -limit, limit))
    assert "clipped" in found
    assert f"{limit:.4g}" in found
    assert clipping("x", SWING) == ""


def test_dropouts_are_told_with_place_and_length():
    fastest = int(np.argmax(np.abs(np.diff(SWING[:4000]))))
    found = dropouts("x", held(SWING, fastest - 3, 15), TIME)
    assert found.startswith(f"x stands still for 15 samples at {TIME[fastest - 3]:.6g} s")
    broken = SWING.copy()
    broken[2000:2100] = broken[3000:3010] = 5 * SWING.max()
    assert "100 samples at 4 s and then jumps, and in 1 other places" in dropouts("x", broken, TIME)


@pytest.mark.parametrize(
    "values",
    [
        SWING,
        np.round(SWING / SWING.max() * 50),  # a coarse converter
        np.repeat(SWING[::10], 10),  # held by nature
        np.where(TIME < 5, 0.0, SWING - SWING[2500]),  # at rest, then moving
        stick_slip(),
        np.sign(SWING),
    ],
    ids=["swing", "coarse", "held", "rest", "stick-slip", "square"],
)
def test_what_stands_still_by_nature_is_no_dropout(values):
    assert dropouts("x", values, TIME) == ""


def test_noise_is_no_motion_and_motion_with_noise_is():
    assert "no motion" in no_motion("x", 1e-6 * NOISE + 3)
    assert "never changes" in no_motion("x", np.full(300, 2.0))
    for motion in (SWING, np.sin(2 * np.pi * 125 * TIME), np.sin(TIME) + NOISE):
        assert no_motion("x", motion) == ""
    assert no_motion("x", NOISE[:100]) == ""  # too short to say
