"""Names that C takes, and where files go."""

from pathlib import Path

import pytest

import robustpolish as rp
from robustpolish.implementation.export.c import identifier, number, target


def test_names_of_c():
    assert identifier("loop_2") == "loop_2"
    for bad in ("", "2loop", "a b", "for", "a-b", "_x", "x" * 60, None):
        with pytest.raises(rp.InvalidInputError, match="name"):
            identifier(bad)


def test_a_folder_gets_a_file_of_the_name():
    assert target("folder", "loop", ".c") == Path("folder/loop.c")
    assert target("folder/other.c", "loop", ".c") == Path("folder/other.c")


@pytest.mark.parametrize("value", [0.0, -0.0, 1.0, 1 / 3, 1e-300, -2.5e22, 5e-324, 123456789.0])
def test_numbers_come_back_exactly(value):
    assert float(number(value, "double")) == value
    short = number(value, "float")
    assert short.endswith("f")
    assert any(c in short for c in ".e")


def test_infinite_limits_become_the_largest_number():
    assert float(number(float("inf"), "double")) == 1.7976931348623157e308
    assert number(float("-inf"), "float") == "-3.40282347e+38f"
