import numpy as np

from robustpolish.robust.bounds import _settled, bounds
from robustpolish.robust.loop_model import LoopModel
from tests.robust.loops import carts, random_loop, servo


def test_both_bounds_meet():
    found = bounds(LoopModel.of(servo()))
    assert found.coverage.complete
    assert 1 <= found.coverage.level * found.witness.size <= 1.002


def test_a_witness_is_as_small_as_any_near_it():
    # searches that begin at the witness find nothing smaller
    loop = LoopModel.of(random_loop(42))
    found = bounds(loop)
    again = _settled(loop, None, found)
    assert again.witness.size >= found.witness.size * (1 - 1e-8)


def test_real_numbers_are_branched_over():
    found = bounds(LoopModel.of(carts()), gap=1e-4)
    assert found.coverage.complete
    assert found.coverage.intervals == ((0.0, np.inf),)
    assert found.gap <= 1e-4
