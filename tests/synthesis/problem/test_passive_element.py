"""A spring or a damper says what it is, and counts as equal if its numbers are."""

import dataclasses

import pytest

import robustpolish as rp
from robustpolish.synthesis.problem.pole_regions import PassiveElement


@pytest.mark.parametrize(
    ("element", "text"),
    [
        (PassiveElement("spring", ("x", "ground"), 8e4, "N/m"), "x and ground: 80000 N/m"),
        (PassiveElement("damper", ("x", "y"), 1 / 3, "N s/m"), "x and y: 0.333333 N s/m"),
        (PassiveElement("spring", ("p", "q"), 1.5e9, "N m/rad"), "p and q: 1.5e+09 N m/rad"),
    ],
)
def test_an_element_in_words(element, text):
    assert str(element) == f"{element.kind} between {text}"


def test_elements_are_compared_by_value_and_do_not_change():
    one, other = (rp.results.PassiveElement("damper", ("x", "y"), 5.0, "N s/m") for _ in range(2))
    assert one == other
    assert one != dataclasses.replace(one, coefficient=6.0)
    assert len({one, other}) == 1
    with pytest.raises(dataclasses.FrozenInstanceError):
        one.coefficient = 6.0  # pyright: ignore[reportAttributeAccessIssue]
