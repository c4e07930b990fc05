"""Names and units in the heads of columns, as people and programs write them."""

import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.signals.raw import (
    is_count,
    is_time,
    line_of_units,
    same_kind,
    split_header,
    to_si,
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


def test_lines_of_units():
    assert line_of_units(["s", "kN", "-", ""]) == ["s", "kN", "", ""]
    assert line_of_units(["time", "F", "x"]) is None
    assert line_of_units(["", "-"]) is None


def test_numbers_of_rows():
    assert is_count("#")
    assert is_count("Sample_No")
    assert not is_count("x")


CASES = [
    ("mm", 1e-3, "m"),
    ("um", 1e-6, "m"),
    ("µm", 1e-6, "m"),
    ("kN", 1e3, "N"),
    ("g", 9.80665, "m/s^2"),
    ("mg", 9.80665e-3, "m/s^2"),
    ("deg", np.pi / 180, "rad"),
    ("°", np.pi / 180, "rad"),
    ("rpm", 2 * np.pi / 60, "rad/s"),
    ("deg/s", np.pi / 180, "rad/s"),
    ("m/s2", 1.0, "m/s^2"),
    ("m/s²", 1.0, "m/s^2"),
    ("m/s^2", 1.0, "m/s^2"),
    ("mm/s", 1e-3, "m/s"),
    ("Nm", 1.0, "N m"),
    ("N·m", 1.0, "N m"),
    ("N m", 1.0, "N m"),
    ("kNm", 1e3, "N m"),
    ("ms", 1e-3, "s"),
    ("kHz", 1e3, "Hz"),
    ("mV", 1e-3, "V"),
    ("bar", 1e5, "Pa"),
    ("lbf", 4.4482216152605, "N"),
    ("inch", 0.0254, "m"),
    ("microstrain", 1e-6, "1"),
    ("%", 0.01, "1"),
    ("-", 1.0, "1"),
    ("2.5 mm", 2.5e-3, "m"),
]


@pytest.mark.parametrize(("unit", "factor", "name"), CASES)
def test_conversion(unit, factor, name):
    values, found = to_si(np.array([0.0, 1.0, -2.0]), unit)
    assert found == name
    np.testing.assert_allclose(values, factor * np.array([0.0, 1.0, -2.0]), rtol=1e-12)


def test_temperature_has_an_offset():
    values, name = to_si(np.array([0.0, 20.0]), "degC")
    assert name == "K"
    np.testing.assert_allclose(values, [273.15, 293.15])


def test_no_unit_stays_unknown():
    values, name = to_si(np.array([3.0]), "")
    assert (values[0], name) == (3.0, "")


@pytest.mark.parametrize(
    "unit", ["furlongs per", "m/", "?", "0 mm", "][", "import os", "m**m", "é"]
)
def test_nonsense_is_refused(unit):
    with pytest.raises(InvalidInputError, match="unit"):
        to_si(np.array([1.0]), unit)


def test_same_kind():
    assert same_kind("N", "kN")
    assert same_kind("", "N")
    assert not same_kind("N", "m")
    assert not same_kind("rad", "m")
    assert not same_kind("N m", "N")
