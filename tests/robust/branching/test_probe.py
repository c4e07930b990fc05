import numpy as np
import pytest

from robustpolish.robust.branch_and_bound import local_witness, worst_signals
from robustpolish.robust.loop_model import LoopModel
from tests.robust.loops import carts, servo


def test_nearby():
    loop = LoopModel.of(carts())
    found = local_witness(loop, -3 * loop.gain * np.ones(3), 575 / loop.time, (False,) * 3)
    assert found.size / loop.gain < 2.9


def test_worst_signals_with_a_block_beside_the_numbers():
    loop = LoopModel.of(servo())
    M = loop.response(loop.angle(4.9 / loop.time))[0]
    w = worst_signals(loop.structure, M, np.array([0.3]))
    z = M @ w
    assert w[0] == pytest.approx(0.3 * z[0])


def test_worst_signals_of_numbers_alone():
    loop = LoopModel.of(carts())
    M = loop.response(0.4)[0]
    numbers = np.array([0.1, -0.2, 0.3])
    w = worst_signals(loop.structure, M, numbers)
    left = np.linalg.norm(w - numbers * (M @ w))
    assert left == pytest.approx(np.linalg.svd(np.eye(3) - numbers[:, None] * M)[1][-1])
