"""Blocks: series, signs, names of signals."""

import control
import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError


def test_series_take_names_from_either_and_multiply_signs():
    block = (
        rp.tunable.low_pass(control="F", sign=-1)
        * rp.tunable.notch()
        * rp.tunable.pid("x", sign=-1)
    )
    assert (block.measurements, block.controls, block.sign) == (("x",), ("F",), 1)
    assert [stage.kind for stage in block.stages] == ["pid", "notch", "low_pass"]
    assert (-block).sign == -1


def test_series_with_numbers_and_filters():
    block = 2.0 * rp.tunable.pid("x", kind="P") * control.tf([1.0], [1.0, 1.0])
    assert repr(block) == "block: u = 2 * Kp * a given filter of order 1 x"


@pytest.mark.parametrize(
    ("make", "argument"),
    [
        (lambda: rp.tunable.pid("x") * rp.tunable.pid("v"), "measurement"),
        (lambda: rp.tunable.pid("x", "F") * rp.tunable.notch(control="M"), "control"),
        (lambda: rp.tunable.pid("x", sign=2), "sign"),
        (lambda: rp.tunable.pid("x", sign=True), "sign"),
        (lambda: rp.tunable.pid(3), "measurement"),
        (lambda: rp.tunable.static_gain([]), "measurement"),
        (lambda: rp.tunable.static_gain(["x", "x"]), "measurement"),
        (lambda: rp.tunable.pid("x", name=""), "name"),
        (lambda: rp.tunable.pid("x") * "notch", "blocks"),
    ],
)
def test_refuses(make, argument):
    with pytest.raises(InvalidInputError, match=f"^{argument}: got"):
        make()
