import numpy as np
import pytest

from robustpolish.robust.loop_model import LoopModel
from robustpolish.robust.search import bounds
from tests.robust.loops import carts, column, servo


def test_both_bounds_meet():
    found = bounds(LoopModel.of(servo()))
    assert found.coverage.complete
    assert 1 <= found.coverage.level * found.witness.size <= 1.002


def test_bounds_are_told_a_few_distances_apart():
    found = bounds(LoopModel.of(column()))
    assert found.gap == pytest.approx(1.04e-3)
    assert bounds(LoopModel.of(column()), gap=1e-9).gap == pytest.approx(1.04e-3)


def test_real_numbers_are_branched_over():
    found = bounds(LoopModel.of(carts()), gap=1e-4)
    assert found.coverage.complete
    assert found.coverage.intervals == ((0.0, np.inf),)
    assert found.gap <= 1e-4
