import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.machines.effects.evaluate import shapes_along
from robustpolish.machines.effects.formula_language import dimension_text, dimensions, read_formula
from robustpolish.machines.effects.kind import Motion, Parameter
from robustpolish.machines.effects.user_defined import candidates, own_kind


def tried(text, given=None, **units):
    formula = read_formula(text, units)
    found = dimensions(formula, units, {})
    parameters = [Parameter(name, dimension_text(powers), "") for name, powers in found.items()]
    return candidates(formula, parameters, given or {})


def sizes(found):
    return {scan.parameter: scan.of for scan in found.scan}


@pytest.mark.parametrize(
    ("text", "units", "solved", "scanned"),
    [
        ("f = -k*q**5", {"k": "N/m^5"}, ("k",), {}),
        ("f = -k*q - c*v", {"k": "N/m", "c": "N s/m"}, ("k", "c"), {}),
        ("f = -F*tanh(v/w)", {"F": "N", "w": "m/s"}, ("F",), {"w": (0, 1)}),
        ("f = -k*max(abs(q) - g, 0)*sign(q)", {"g": "m", "k": "N/m"}, ("k",), {"g": (1, 0)}),
        ("f = -k*(q + b*q**3)", {"k": "N/m", "b": "1/m^2"}, ("k",), {"b": (-2, 0)}),
        ("f = -F*tanh(k*q/F)", {"F": "N", "k": "N/m"}, ("F",), {"k": (-1, 0)}),
        ("f = -F*tanh(c*v/F)", {"c": "N s/m", "F": "N"}, ("c",), {"F": (0, 1)}),
        ("f = -m*w**2*q", {"m": "kg", "w": "1/s"}, ("m",), {"w": (-1, 1)}),
    ],
)
def test_parameters_are_solved_for_or_scanned(text, units, solved, scanned):
    found = tried(text, **units)
    assert found.linear_in == solved
    assert sizes(found) == scanned
    assert not found.missing


def test_forces_that_grow_together_are_positive():
    assert tried("f = -F*tanh(k*q/F)", F="N", k="N/m").together == ("F", "k")
    assert tried("f = -k*q", k="N/m").together == ()


def test_values_that_were_given_are_tried():
    found = tried("f = -c*abs(v)**n*sign(v)", {"n": (0.5, 2.0)}, c="N", n="1")
    assert found.linear_in == ("c",)
    assert [(s.of, s.shares) for s in found.scan] == [("1", (0.5, 2.0))]
    both = tried("f = -F*tanh(k*q/F)", {"F": (1.0, 2.0), "k": (1e3,)}, F="N", k="N/m")
    assert both.linear_in == ()
    assert sizes(both) == {"F": "1", "k": "1"}


@pytest.mark.parametrize(
    ("text", "given", "units", "unknown"),
    [
        ("f = -c*abs(v)**n*sign(v)", None, {"c": "N", "n": "1"}, ("n",)),
        ("f = -q/c", None, {"c": "m/N"}, ()),
        ("f = -k*q - 2*q**3", None, {"k": "N/m"}, ()),
        ("f = -3*k**2*q", None, {"k": "1"}, ()),
        ("f = -F*tanh(k*q/F)", {"F": (1.0,)}, {"F": "N", "k": "N/m"}, ()),
    ],
)
def test_what_cannot_be_tried_says_why(text, given, units, unknown):
    found = tried(text, given, **units)
    assert found.missing
    assert found.remedy
    assert found.unknown == unknown
    assert not found.linear_in
    assert not found.scan


def test_a_law_without_parameters_is_no_candidate():
    found = tried("f = -3*q**3")
    assert (found.linear_in, found.scan, found.missing) == ((), (), "")


def test_too_many_values_are_refused():
    units = {"k": "N", "a": "1", "b": "1"}
    given = {"a": tuple(range(20)), "b": tuple(range(20))}
    with pytest.raises(InvalidInputError, match="400 combinations"):
        tried("f = -k*sin(a*tanh(b*sign(q)))", given, **units)


def test_the_true_force_is_among_the_shapes():
    """With the knee among the values that are tried, the coefficients give the law back."""
    time = np.linspace(0.0, 1.0, 2001)
    q = 0.8 * np.sin(2 * np.pi * 3 * time)
    motion = Motion(time, q[None], np.gradient(q, time)[None])
    kind = own_kind({"formula": "f = -F*tanh(k*q/F)", "units": {"F": "N", "k": "N/m"}})
    shapes = shapes_along(kind, motion)
    assert len(shapes) == 4
    for shape in shapes:
        values = shape.values(np.array([2.5]))
        force = -values["F"] * np.tanh(values["k"] * q / values["F"])
        np.testing.assert_allclose(2.5 * shape.columns[0, 0], force, rtol=1e-10, atol=1e-12)
        assert shape.signs == (1,)
