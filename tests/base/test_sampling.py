"""Draws have their distributions and depend on seed, number and name alone; limits from samples."""

import numpy as np
import pytest
from scipy import stats
from scipy.stats import binom

import robustpolish as rp
from robustpolish.base.sampling import (
    draws,
    percentile,
    percentile_limits,
    share_at_least,
    share_limits,
)


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


def test_limits_of_a_share_solve_the_equations_of_clopper_and_pearson():
    low, high = share_limits(7, 40, 0.9)
    assert binom.sf(6, 40, low) == pytest.approx(0.05)
    assert binom.cdf(7, 40, high) == pytest.approx(0.05)
    assert share_limits(0, 10, 0.95)[0] == 0.0
    assert share_limits(10, 10, 0.95)[1] == 1.0
    # S.S. Wilks, Annals of Mathematical Statistics 12, 1941: 59 draws without failure prove 95 %,
    # and 72 are the first to bound the 95th percentile.
    assert share_at_least(58, 58, 0.95) < 0.95 <= share_at_least(59, 59, 0.95)
    assert percentile_limits(np.arange(71.0), 0.95, 0.95)[1] == np.inf
    assert percentile_limits(np.arange(72.0), 0.95, 0.95)[1] == 71.0


@pytest.mark.parametrize("samples", [1, 20, 72, 500])
@pytest.mark.parametrize("share", [0.05, 0.5, 0.95])
@pytest.mark.parametrize("confidence", [0.9, 0.95])
def test_limits_of_a_percentile_hold_for_every_distribution(samples, share, confidence):
    places = np.arange(1.0, samples + 1)
    low, high = percentile_limits(places, share, confidence)
    below = 0 if np.isneginf(low) else int(low)
    above = samples + 1 if np.isposinf(high) else int(high)
    # the percentile lies between two draws exactly if so many draws are below it
    tails = binom.cdf(below - 1, samples, share), binom.sf(above - 1, samples, share)
    assert max(tails) <= (1 - confidence) / 2 + 1e-12  # sums that are equal to rounding
    # no narrower ones would do
    assert above > samples or binom.sf(above - 2, samples, share) > (1 - confidence) / 2
    assert below < 1 or binom.cdf(below, samples, share) > (1 - confidence) / 2


def test_a_percentile_is_a_value_of_the_sample():
    values = np.array([4.0, 1.0, np.inf, 2.0, 3.0])
    assert [percentile(values, share) for share in (0.2, 0.5, 0.8, 1.0)] == [1.0, 3.0, 4.0, np.inf]
    assert percentile(np.arange(1.0, 101.0), 0.95) == 95.0
