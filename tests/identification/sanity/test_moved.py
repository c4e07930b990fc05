"""Numbers that a fit moved."""

import pytest

from robustpolish.identification.sanity import implausible_changes

BEFORE = {
    "dof.x.mass": 2.0, "spring[0].stiffness": 800.0, "damper[0].damping": 1.0,
    "input.F.gain": 1.0, "effect[0].stiffness": 1.0, "damper[1].damping": 0.0,
}  # fmt: skip


@pytest.mark.parametrize(
    "after",
    [
        {}, {"dof.x.mass": 3.0}, {"spring[0].stiffness": 8000.0}, {"damper[0].damping": 40.0},
        {"effect[0].stiffness": 1e9}, {"damper[1].damping": 5.0}, {"damper[0].damping": 0.0},
    ],
)  # fmt: skip
def test_what_a_fit_may_do(after):
    assert implausible_changes(BEFORE, {**BEFORE, **after}) == []


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("spring[0].stiffness", 8e8, "from 800 to 8e+08, by 6.0 decades, as milliseconds taken"),
        ("dof.x.mass", 2e-3, "by 3.0 decades, as g for kg"),
        ("damper[0].damping", 900.0, "milliseconds"),
        ("spring[0].stiffness", 8e11, "by 9.0 decades. Check the units"),
        ("input.F.gain", -1.0, "turned the sign of input.F.gain, from 1 to -1"),
    ],
)
def test_what_looks_like_a_unit_or_a_sign(key, value, words):
    (found,) = implausible_changes(BEFORE, {**BEFORE, key: value})
    assert key in found
    assert words in found
