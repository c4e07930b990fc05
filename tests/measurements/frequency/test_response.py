"""The labelled array that frequency responses are."""

import numpy as np
import pytest
import xarray as xr

from robustpolish import InvalidInputError
from robustpolish.signals.frequency_response import checked_response, labelled_response

LINES = [1.0, 2.0, 3.0]


def test_one_pair_gets_its_dimensions_back():
    whole = labelled_response(
        LINES, np.ones((3, 2, 1)), ["x", "y"], ["F"], [["m/N"], ["rad/N"]],
        beside={"variance": np.full((3, 2, 1), 0.1)}, attributes={"averages": 5.0},
    )  # fmt: skip
    one = checked_response(whole.sel(output="y", input="F"))
    assert one.shape == (3, 1, 1)
    assert one["units"].item() == "rad/N"
    assert one["variance"].shape == (3, 1, 1)
    assert one.attrs["averages"] == 5.0


def test_frequencies_are_sorted_with_what_lies_beside():
    curve = np.array([3.0, 1, 2])
    array = labelled_response(
        curve, curve[:, None, None], ["x"], ["F"], beside={"coherence": curve[:, None, None] / 3}
    )
    sorted_ = checked_response(array)
    np.testing.assert_allclose(sorted_.values.ravel(), LINES)
    np.testing.assert_allclose(sorted_["coherence"].values.ravel(), np.array(LINES) / 3)


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (xr.DataArray(np.ones(3), {"frequency": LINES}, "frequency"), "without 'output'"),
        (labelled_response([-1, 0, 1], np.ones((3, 1, 1)), ["x"], ["F"]), "Hz from 0"),
        (labelled_response(LINES, np.full((3, 1, 1), np.inf), ["x"], ["F"]), "infinite"),
        (labelled_response(LINES, np.ones((3, 2, 1)), ["x", "x"], ["F"]), "each name once"),
    ],
)
def test_what_is_refused(array, message):
    with pytest.raises(InvalidInputError, match=message):
        checked_response(array)
