"""Given filters in a series: their response, in any unit of time."""

import control
import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.synthesis.structured.block_parts import GivenFilter


def test_another_unit_of_time_moves_its_frequencies():
    system = control.tf([1.0, 300.0], [1.0, 5.0, 900.0])
    A, B, C, D = (
        (M := GivenFilter.of(system).in_unit_of_time(0.125).matrix(np.zeros(0)))[:2, :2],
        M[:2, 2:],
        M[2:, :2],
        M[2:, 2:],
    )
    s = 2.0j
    there = C @ np.linalg.solve(s * np.eye(2) - A, B) + D
    assert there.item() == pytest.approx(system(s / 0.125))


def test_a_number_is_a_filter():
    stage = GivenFilter.of(3.0)
    assert stage.states == ()
    assert stage.matrix(np.zeros(0)).item() == 3.0
    assert stage.formula == "3"
    assert stage.back(np.zeros(0), np.ones((1, 1))).size == 0


@pytest.mark.parametrize("given", ["x", control.tf([1.0], [1.0, 0.5], 0.1), np.eye(2)])
def test_refuses_others(given):
    with pytest.raises(InvalidInputError, match=r"^blocks: got"):
        GivenFilter.of(given)
