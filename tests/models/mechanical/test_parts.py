"""Each part of a model, checked when it is made."""

import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.machines.mechanical.parts import (
    Dof,
    Input,
    Output,
    imposed_by,
    number,
    places,
    text,
)

GROUND = ("x", "ground")


def test_a_mass_or_an_inertia():
    assert (Dof("x", 2).mass, Dof("x", 2).unit, Dof("x", 2).key) == (
        2.0,
        "kg",
        ("dof", "x", "mass"),
    )
    turning = Dof("phi", 0.0, rotational=True)
    assert (turning.unit, turning.key) == ("kg m^2", ("dof", "phi", "inertia"))


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda: Dof("ground", 1.0), "a name other than 'ground'"),
        (lambda: Dof("a.b", 1.0), "dof: got 'a.b', expected a name without a dot"),
        (lambda: Input(" ", GROUND), "input: got ' ', expected a name"),
        (lambda: Input("F", GROUND, gain=0.0), r"input\.F\.gain: got 0.0, expected a number other"),
        (lambda: Input("F", GROUND, unit=""), r"input\.F\.unit: got '', expected a unit"),
        (lambda: Output("x", GROUND, unit=3), r"output\.x\.unit: got 3, expected a unit"),
    ],
)
def test_bad_parts_are_named(make, told):
    with pytest.raises(InvalidInputError, match=told):
        make()


@pytest.mark.parametrize("value", ["3", True, None, np.nan, np.inf, 1e100, 1e-101, 1j])
def test_what_is_no_number_of_a_machine(value):
    with pytest.raises(InvalidInputError, match="k: got"):
        number("k", value)


def test_numbers_and_names():
    assert number("k", np.int64(3)) == 3.0
    assert number("k", -1e99) == -1e99
    assert text("name", "x") == "x"


def test_places():
    assert places(("spring", 0, "between"), "x") == ("x",)
    assert places(("spring", 0, "between"), ["x", "ground"]) == GROUND
    for bad in ([], ["a", "b", "c"], 3, {"x"}):
        with pytest.raises(InvalidInputError, match=r"spring\[0\]\.between: .* a pair of names"):
            places(("spring", 0, "between"), bad)
    with pytest.raises(InvalidInputError, match="'x' twice"):
        places(("spring", 0, "between"), ["x", "x"])


def test_inputs_impose_motions():
    inputs = [Input("F", ("a", "ground")), Input("b", ("b", "ground"), "displacement")]
    assert imposed_by(inputs) == {"b"}
