"""Matrices of gains: sizes, structure, entries that are held or shared."""

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError


def test_entries_have_a_slot_each_where_the_structure_allows():
    (stage,) = rp.tunable.static_gain(["x", "v"], ["F", "M"], structure=[[1, 0], [1, 1]]).stages
    stage = stage.sized(2, 2)
    assert [slot.name for slot in stage.slots] == ["gain[0,0]", "gain[1,0]", "gain[1,1]"]
    assert (stage.matrix(np.array([1.0, 2.0, 3.0])) == [[1.0, 0.0], [2.0, 3.0]]).all()


def test_one_number_stands_for_all_entries():
    k = rp.tunable.tunable("k", 1.0)
    (stage,) = rp.tunable.static_gain(gain=k).stages
    assert [slot.given for slot in stage.sized(2, 1).slots] == [k, k]


@pytest.mark.parametrize(
    ("given", "argument"),
    [
        ({"structure": [[0, 0]]}, "structure"),
        ({"structure": [["a", "b"]]}, "structure"),
        ({"structure": [[1, 0, 1]]}, "structure"),
        ({"gain": [[1.0, None, None]]}, "gain"),
        ({"gain": [[0.0, 0.0]]}, "gain"),
        ({"gain": [["a", 1.0]]}, r"gain\[0,0\]"),
    ],
)
def test_refuses(given, argument):
    with pytest.raises(InvalidInputError, match=f"^{argument}: got"):
        rp.tunable.static_gain(["x", "v"], "F", **given).stages[0].sized(2, 1)
