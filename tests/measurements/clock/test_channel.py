"""Which column is the time, and what it says."""

import numpy as np
import pandas as pd
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.signals.raw import RawTable
from robustpolish.signals.time_axis import find_time, is_text, seconds


def table(**columns):
    raw = RawTable()
    for name, values in columns.items():
        raw.add(name.replace("__", "/"), np.asarray(values))
    return raw


def test_the_likeliest_name_is_the_time():
    assert find_time(table(x=[1, 2], t=[0, 1], elapsed=[0, 1]), None) == "t"
    assert find_time(table(x=[1, 2], rig__Zeit=[0, 1]), None) == "rig/Zeit"
    assert find_time(table(x=[1, 2]), None) is None
    assert find_time(table(x=[1, 2], clock=[0, 1], q=[3, 4]), "q") == "q"
    assert find_time(table(x=[1, 2], when=["12:00:00", "12:00:01"]), None) == "when"
    with pytest.raises(InvalidInputError, match="time: got no channel 'z'"):
        find_time(table(x=[1, 2]), "z")


def test_several_groups_have_to_be_chosen_from():
    raw = table(a__t=[0, 1], a__x=[1, 2], b__t=[0, 1])
    message = r"2 groups with a time.*a/t \(2\), a/x \(2\), b/t \(2\)\. Pass table=, one of a, b"
    with pytest.raises(InvalidInputError, match=message):
        find_time(raw, None)
    assert find_time(raw, "b/t") == "b/t"


def test_units_of_time():
    raw = table(t=[0, 500, 1000])
    raw.units["t"] = "ms"
    np.testing.assert_allclose(seconds(raw, "t"), [0, 0.5, 1])
    raw.units["t"] = "mm"
    with pytest.raises(InvalidInputError, match="unit of 't': got 'm', expected a unit of time"):
        seconds(raw, "t")


def test_dates_of_any_kind_count_from_the_first():
    stamps = pd.Timestamp("2024-05-03") + pd.to_timedelta([0.0, 1.5], unit="s")
    np.testing.assert_allclose(seconds(table(t=stamps.to_numpy()), "t"), [0, 1.5])
    text = np.array(["2024-05-03 12:00:00", "2024-05-03 12:00:01.5"], dtype=object)
    np.testing.assert_allclose(seconds(table(t=text), "t"), [0, 1.5])
    apart = table(Date=["2.5.2024", "3.5.2024"], Time=["23:59:59", "00:00:01"])
    np.testing.assert_allclose(seconds(apart, "Time"), [0, 2])
    np.testing.assert_allclose(seconds(apart, "Date"), [0, 2])
    assert is_text(apart.columns["Date"])
    since_1970 = table(t=[1714737600.0, 1714737600.5])
    np.testing.assert_allclose(seconds(since_1970, "t"), [0, 0.5])
    assert since_1970.notes == ["time counts from its first stamp, 1714737600.000 s"]


def test_a_bad_stamp_is_named_by_its_line():
    raw = table(t=["12:00:00", "fault"])
    raw.lines = np.array([7, 8])
    with pytest.raises(InvalidInputError, match="t: got 'fault' at line 8"):
        seconds(raw, "t")
