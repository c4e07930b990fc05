"""Factors of units, and factors that are none."""

import pytest

from robustpolish.identification.sanity import unit_of_change, unit_of_ratio


@pytest.mark.parametrize(
    ("ratio", "scatter", "words"),
    [
        (1e3, 2.0, "mm"), (600.0, 2.9, "mm"), (1e-6, 2.0, "um"), (57.3, 1.03, "degrees"),
        (9.81, 1.03, "g is"), (0.102, 1.01, "g read"),
    ],
)  # fmt: skip
def test_units_are_recognised(ratio, scatter, words):
    assert words in unit_of_ratio(ratio, scatter)


@pytest.mark.parametrize(
    ("ratio", "scatter"), [(1.0, 1.0), (30.0, 1.0), (9.81, 1.5), (57.3, 2.0), (1e2, 1.0), (3e4, 1)]
)
def test_other_factors_are_no_units(ratio, scatter):
    assert unit_of_ratio(ratio, scatter) == ""


@pytest.mark.parametrize(
    ("kind", "ratio", "words"),
    [
        ("stiffness", 1e6, "milliseconds taken for seconds"), ("mass", 1e-3, "g for kg"),
        ("damping", 1.2e3, "milliseconds"), ("gain", 57.3, "degrees"), ("stiffness", 1e3, "N/mm"),
    ],
)  # fmt: skip
def test_changes_are_recognised(kind, ratio, words):
    assert words in unit_of_change(kind, ratio)


def test_an_unknown_change_has_no_name():
    assert unit_of_change("stiffness", 1e9) == ""
    assert unit_of_change("width", 1e3) == ""
