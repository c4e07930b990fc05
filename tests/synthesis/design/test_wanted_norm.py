"""What gamma asks for: numbers, ranges, and what is neither."""

import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.synthesis.certificate import (
    ANY_NORM,
    NormTarget,
    norm_in_words,
    unreachable_norm_error,
)


@pytest.mark.parametrize(
    ("gamma", "enough", "below"),
    [
        (2, 2.0, 2.0),
        (np.float64(2.5), 2.5, 2.5),
        ([1.5], 1.5, 1.5),
        ((0, 3), 0.0, 3.0),
        (np.array([1.0, 3.0]), 1.0, 3.0),
        ((1.0, np.inf), 1.0, np.inf),
        ((2.0, 2.0), 2.0, 2.0),
    ],
)
def test_numbers_and_ranges(gamma, enough, below):
    wanted = NormTarget.checked(gamma)
    assert (wanted.enough, wanted.below) == (enough, below)
    assert wanted.is_requested


def test_nothing_and_everything_ask_for_nothing():
    assert NormTarget.checked(None) is ANY_NORM
    assert not NormTarget.checked((0, np.inf)).is_requested
    assert ANY_NORM.limited(1.5) == 1.5
    assert ANY_NORM.in_words() == ""


@pytest.mark.parametrize(
    "gamma",
    [0, -1.0, np.nan, np.inf, True, "2", 1j, (2, 1), (1, 2, 3), (), (-1, 2), (0, 0), [[1], None],
     (np.nan, 2), (np.inf, np.inf), {"low": 1}],
)  # fmt: skip
def test_what_is_neither_is_refused_and_shown(gamma):
    with pytest.raises(InvalidInputError, match=r"gamma: got .*\(low, high\).*Pass gamma"):
        NormTarget.checked(gamma)


def test_searches_aim_into_the_range_and_leave_room_for_the_proof():
    wanted = NormTarget.checked((1.0, 2.0))
    assert 0.999 < wanted.limited(0.5) < 1.0
    assert 1.499 < wanted.limited(1.5) < 1.5
    assert 1.999 < wanted.limited(3.0) < 2.0
    assert wanted.in_unit(0.5) == NormTarget(2.0, 4.0)


def test_words():
    assert NormTarget.checked(2).in_words() == "a norm below gamma = 2"
    assert NormTarget.checked((0.5, 2)).in_words() == "a norm within gamma = 0.5 to 2"
    assert "0.5 to infinity" in NormTarget.checked((0.5, np.inf)).in_words()
    assert norm_in_words("h2") == "H2"
    error = unreachable_norm_error(NormTarget.checked(2), 2.5, "hinf", "by hand")
    assert "no controller has a norm below gamma = 2" in str(error)
    assert "H-infinity norm of every stabilising controller's loop is at least 2.5" in str(error)
