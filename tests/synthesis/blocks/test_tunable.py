"""Tunable numbers: limits, names, values that are held."""

import math

import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.synthesis.structured.block_parts import Tunable, tunable


def test_knows_its_limits_as_floats():
    number = tunable("k", 1, low=0, high=2)
    assert number == Tunable("k", 1.0, 0.0, 2.0)
    assert str(number) == "k, from 1, between 0 and 2"
    assert str(tunable("k", 3, free=False)) == "k, held at 3"
    assert math.isinf(tunable("k").high)


@pytest.mark.parametrize(
    ("given", "argument"),
    [
        ({"name": ""}, "name"),
        ({"name": 3}, "name"),
        ({"name": "k", "low": 2, "high": 1}, "low"),
        ({"name": "k", "low": math.nan}, "low"),
        ({"name": "k", "value": 3, "high": 1}, "value"),
        ({"name": "k", "value": math.inf}, "value"),
        ({"name": "k", "value": "much"}, "value"),
        ({"name": "k", "free": False}, "value"),
        ({"name": "k", "free": 1}, "free"),
    ],
)
def test_refuses_what_contradicts(given, argument):
    with pytest.raises(InvalidInputError, match=f"^{argument}: got"):
        tunable(**given)
