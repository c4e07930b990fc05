import math

import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.machines.effects.formula_language import EffectSpecification, specification_from

WHOLE = {
    "formula": "f = -F*tanh(v/w)",
    "units": {"F": "N", "w": "m/s"},
    "name": "rim",
    "title": "Friction at the rim",
    "domain": "dof",
    "bounds": {"F": [0.0, math.inf], "w": [1e-4, 1.0]},
    "scan": {"w": [1e-3, 1e-2]},
    "known": {"F": 2.0},
}


def test_a_table_comes_back():
    written = specification_from(WHOLE)
    assert written.table() == WHOLE
    assert specification_from(written.table()) == written
    assert hash(written) == hash(specification_from(WHOLE))


def test_what_says_nothing_is_left_out():
    written = specification_from(
        {"formula": "f = -q", "domain": "pair", "bounds": {}, "name": None}
    )
    assert written == EffectSpecification("f = -q")
    assert written.table() == {"formula": "f = -q"}


def test_limits_may_be_open():
    table = {**WHOLE, "bounds": {"F": (0, None), "w": (None, "inf")}}
    assert specification_from(table).bounds == (("F", 0.0, math.inf), ("w", -math.inf, math.inf))


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"units": "N"}, ("units",)),
        ({"units": {"F": "N"}}, ("formula", "w")),
        ({"name": ""}, ("name",)),
        ({"name": 3}, ("name",)),
        ({"title": "x" * 100}, ("title",)),
        ({"domain": "axes"}, ("domain",)),
        ({"bounds": [0, 1]}, ("bounds",)),
        ({"bounds": {"x": [0, 1]}}, ("bounds", "x")),
        ({"bounds": {"F": [1, 0]}}, ("bounds", "F")),
        ({"bounds": {"F": [0]}}, ("bounds", "F")),
        ({"bounds": {"F": [math.nan, 1]}}, ("bounds", "F")),
        ({"bounds": {"F": 3}}, ("bounds", "F")),
        ({"scan": {"w": []}}, ("scan", "w")),
        ({"scan": {"w": [math.inf]}}, ("scan", "w")),
        ({"scan": {"w": ["1"]}}, ("scan", "w")),
        ({"scan": {"w": [10**400]}}, ("scan", "w")),
        ({"scan": {"w": 0.1}}, ("scan", "w")),
        ({"scan": {"x": [1.0]}}, ("scan", "x")),
        ({"known": {"x": 1.0}}, ("known", "x")),
        ({"known": {"w": 1.0}}, ("known", "w")),
        ({"known": {"F": "1"}}, ("known", "F")),
        ({"channels": {"F": "V"}}, ("channels", "F")),
    ],
)
def test_errors_say_where(change, key):
    with pytest.raises(InvalidInputError) as caught:
        specification_from({**WHOLE, **change})
    assert caught.value.key == key


def test_so_many_parameters_no_record_determines():
    units = {f"k{i}": "N/m" for i in range(11)}
    formula = "f = " + " - ".join(f"{name}*q" for name in units)
    with pytest.raises(InvalidInputError, match="at most 10"):
        specification_from({"formula": formula, "units": units})
