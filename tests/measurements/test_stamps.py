"""Dates and times of day, as instruments write them."""

import numpy as np
import pytest

from robustpolish.signals.time_axis import ClockTimes, clock_times, is_clock_text

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


def test_days_and_times_of_day_may_stand_apart():
    days = clock_times(["3.5.2024", "3.5.2024", "5.5.2024"])
    clock = clock_times(["12:00:00", "23:59:59", "00:00:01"])
    assert (days.seconds, clock.days) == (None, None)
    np.testing.assert_allclose(clock.since_first(days.days), [0, 43199, 2 * 86400 - 43199])
    np.testing.assert_allclose(days.since_first(), [0, 0, 2 * 86400])


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
