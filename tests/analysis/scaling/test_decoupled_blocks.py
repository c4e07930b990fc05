"""Decoupled parts of a system."""

import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.linear.scaling import decoupled_blocks
from robustpolish.polishing.air_bearing import AirBearingParameters, air_bearing


def test_the_air_bearing_splits_into_its_axes():
    plant = air_bearing(AirBearingParameters.as_published())
    system = plant.open_loop
    blocks = decoupled_blocks(system.A, system.B, system.C, system.D)
    assert [len(block.states) for block in blocks] == [4, 4, 4]
    assert sorted(i for block in blocks for i in block.inputs) == list(range(system.ninputs))


def test_feedthrough_joins_and_leftovers_are_listed():
    A, B, C = np.diag([-1.0, -2.0]), np.eye(2), np.eye(2)
    assert len(decoupled_blocks(A, B, C)) == 2
    assert len(decoupled_blocks(A, B, C, [[0, 1], [0, 0]])) == 1
    blocks = decoupled_blocks(A, [[1, 0], [0, 0]], [[1, 0]])
    assert blocks[0].inputs == blocks[0].outputs == (0,)
    assert (blocks[1].states, blocks[1].inputs) == ((1,), ())
    assert blocks[2].inputs == (1,)


def test_a_tolerance_drops_weak_coupling():
    A = [[-1, 1e-9], [0, -2]]
    assert len(decoupled_blocks(A, np.eye(2), np.eye(2))) == 1
    assert len(decoupled_blocks(A, np.eye(2), np.eye(2), tolerance=1e-6)) == 2


def test_bad_input_is_refused():
    with pytest.raises(InvalidInputError, match=r"A: got shape \(2, 3\)"):
        decoupled_blocks(np.ones((2, 3)), np.ones((2, 1)), np.ones((1, 2)))
    with pytest.raises(InvalidInputError, match="tolerance"):
        decoupled_blocks(np.eye(1), np.eye(1), np.eye(1), tolerance=-1)
