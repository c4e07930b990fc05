"""Units as engineers write them."""

import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.signals.headers import same_kind, to_si

CASES = [
    ("mm", 1e-3, "m"),
    ("um", 1e-6, "m"),
    ("µm", 1e-6, "m"),
    ("kN", 1e3, "N"),
    ("g", 9.80665, "m/s^2"),
    ("mg", 9.80665e-3, "m/s^2"),
    ("deg", np.pi / 180, "rad"),
    ("°", np.pi / 180, "rad"),
    ("rpm", 2 * np.pi / 60, "rad/s"),
    ("deg/s", np.pi / 180, "rad/s"),
    ("m/s2", 1.0, "m/s^2"),
    ("m/s²", 1.0, "m/s^2"),
    ("m/s^2", 1.0, "m/s^2"),
    ("mm/s", 1e-3, "m/s"),
    ("Nm", 1.0, "N m"),
    ("N·m", 1.0, "N m"),
    ("N m", 1.0, "N m"),
    ("kNm", 1e3, "N m"),
    ("ms", 1e-3, "s"),
    ("kHz", 1e3, "Hz"),
    ("mV", 1e-3, "V"),
    ("bar", 1e5, "Pa"),
    ("lbf", 4.4482216152605, "N"),
    ("inch", 0.0254, "m"),
    ("microstrain", 1e-6, "1"),
    ("%", 0.01, "1"),
    ("-", 1.0, "1"),
    ("2.5 mm", 2.5e-3, "m"),
]


@pytest.mark.parametrize(("unit", "factor", "name"), CASES)
def test_conversion(unit, factor, name):
    values, found = to_si(np.array([0.0, 1.0, -2.0]), unit)
    assert found == name
    np.testing.assert_allclose(values, factor * np.array([0.0, 1.0, -2.0]), rtol=1e-12)


def test_temperature_has_an_offset():
    values, name = to_si(np.array([0.0, 20.0]), "degC")
    assert name == "K"
    np.testing.assert_allclose(values, [273.15, 293.15])


def test_no_unit_stays_unknown():
    values, name = to_si(np.array([3.0]), "")
    assert (values[0], name) == (3.0, "")


@pytest.mark.parametrize(
    "unit", ["furlongs per", "m/", "?", "0 mm", "][", "import os", "m**m", "é"]
)
def test_nonsense_is_refused(unit):
    with pytest.raises(InvalidInputError, match="unit"):
        to_si(np.array([1.0]), unit)


def test_same_kind():
    assert same_kind("N", "kN")
    assert same_kind("", "N")
    assert not same_kind("N", "m")
    assert not same_kind("rad", "m")
    assert not same_kind("N m", "N")
