"""Time stamps: which column they are, what they say, what is mended and what is refused."""

import re

import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.signals.time_axis import ClockTimes, clock_times, is_clock_text, uniform_time

GRID = np.arange(2000) * 1e-3


def test_a_uniform_grid_is_left_alone():
    axis = uniform_time(GRID + 7.0)
    assert axis.taken is None
    assert axis.note == ""
    np.testing.assert_allclose(axis.time, GRID + 7.0, rtol=0, atol=1e-12)


def test_rounded_stamps_are_a_uniform_grid():
    time = np.arange(2000) / 2048
    axis = uniform_time(np.round(time, 4))
    assert axis.taken is None
    np.testing.assert_allclose(axis.time, time, atol=1e-4)


def test_small_gaps_are_filled():
    keep = np.ones(2000, bool)
    keep[[300, 301, 900]] = False
    signal = np.sin(2 * np.pi * 10 * GRID)
    axis = uniform_time(GRID[keep])
    assert axis.note == "3 missing samples filled in at 2 places, by cubic interpolation"
    np.testing.assert_allclose(axis.time, GRID, atol=1e-12)
    np.testing.assert_allclose(axis.move(signal[keep]), signal, atol=1e-5)


def test_jitter_is_resampled():
    time = GRID + np.random.default_rng(0).uniform(-1e-4, 1e-4, GRID.size)
    axis = uniform_time(time)
    assert "jittered" in axis.note
    signal = lambda t: np.sin(2 * np.pi * 10 * t)  # noqa: E731
    np.testing.assert_allclose(axis.move(signal(time)), signal(axis.time), atol=1e-5)
    assert axis.time[0] >= time[0]
    assert axis.time[-1] <= time[-1]


RANDOM = np.random.default_rng(1)
IRREGULAR = {
    "a tenth lost": GRID[RANDOM.random(2000) < 0.9],
    "a loop that sleeps": np.cumsum(1e-3 * (1 + 0.8 * RANDOM.random(2000))),
    "a clock that speeds up": np.cumsum(np.linspace(1.5e-3, 0.7e-3, 2000)),
    "two speeds": np.cumsum(np.where(np.arange(2000) % 2, 1e-3, 2e-3)),
}


@pytest.mark.parametrize("case", IRREGULAR)
def test_irregular_clocks_are_resampled_with_a_note(case):
    taken = IRREGULAR[case]
    axis = uniform_time(taken)
    assert axis.irregular
    assert re.search("irregular clock, steps from .* to .* s .*: resampled at .* Hz", axis.note)
    assert axis.time.size == taken.size
    np.testing.assert_allclose(np.diff(axis.time), np.diff(axis.time)[0], rtol=1e-6)
    slow, fast = (lambda t, f=f: np.sin(2 * np.pi * f * t) for f in (9.0, 300.0))
    np.testing.assert_allclose(axis.move(slow(taken)), slow(axis.time), atol=3e-4)
    assert axis.interpolation_warning("x", slow(taken)) == ""
    assert "x changes fast for its irregular clock" in axis.interpolation_warning("x", fast(taken))


def test_a_gap_is_named_with_the_parts_that_can_be_read():
    time = np.delete(GRID, [*range(400, 500), *range(1200, 1207), *range(1210, 1220)])
    message = (
        r"3 gaps?, the longest of 0.101 s after 0.399 s, with steps of 0.001 s, expected no gap "
        r"of more than 5 samples. Read an unbroken part with between=\(START, END\): "
        r"0 to 0.399 s, 0.5 to 1.199 s, 1.22 to 1.999 s"
    )
    with pytest.raises(InvalidInputError, match=message):
        uniform_time(time)
    longest_bridged = np.delete(GRID, range(400, 405))
    assert uniform_time(longest_bridged).note.startswith("5 missing samples filled in at 1 place")


BAD = {
    "falls": (np.where(np.arange(2000) == 500, 0.1, GRID), "0.1 s after 0.499 s, at sample 500"),
    "repeats": (np.repeat(GRID[:100], 2), "rises"),
    "stands still": (np.zeros(10), "rises"),
    "large gap": (np.delete(GRID, np.arange(400, 500)), "gap"),
    "rests": (np.sort(np.random.default_rng(2).uniform(0, 2, 2000)), "gap"),
    "logarithmic": (np.geomspace(1e-3, 1, 200), "gap"),
    "one": (np.array([0.0]), "two samples"),
    "none": (np.array([]), "two samples"),
}


@pytest.mark.parametrize("case", BAD)
def test_refused(case):
    time, message = BAD[case]
    with pytest.raises(InvalidInputError, match=message):
        uniform_time(time)


SECONDS = [0.0, 0.001, 1.5, 3600.0]
WRITTEN = {
    "ISO": ["2024-05-03T12:00:00.000", "2024-05-03T12:00:00.001", "2024-05-03T12:00:01.5",
            "2024-05-03T13:00:00"],
    "universal": ["2024-05-03T12:00:00Z", "2024-05-03T12:00:00.001Z", "2024-05-03T12:00:01.500Z",
                  "2024-05-03T13:00:00Z"],
    "summer ends": ["2024-10-27T02:30:00+02:00", "2024-10-27T02:30:00.001+02:00",
                    "2024-10-27T02:30:01.5+0200", "2024-10-27T02:30:00+01:00"],
    "German": ["03.05.2024 23:59:59,000", "03.05.2024 23:59:59,001", "04.05.2024 00:00:00,5",
               "04.05.2024 00:59:59"],
    "American": ["12/31/2024 11:59:59 PM", "12/31/2024 11:59:59.001 PM",
                 "1/1/2025 12:00:00.500 AM", "1/1/2025 12:59:59 AM"],
    "of day": ["23:59:59", "23:59:59.001", "00:00:00.500", "00:59:59"],
    "elapsed": ["0:00:00", "0:00:00.001", "0:00:01.5", "1:00:00"],
}  # fmt: skip


@pytest.mark.parametrize("way", WRITTEN)
def test_stamps_become_seconds_since_the_first(way):
    assert all(is_clock_text(text) for text in WRITTEN[way])
    np.testing.assert_allclose(clock_times(WRITTEN[way]).since_first(), SECONDS, atol=1e-9)


@pytest.mark.parametrize("text", ["", "3.5", "2024", "12", "fault", "x 12:00", "1.2.3", "12-30"])
def test_other_text_is_no_stamp(text):
    assert not is_clock_text(text)


@pytest.mark.parametrize(
    "bad", ["fault", "2024-05-03", "2024-13-03T12:00:00", "2024-05-03T12:61:00", "12:00:00", ""]
)
def test_the_first_stamp_of_another_kind_is_named(bad):
    good = "2024-05-03T12:00:00"
    assert isinstance(clock_times([good, good]), ClockTimes)
    assert clock_times([good, good, bad, good]) == 2
