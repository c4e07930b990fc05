"""Notches: limits of depth and width."""

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError


@pytest.mark.parametrize(
    ("given", "argument"),
    [({"depth": 1.5}, "depth"), ({"depth": -0.1}, "depth"), ({"width": 0}, "width")],
)
def test_refuses(given, argument):
    with pytest.raises(InvalidInputError, match=f"^{argument}: got"):
        rp.tunable.notch("x", **given)


def test_depth_one_is_no_notch():
    (stage,) = rp.tunable.notch("x").stages
    M = stage.matrix(np.array([3.0, 1.0, 0.5]))
    assert (M[2] == [0.0, 0.0, 1.0]).all()
