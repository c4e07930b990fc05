"""What a reader gets out of a file, before any check."""

import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.signals.raw import RawTable, unreadable_file


def table(*names):
    raw = RawTable()
    for name in names:
        raw.add(name, [1.0, 2.0])
    return raw


def test_a_name_is_used_once_and_a_unit_in_the_file_goes_before_the_header():
    table = RawTable()
    table.add("x [mm]", [1.0], "um")
    assert table.units == {"x": "um"}
    with pytest.raises(InvalidInputError, match="column: got 'x', expected a name used once"):
        table.add("x", [2.0])


def test_columns_go_by_name_by_header_and_by_the_end_of_their_path():
    raw = table("x [mm]", "a/F", "a/y", "b/y")
    assert [raw.resolve("column", name) for name in ("x", "x [mm]", "F")] == ["x", "x", "a/F"]
    with pytest.raises(InvalidInputError, match=r"'y' in several groups, expected .* a/y, b/y"):
        raw.resolve("column", "y")
    with pytest.raises(InvalidInputError, match=r"no channel 'q', expected .* x, a/F, a/y, b/y"):
        raw.resolve("column", "q")


def test_columns_can_change_places():
    raw = table("x [mm]", "y", "F [kN]")
    raw.columns["y"] = [3.0, 4.0]
    raw.rename({"x [mm]": "y", "y": "x"})
    assert raw.columns == {"y": [1.0, 2.0], "x": [3.0, 4.0], "F": [1.0, 2.0]}
    assert raw.units == {"y": "mm", "F": "kN"}
    for names in ({"x": "y"}, {"x": ""}, {"x": 3}, {"q": "z"}):
        with pytest.raises(InvalidInputError, match="rename"):
            raw.rename(names)


def test_a_library_s_complaint_is_told_in_one_line():
    assert "a.wav (first)" in str(unreadable_file("a.wav", "WAV", ValueError("first\nsecond")))
    assert "a.wav (KeyError)" in str(unreadable_file("a.wav", "WAV", KeyError()))
