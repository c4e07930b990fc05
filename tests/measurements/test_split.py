"""Contiguous blocks of a record."""

import numpy as np
import pytest
import xarray as xr

from robustpolish.errors import InvalidInputError
from robustpolish.signals.filtering import split_blocks

DATA = xr.Dataset({"x": ("time", np.arange(100.0))}, {"time": np.arange(100) * 0.01})


def test_blocks_are_contiguous_and_complete():
    blocks = split_blocks(DATA, 7)
    np.testing.assert_array_equal(np.concatenate([b["x"] for b in blocks]), DATA["x"])
    assert all(np.all(np.diff(b["x"]) == 1) for b in blocks)


def test_shares_may_leave_a_rest():
    first, second = split_blocks(DATA, (0.5, 0.2))
    assert (first.sizes["time"], second.sizes["time"]) == (50, 20)
    assert float(second["time"][0]) == 0.5


@pytest.mark.parametrize("parts", [0, 60, (0.9, 0.2), (-0.1, 0.5), (), "ab", None, (0.001,), True])
def test_bad_parts_are_refused(parts):
    with pytest.raises(InvalidInputError, match="parts"):
        split_blocks(DATA, parts)
