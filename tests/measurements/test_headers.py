"""Names and units in the heads of columns, as people and programs write them."""

import pytest

from robustpolish.signals.headers import (
    is_count,
    is_time,
    line_of_units,
    rank_as_time,
    split_header,
)


@pytest.mark.parametrize(
    ("header", "name", "unit"),
    [
        ("x [mm]", "x", "mm"), (" # x  [ mm ] ", "x", "mm"), ("x", "x", ""), ("[mm]", "[mm]", ""),
        ("k[1] [N/m]", "k[1]", "N/m"), ("a []", "a", ""),
    ],
)  # fmt: skip
def test_headers_are_split(header, name, unit):
    assert split_header(header) == (name, unit)


@pytest.mark.parametrize(
    ("header", "name", "unit"),
    [
        ("Time (s)", "Time", "s"), ("Zeit [s]", "Zeit", "s"), ("t/ms", "t", "ms"),
        ("a / (m/s^2)", "a", "m/s^2"), ("Acc (m/s\u00b2)", "Acc", "m/s\u00b2"), ("M/Nm", "M", "Nm"),
        ("time_ms", "time_ms", "ms"), ("Time (min)", "Time", "min"), ("v/m/s", "v", "m/s"),
        # what only looks like a unit
        ("x (left)", "x (left)", ""), ("x(1)", "x(1)", ""), ("dy/dt", "dy/dt", ""),
        ("x (min)", "x (min)", ""), ("Date/Time", "Date/Time", ""), ("x_m", "x_m", ""),
    ],
)  # fmt: skip
def test_units_in_parentheses_and_behind_a_stroke(header, name, unit):
    assert split_header(header, fraction=True) == (name, unit)


def test_a_stroke_separates_groups_in_other_files():
    assert split_header("run/m") == ("run/m", "")
    assert split_header("run/x (mm)") == ("run/x", "mm")


@pytest.mark.parametrize("name", ["Time", "t", "ZEIT", "Timestamp", "X_Value", "t_ms", "rig/time"])
def test_time_has_many_names(name):
    assert is_time(name)


@pytest.mark.parametrize("name", ["x", "T1", "times", "temperature", "ts", "", "theta"])
def test_other_names_are_no_time(name):
    assert not is_time(name)


def test_time_itself_goes_before_what_is_like_it():
    assert rank_as_time("time") < rank_as_time("t") < rank_as_time("elapsed")


def test_lines_of_units():
    assert line_of_units(["s", "kN", "-", ""]) == ["s", "kN", "", ""]
    assert line_of_units(["time", "F", "x"]) is None
    assert line_of_units(["", "-"]) is None


def test_numbers_of_rows():
    assert is_count("#")
    assert is_count("Sample_No")
    assert not is_count("x")
