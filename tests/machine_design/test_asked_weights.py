"""Weights as they are written: the same systems as those of the library, slips named."""

from typing import Any

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.app.design_task import asked_weight, is_weight


def test_the_forms_of_a_weight():
    table = {"low": 100.0, "crossover_hz": 2.0, "high": 0.5, "order": 2}
    given: Any = asked_weight(("performance",), table)
    own = rp.weight(100.0, 2.0, 0.5, 2)
    for s in (0.0, 3j, 100j):
        np.testing.assert_allclose(given(s), own(s))
        scaled: Any = asked_weight(("performance",), {**table, "gain": 2e-7})
        np.testing.assert_allclose(scaled(s), 2e-7 * own(s))
    assert asked_weight(("effort",), 3) == 3.0
    lead: Any = asked_weight(("effort",), {"numerator": [2, 0], "denominator": [1, 5]})
    assert abs(lead(1e9j)) == pytest.approx(2)
    system = control.tf([1.0], [1.0, 1.0])
    again: Any = asked_weight(("effort",), system)
    assert again(0) == pytest.approx(1)


def test_a_table_by_names_is_no_weight():
    assert is_weight(2.0)
    assert is_weight({"low": 1, "crossover": 2})
    assert not is_weight({"x": {"low": 1, "crossover_hz": 2, "high": 3}})
    assert not is_weight({"x": 2.0, "y": 3.0})


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"low": 10, "crossover": 1, "high": 0.1}, r"weights\.effort\.crossover.*crossover_hz"),
        ({"low": 10, "high": 0.1}, "no crossover_hz"),
        ({"low": 10, "crossover_hz": 1, "high": 2}, r"weights\.effort\.low.*above and one below 1"),
        ({"low": 0.1, "crossover_hz": 1, "high": float("inf")}, "infinite gain at high"),
        ({"low": 10, "crossover_hz": 1, "high": 0.1, "order": 1.5}, "order"),
        ({"numerator": [1, 0, 0], "denominator": [1, 1]}, "improper"),
        ({"numerator": [1, 0], "denominator": [0, 0]}, "denominator of zeros"),
        ({"numerator": [1, 0]}, "no denominator"),
        ({"numerator": 1, "denominator": [1]}, "list of numbers"),
        ("high", "a number or a table"),
        (True, "a number or a table"),
        (-1, "above 0"),
    ],
)
def test_slips(given, says):
    with pytest.raises(rp.InvalidInputError, match=says):
        asked_weight(("weights", "effort"), given)
