"""Blocks: series, signs, names of signals."""

import control
import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError


def test_series_take_names_from_either_and_multiply_signs():
    block = rp.low_pass(control="F", sign=-1) * rp.notch() * rp.pid("x", sign=-1)
    assert (block.measurements, block.controls, block.sign) == (("x",), ("F",), 1)
    assert [stage.kind for stage in block.stages] == ["pid", "notch", "low_pass"]
    assert (-block).sign == -1


def test_series_with_numbers_and_filters():
    block = 2.0 * rp.pid("x", kind="P") * control.tf([1.0], [1.0, 1.0])
    assert repr(block) == "block: u = 2 * Kp * a given filter of order 1 x"


@pytest.mark.parametrize(
    ("make", "argument"),
    [
        (lambda: rp.pid("x") * rp.pid("v"), "measurement"),
        (lambda: rp.pid("x", "F") * rp.notch(control="M"), "control"),
        (lambda: rp.pid("x", sign=2), "sign"),
        (lambda: rp.pid("x", sign=True), "sign"),
        (lambda: rp.pid(3), "measurement"),
        (lambda: rp.static_gain([]), "measurement"),
        (lambda: rp.static_gain(["x", "x"]), "measurement"),
        (lambda: rp.pid("x", name=""), "name"),
        (lambda: rp.pid("x") * "notch", "blocks"),
    ],
)
def test_refuses(make, argument):
    with pytest.raises(InvalidInputError, match=f"^{argument}: got"):
        make()
