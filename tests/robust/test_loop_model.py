import numpy as np
import pytest

from robustpolish.robust.loop_model import LoopModel
from tests.robust.loops import carts, in_other_units, random_loop


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
def test_units_of_signals_are_chosen_alike(seed):
    loop = random_loop(seed)
    other, time = in_other_units(loop, seed)
    one, two = LoopModel.of(loop), LoopModel.of(other)
    first, second = one.response(one.angle(0.7))[0], two.response(two.angle(0.7 * one.time
        / time / two.time))[0]  # fmt: skip
    # powers of two are not the powers of ten that the units were changed by
    sizes = np.abs(first) * one.gain, np.abs(second) * two.gain
    used = sizes[0] > 1e-9 * sizes[0].max()
    assert (sizes[0] / sizes[1])[used].max() < 32
    assert (sizes[1] / sizes[0])[used].max() < 32
