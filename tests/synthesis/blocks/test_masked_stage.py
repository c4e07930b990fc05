"""Free entries of a matrix: there and back."""

import numpy as np
import pytest

import robustpolish as rp


@pytest.mark.parametrize(
    "block",
    [
        rp.tunable.fixed_order(order=2, feedthrough=False),
        rp.tunable.static_gain(["a", "b", "c"], ["u", "v"], structure=[[1, 0, 1], [0, 1, 0]]),
    ],
)
def test_values_fill_the_free_entries_and_gradients_come_from_them(block):
    stage = block.stages[0].sized(3, 2)
    values = np.arange(1.0, 1.0 + stage.mask.sum())
    M = stage.matrix(values)
    assert (M[stage.mask] == values).all()
    assert not M[~stage.mask].any()
    assert (stage.back(values, M) == values).all()
