"""Lead and lag: numbers that do not make sense."""

import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError


@pytest.mark.parametrize(
    ("given", "argument"), [({"gain": 0}, "gain"), ({"zero_hz": -1.0}, "zero_hz")]
)
def test_refuses(given, argument):
    with pytest.raises(InvalidInputError, match=f"^{argument}: got"):
        rp.tunable.lead_lag("x", **given)


def test_gain_has_units_and_corners_are_in_hertz():
    (stage,) = rp.tunable.lead_lag("x").stages
    assert [slot.unit(["m"], ["N"]) for slot in stage.slots] == ["N/m", "Hz", "Hz"]
