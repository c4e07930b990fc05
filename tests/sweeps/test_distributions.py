"""Draws have their distributions, and depend on seed, number and name alone."""

import numpy as np
import pytest
from scipy import stats

import robustpolish as rp
from robustpolish.base.sampling import draws


@pytest.mark.parametrize(
    ("given", "distribution"),
    [
        (("normal", 2.0, 0.5), stats.norm(2.0, 0.5)),
        ((1.0, 3.0), stats.uniform(1.0, 2.0)),
        (("uniform", 1.0, 3.0), stats.uniform(1.0, 2.0)),
        (("lognormal", 2.0, 0.3), stats.lognorm(0.3, scale=2.0)),
        (("triangular", 1.0, 1.5, 3.0), stats.triang(0.25, 1.0, 2.0)),
        (stats.gamma(3.0), stats.gamma(3.0)),
    ],
)
def test_draws_have_their_distribution(given, distribution):
    found = [one["a"] for one in draws({"a": given}, 400, seed=1)]
    assert stats.kstest(found, distribution.cdf).pvalue > 0.01


def test_lists_give_their_values_as_often():
    found = [one["run"] for one in draws({"run": [1, 2, 4]}, 300, seed=0)]
    assert set(found) == {1, 2, 4}
    assert all(isinstance(value, int) for value in found)
    assert stats.chisquare(np.bincount(found)[[1, 2, 4]]).pvalue > 0.01


def test_neither_other_names_nor_more_samples_change_a_draw():
    alone = draws({"a": (0.0, 1.0)}, 3, seed=7)
    beside = draws({"b": ("normal", 0.0, 1.0), "a": (0.0, 1.0)}, 5, seed=7)
    assert [one["a"] for one in beside[:3]] == [one["a"] for one in alone]
    assert draws({"a": (0.0, 1.0)}, 3, seed=8) != alone


@pytest.mark.parametrize(
    "given",
    [("normal", 1.0, 0.0), (3.0, 1.0), ("normal", 1.0), ("gauss", 1.0, 2.0), [], "normal", 3.0,
     ("lognormal", -1.0, 0.1), ("triangular", 1.0, 4.0, 3.0), ("uniform", 0.0, np.inf), ()],
)  # fmt: skip
def test_what_is_no_distribution_is_refused(given):
    with pytest.raises(rp.InvalidInputError, match=r"distributions.*frozen distribution"):
        draws({"a": given}, 1, seed=0)


def test_draws_that_are_not_finite_are_refused():
    with pytest.raises(rp.InvalidInputError, match="finite draws"):
        draws({"a": stats.norm(np.nan, 1.0)}, 1, seed=0)
