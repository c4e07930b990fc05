"""PID: which numbers a kind has, and what does not make sense."""

import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError


@pytest.mark.parametrize(
    ("kind", "numbers", "states"),
    [("PID", "Kp Ki Kd Tf", 2), ("pi", "Kp Ki", 1), ("PD", "Kp Kd Tf", 1), ("P", "Kp", 0)],
)
def test_kinds_have_their_numbers(kind, numbers, states):
    (stage,) = rp.tunable.pid("x", kind=kind).stages
    assert [slot.name for slot in stage.slots] == numbers.split()
    assert len(stage.states) == states


@pytest.mark.parametrize(
    ("given", "argument"),
    [
        ({"kind": "PX"}, "kind"),
        ({"kind": 3}, "kind"),
        ({"kind": "P", "Ki": 1.0}, "Ki"),
        ({"kind": "PI", "Tf": 1.0}, "Tf"),
        ({"Tf": 0.0}, "Tf"),
        ({"Tf": rp.tunable.tunable("T", low=-2, high=-1)}, "Tf"),
        ({"Kp": "large"}, "Kp"),
        ({"kind": "PI", "Kp": 0, "Ki": 0}, "Kp"),
    ],
)
def test_refuses(given, argument):
    with pytest.raises(InvalidInputError, match=f"^{argument}: got"):
        rp.tunable.pid("x", **given)
