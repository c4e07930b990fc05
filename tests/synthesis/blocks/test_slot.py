"""Places for numbers: units, sizes, and what may stand there."""

import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.synthesis.structured.block_parts import ParameterSlot, checked_slot, tunable

TIME = ParameterSlot("Tf", None, time=1, low=0.0, search="positive")


@pytest.mark.parametrize(
    ("slot", "unit"),
    [
        (ParameterSlot("Kp", None, out=0, into=0), "N/m"),
        (ParameterSlot("Ki", None, time=-1, out=0, into=0), "N/(m s)"),
        (ParameterSlot("Kd", None, time=1, out=0, into=0), "N s/m"),
        (TIME, "s"),
        (ParameterSlot("f", None, time=-1, hertz=True), "Hz"),
        (ParameterSlot("A", None, time=-1), "1/s"),
        (ParameterSlot("depth", None), ""),
    ],
)
def test_units_follow_from_those_of_the_signals(slot, unit):
    assert slot.unit(["m"], ["N"]) == unit


def test_a_missing_unit_leaves_none():
    assert ParameterSlot("Kp", None, out=0, into=0).unit([""], ["N"]) == ""


def test_size_is_that_of_the_units():
    slot = ParameterSlot("Ki", None, time=-1, out=0, into=0)
    assert slot.size([0.5], [8.0], 4.0) == 4.0


@pytest.mark.parametrize("given", [-1.0, 0, float("nan"), "a", True, tunable("T", -1.0)])
def test_refuses_impossible_numbers(given):
    with pytest.raises(InvalidInputError, match=r"^Tf: got"):
        checked_slot(ParameterSlot(**{**vars(TIME), "given": given}))


def test_what_is_held():
    assert checked_slot(ParameterSlot(**{**vars(TIME), "given": 2})).held == 2.0
    assert ParameterSlot("Kp", tunable("k", 3.0, free=False)).held == 3.0
    assert ParameterSlot("Kp", tunable("k", 3.0)).held is None
