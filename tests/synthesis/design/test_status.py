"""One order of statuses for all methods."""

import itertools

import pytest

from robustpolish.synthesis.problem.preflight import worst_status

ORDER = ("time_limit", "suboptimal", "infimum_not_attained", "optimal")


@pytest.mark.parametrize("pair", list(itertools.combinations(ORDER, 2)))
def test_the_word_that_says_less_wins_in_any_order(pair):
    assert worst_status(pair) == worst_status(reversed(pair)) == pair[0]
