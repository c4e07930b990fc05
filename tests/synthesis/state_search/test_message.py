"""What a state feedback says: norm, gain, bound, and what to try next."""

import pytest

from robustpolish.synthesis.state_feedback.search import message

PLAIN = {
    "status": "suboptimal",
    "achieved": 0.75,
    "lower_bound": 0.0,
    "gain": 12.5,
    "tolerance": 1e-4,
    "gain_bound": None,
    "has_region": False,
    "exhausted": False,
    "history": (),
}


def said(**changes):
    return message(**(PLAIN | changes))


def test_norm_gain_and_bound_are_told():
    text = said(status="optimal", lower_bound=0.7499)
    assert text.startswith("Norm 0.75 with a gain of 12.5")
    assert "No state feedback has a norm below 0.7499." in text
    assert "within 1e-04 of it: the design is optimal" in text
    assert "No state feedback" not in said()


@pytest.mark.parametrize(
    ("changes", "advice"),
    [
        ({"status": "time_limit", "gain_bound": 3.0}, "Raise time_limit"),
        ({"exhausted": True, "gain_bound": 3.0}, "ended with its work"),
        ({"gain_bound": 3.0, "has_region": True}, "The bound 3 on the gain is kept"),
        ({"has_region": True}, "The poles lie in the region"),
        ({}, "set control_weight"),
    ],
)
def test_what_matters_most_is_said_and_nothing_else(changes, advice):
    text = said(**changes)
    assert advice in text
    endings = ["Raise time_limit", "ended with its work", "is kept", "lie in the region"]
    assert sum(ending in text for ending in endings) == sum(e in advice for e in endings)


def test_a_limit_of_gains_is_shown_with_the_trade_off_of_the_first_part():
    history = [
        {"part": 0, "price": 1.0, "achieved": 0.5, "gain": 1.0},
        {"part": 1, "price": 1.0, "achieved": 0.4, "gain": 2.0},
        {"part": 0, "step": "bisection on gamma", "achieved": 0.3},
        {"part": 0, "price": 0.1, "achieved": 0.02, "gain": 40.0},
    ]
    text = said(status="infimum_not_attained", history=history)
    assert "(norm at gain of the first part: 0.5 at 1, 0.02 at 40)" in text
    assert "trade" not in text
    assert "first part" not in said(status="infimum_not_attained")
    for way_out in ("control_weight", "gain_bound", "pole_region"):
        assert way_out in text
