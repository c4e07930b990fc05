import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.machines.effects.formula_language import (
    channel_unit,
    dimension_text,
    dimensions,
    read_formula,
    read_unit,
    unit_text,
)
from robustpolish.machines.effects.kind import Parameter


@pytest.mark.parametrize(
    ("text", "powers"),
    [
        ("N/m^5", {"N": 1, "m": -5}),
        ("N s/m", {"N": 1, "s": 1, "m": -1}),
        ("N*s**2/m**2", {"N": 1, "s": 2, "m": -2}),
        ("N/(m/s)^2", {"N": 1, "m": -2, "s": 2}),
        ("N/m^1.5", {"N": 1, "m": -1.5}),
        ("1/s", {"s": -1}),
        ("1", {}),
        (" kg m^2 ", {"kg": 1, "m": 2}),
        ("N·m/rad", {"N": 1, "m": 1, "rad": -1}),
        ("Hz", {"Hz": 1}),
        ("N m^-5", {"N": 1, "m": -5}),
    ],
)
def test_units_are_read(text, powers):
    assert read_unit(text, ("units", "k")) == powers


@pytest.mark.parametrize(
    "text",
    ["", " ", "N/", "/m", "N/mm", "kN", "N/m s", "N^", "N^^2", "(N", "N)", "N/m^5^2", "5", "N--", 3,
     None, "N/m^1e5", "N" * 200, "(" * 30 + "N" + ")" * 30, "N\nm;", "V"],
)  # fmt: skip
def test_what_is_no_unit_is_refused(text):
    with pytest.raises(InvalidInputError, match="SI unit") as caught:
        read_unit(text, ("units", "k"))
    assert caught.value.key == ("units", "k")


def test_further_units_are_known_where_they_are_named():
    assert read_unit("N s/(m V)", ("units", "c"), ["V"]) == {"N": 1, "s": 1, "m": -1, "V": -1}
    assert channel_unit("V", ("channels", "u")) == "V"
    assert channel_unit("m/s", ("channels", "u")) == "m/s"
    for bad in ("T", "5 V", "", None):
        with pytest.raises(InvalidInputError):
            channel_unit(bad, ("channels", "u"))


def found(text, channels=None, **units):
    formula = read_formula(text, [*units, *(channels or {})])
    return {n: dimension_text(p) for n, p in dimensions(formula, units, channels or {}).items()}


@pytest.mark.parametrize(
    ("text", "units", "wanted"),
    [
        ("f = -k*q**5", {"k": "N/m^5"}, {"k": "F/L^5"}),
        ("f = -c*abs(v)*v", {"c": "N s^2/m^2"}, {"c": "F*T^2/L^2"}),
        ("f = -F*tanh(v/w)", {"F": "N", "w": "m/s"}, {"F": "F", "w": "L/T"}),
        ("f = -F*tanh(v/w)", {"F": "N m", "w": "rad/s"}, {"F": "F", "w": "L/T"}),
        ("f = -k*sin(q)", {"k": "N m"}, {"k": "F"}),
        ("f = -k*q", {"k": "N m/rad"}, {"k": "F/L"}),
        ("f = -m*g*l*sin(q)", {"m": "kg", "g": "m/s^2", "l": "m"},
         {"m": "kg", "g": "m/s^2", "l": "m"}),
        ("f = -m*g*q/l", {"m": "kg", "g": "m/s^2", "l": "m"}, {"m": "M", "g": "L/T^2", "l": "L"}),
        ("f = F*sin(2*pi*n*t + p)", {"F": "N", "n": "Hz", "p": "rad"},
         {"F": "F", "n": "1/T", "p": "1"}),
        ("f = -F*tanh(50*q)", {"F": "N"}, {"F": "F"}),
        ("f = -c*abs(v)**n*sign(v)", {"c": "N", "n": "1"}, {"c": "F", "n": "1"}),
        ("f = -k*max(q, 0)**1.5", {"k": "N/m^1.5"}, {"k": "F/L^1.5"}),
    ],
)  # fmt: skip
def test_dimensions_are_those_that_make_a_force(text, units, wanted):
    assert found(text, **units) == wanted


def test_of_a_length_there_is_no_sine():
    with pytest.raises(InvalidInputError, match="sin is taken of something in m"):
        found("f = -k*sin(q)", k="N")


def test_a_channel_brings_its_unit():
    units = {"a": "N s/m", "b": "N s/(m V)"}
    wanted = {"a": "F*T/L", "b": "F*T/L/V"}
    assert found("f = -(a + b*u)*v", {"u": "V"}, **units) == wanted
    with pytest.raises(InvalidInputError, match=r"\+ joins"):
        found("f = -(a + b*u)*v", {"u": "V"}, a="N s/m", b="N s/m")


@pytest.mark.parametrize(
    ("text", "units", "why"),
    [
        ("f = -k*q**5", {"k": "N/m^3"}, "f comes out in N m^2"),
        ("f = -k*q - c*v", {"k": "N/m", "c": "N/m"}, "joins N and N/s"),
        ("f = -k*(q + v)", {"k": "N/m"}, "joins m and m/s"),
        ("f = -F*tanh(v)", {"F": "N"}, "tanh is taken of something in m/s"),
        ("f = -k*q", {"k": "N/rad"}, "f comes out in N,"),
        ("f = -k*sin(v)", {"k": "N m/rad"}, "sin is taken of something in 1/s"),
    ],
)
def test_wrong_units_are_told(text, units, why):
    with pytest.raises(InvalidInputError, match="Check the units") as caught:
        found(text, **units)
    assert why in str(caught.value)


@pytest.mark.parametrize("text", ["N/m^5", "N s/m", "kg", "m/s", "N/m^1.5", "1/s", "N s^2/m^2"])
def test_units_come_back_from_dimensions(text):
    letters = {"N": "F", "m": "L", "s": "T", "kg": "M"}
    powers = {letters[unit]: power for unit, power in read_unit(text, ()).items()}
    parameter = Parameter("k", dimension_text(powers), "")
    assert parameter.unit() == text == unit_text(powers)
    assert {letter: power for letter, power in parameter.powers.items() if power} == powers
