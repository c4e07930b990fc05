import numpy as np
import pytest

from robustpolish.robust.loop_model import LoopModel
from robustpolish.robust.real_parameters import ray_crossings
from tests.robust.loops import carts, damper


def test_damper():
    loop = LoopModel.of(damper())
    nearest = ray_crossings(loop)[0]
    assert nearest.size / loop.gain == pytest.approx(1)
    assert loop.omega(nearest.frequency) == pytest.approx(1)
    assert nearest.deltas[0] < 0


def test_every_crossing_is_one():
    loop = LoopModel.of(carts())
    found = ray_crossings(loop)
    assert len(found) >= 2
    for crossing in found:
        M = loop.response(loop.angle(crossing.frequency))[0]
        left = crossing.w - np.diag(crossing.deltas) @ M @ crossing.w
        assert np.linalg.norm(left) < 1e-4 * np.linalg.norm(crossing.w)
