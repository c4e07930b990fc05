"""Channels that are constant, clipped or have gaps, and rates that are too slow."""

import numpy as np
import pytest
import xarray as xr
from scipy import signal

from robustpolish.errors import InvalidInputError
from robustpolish.signals.raw import (
    check_not_clipped,
    check_sampling,
    ends_without_values,
    fill_gaps,
)

TIME = np.arange(20000) / 1000
RANDOM = np.random.default_rng(0)
NOISE = RANDOM.standard_normal(TIME.size)


def _oscillator(force):
    w, zeta = 2 * np.pi * 20, 0.01
    b, a = signal.bilinear([w**2], [1, 2 * zeta * w, w**2], 1000)
    return signal.lfilter(b, a, force)


def _quantised(values, bits):
    return np.round(values / np.ptp(values) * 2**bits) / 2**bits


SINE = np.sin(2 * np.pi * 3.3 * TIME)
SQUARE = np.repeat(RANDOM.choice([-1.0, 1.0], 500), 40)
HAMMER = np.zeros(TIME.size)


for _k in range(0, TIME.size, 1000):
    HAMMER[_k : _k + 12] = (1 + 0.3 * RANDOM.random()) * np.sin(np.pi * np.arange(12) / 12)


WHOLE = {
    "sine": SINE,
    "sweep": np.sin(2 * np.pi * (1 + TIME) * TIME),
    "response": _oscillator(NOISE),
    "noise": signal.filtfilt(*signal.butter(4, 0.2), NOISE),
    "decay": np.exp(-TIME) * np.sin(20 * TIME),
    "square": SQUARE,
    "square with noise": SQUARE + 1e-3 * NOISE,
    "response to square": _oscillator(SQUARE),
    "hammer": HAMMER,
    "trapezoid": np.clip(2 * signal.sawtooth(2 * np.pi * TIME, 0.5), -1, 1),
    "smooth pulses": np.where((TIME % 2) < 1, np.sin(np.pi * (TIME % 2)) ** 2, 0) - 0.5,
    "ramp and hold": np.minimum(TIME, 5.0),
    "burst": np.where(TIME < 5, np.sin(2 * np.pi * TIME), 0.0),
    "coarse sine": _quantised(SINE, 8),
    "coarse response": _quantised(_oscillator(NOISE), 6),
    "slow sine": _quantised(np.sin(2 * np.pi * 0.11 * TIME), 10),
}


@pytest.mark.parametrize("name", WHOLE)
def test_whole_signals_pass(name):
    check_not_clipped(name, WHOLE[name])


@pytest.mark.parametrize("name", ["sine", "sweep", "response", "decay", "response to square"])
@pytest.mark.parametrize("level", [0.5, 0.8, 0.95])
@pytest.mark.parametrize("sides", ["both", "top", "bottom"])
def test_clipped_signals_are_refused(name, level, sides):
    limit = level * np.abs(WHOLE[name]).max()
    low, high = (-limit if sides != "top" else None), (limit if sides != "bottom" else None)
    clipped = np.clip(WHOLE[name], low, high)
    if sides != "both" and np.array_equal(clipped, WHOLE[name]):
        pytest.skip("nothing is beyond this side")
    lost = np.count_nonzero(clipped != WHOLE[name])
    if lost < 25:
        pytest.skip("hardly a sample is beyond this side")
    with pytest.raises(InvalidInputError, match="clipped"):
        check_not_clipped(name, clipped)


TIME_GAPS = np.arange(1000) / 1000
SIGNAL = np.sin(2 * np.pi * 5 * TIME_GAPS)


def without(*missing):
    values = SIGNAL.copy()
    for each in missing:
        values[each] = np.nan
    return values


def test_short_gaps_are_filled_with_a_note_that_says_where():
    holes = without(100, slice(300, 305), 700, 800)
    values, note = fill_gaps("x", holes, TIME_GAPS, np.arange(1000) + 2)
    np.testing.assert_allclose(values, SIGNAL, atol=1e-5)
    assert note == (
        "x: 8 missing values filled in by cubic interpolation (at lines 102, 302 to 306, 702 and "
        "1 more)"
    )


@pytest.mark.parametrize("missing", [slice(300, 306), slice(None, None, 20), slice(0, 300)])
def test_what_is_missing_for_long_is_refused(missing):
    with pytest.raises(InvalidInputError, match=r"x: got \d+ missing values, the longest gap of"):
        fill_gaps("x", without(missing), TIME_GAPS)


def test_the_longest_gap_is_named_by_its_lines():
    with pytest.raises(InvalidInputError, match=r"20 at lines 302 to 321 \(0.3 to 0.319 s\)"):
        fill_gaps("x", without(100, slice(300, 320)), TIME_GAPS, np.arange(1000) + 2)


def test_short_ends_without_values_are_counted():
    assert ends_without_values([without(slice(0, 2)), without(0, 999)]) == (2, 1)
    assert ends_without_values([without(slice(0, 50)), SIGNAL]) == (0, 0)
    assert ends_without_values([np.full(9, np.nan)]) == (0, 0)


DATA = xr.Dataset({"x": ("time", np.arange(100.0))}, {"time": np.arange(100) * 0.01})


def test_sampling_too_slow_for_a_mode():
    check_sampling(DATA, [49.0])
    with pytest.raises(InvalidInputError, match="mode at 51 Hz"):
        check_sampling(DATA, [3.0, 51.0])
