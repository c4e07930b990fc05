"""Low-pass filters: orders and their numbers."""

import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError


@pytest.mark.parametrize(
    ("given", "argument"),
    [
        ({"order": 3}, "order"),
        ({"order": True}, "order"),
        ({"order": 1, "damping": 0.7}, "damping"),
        ({"damping": 0.01}, "damping"),
        ({"frequency_hz": 0}, "frequency_hz"),
    ],
)
def test_refuses(given, argument):
    with pytest.raises(InvalidInputError, match=f"^{argument}: got"):
        rp.tunable.low_pass("x", **given)


def test_states_follow_the_order():
    assert [rp.tunable.low_pass("x", order=n).stages[0].states for n in (1, 2)] == [
        ("filtered",),
        ("filtered", "rate"),
    ]
