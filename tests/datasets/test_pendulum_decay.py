"""The pendulum that comes to rest."""

import numpy as np
import pytest

import robustpolish as rp


def period(swing):
    """Return the time from one upward crossing to the next, one value a swing."""
    theta, time = swing["theta"].values, swing["time"].values
    rising = np.flatnonzero((theta[:-1] < 0) & (theta[1:] >= 0))
    return np.diff(time[rising] - 0.01 * theta[rising] / (theta[rising + 1] - theta[rising]))


def test_the_large_swings_are_slower_as_the_elliptic_integral_says():
    first, rest = rp.datasets.pendulum_decay(), rp.datasets.pendulum_decay("rest")
    assert (first.sizes["time"], rest.sizes["time"]) == (3667, 1834)
    large = float(abs(first["theta"][:200]).max())
    small = float(abs(rest["theta"][-200:]).max())

    def slower(amplitude):  # the first terms of the period over that of small swings
        return 1 + amplitude**2 / 16 + 11 * amplitude**4 / 3072

    ratio = period(first)[0] / period(rest)[-2:].mean()
    assert ratio == pytest.approx(slower(large) / slower(small), rel=0.01)


def test_the_rest_goes_on_where_the_first_part_ends():
    ends = (rp.datasets.pendulum_decay(part)["theta"].values for part in ("first", "rest"))
    before, after = ends
    assert abs(before[-80:]).max() > abs(after[:80]).max() > abs(after[-80:]).max()
    assert after[0] == pytest.approx(2 * before[-1] - before[-2], abs=0.01)


def test_another_part_is_refused():
    with pytest.raises(rp.InvalidInputError, match="'first', 'rest'"):
        rp.datasets.pendulum_decay("last")
