import numpy as np
import pytest

from robustpolish.linear.arithmetic.balls import midpoint
from robustpolish.robust.loop_model import DeltaBlock, LoopModel
from tests.robust.loops import carts, column, in_other_units, random_loop


def test_response_and_slope():
    loop = LoopModel.of(carts())
    M, slope = loop.response(0.4)
    near = (loop.response(0.4 + 1e-6)[0] - loop.response(0.4 - 1e-6)[0]) / 2e-6
    np.testing.assert_allclose(slope, near, rtol=1e-4, atol=1e-6 * np.abs(slope).max())
    assert M.shape == (3, 3)


def test_frequencies_and_angles():
    loop = LoopModel.of(carts())
    assert loop.frequency(loop.angle(3.0)) == pytest.approx(3.0)
    assert loop.frequency(-loop.angle(3.0)) == pytest.approx(3.0)
    assert loop.angle(np.inf) == pytest.approx(np.pi / 2)
    assert loop.omega(1.0) == loop.time


@pytest.mark.parametrize("seed", [1, 4, 8])
def test_units_of_a_loop_follow_from_itself(seed):
    loop = random_loop(seed)
    other, time = in_other_units(loop, seed)
    one, two = LoopModel.of(loop), LoopModel.of(other)
    assert two.gain == one.gain
    assert two.time * time == pytest.approx(one.time, rel=1e-12)
    for first, second in zip(one.balls, two.balls, strict=True):
        np.testing.assert_allclose(midpoint(second), midpoint(first), rtol=1e-9, atol=1e-12)


def test_outputs_in_a_unit():
    loop = LoopModel.of(column(), DeltaBlock("full", 1, 2, 2, "performance"))
    scaled = loop.in_unit_of_gain(3.0)
    M = loop.gain * loop.response(0.4)[0]
    M[loop.structure.inputs[-1]] /= 3
    np.testing.assert_allclose(scaled.response(0.4)[0], M, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(midpoint(scaled.balls[2]), scaled.model.C, rtol=1e-12)
