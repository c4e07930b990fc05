"""Prefixes follow the size, and stand before units that bear them only."""

import math

import pytest
from matplotlib.ticker import EngFormatter

from robustpolish.base.results import bears_prefix, prefix_power, prefixed


@pytest.mark.parametrize(
    ("size", "unit"),
    [(2.1e-5, "µm"), (999.0, "m"), (1000.0, "km"), (3.0, "m"), (0.5, "mm"), (0.0, "m"),
     (math.inf, "m"), (1e-40, "qm"), (1e40, "Qm")],
)  # fmt: skip
def test_the_prefix_suits_the_size(size, unit):
    assert prefixed("m", prefix_power(size)) == unit


def test_prefixes_are_those_of_matplotlib():
    for power, letter in EngFormatter.ENG_PREFIXES.items():
        assert prefixed("", power) == letter


def test_powers_and_units_with_a_prefix_bear_none():
    bear = ("m", "N/m", "N m", "Nm", "V", "Ω", "rad/s", "m/s^2", "N*s/m")
    none = ("", "1", "%", "1/s", "m^2", "m**2", "kg", "mm", "mm/s", "kN", "ms", "deg", "min", "rpm")
    assert [unit for unit in bear if not bears_prefix(unit)] == []
    assert [unit for unit in none if bears_prefix(unit)] == []
