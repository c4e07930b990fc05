"""Clipped signals, and signals that only look like it."""

import numpy as np
import pytest
from scipy import signal

from robustpolish.errors import InvalidInputError
from robustpolish.signals.quality import check_not_clipped

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
