import numpy as np
import pytest

from robustpolish.robust.loop_model import LoopModel
from tests.robust.loops import carts


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
