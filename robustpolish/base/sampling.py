"""Distributions by name, and draws that depend on seed, number and place in the sample alone."""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
from scipy import stats
from scipy.stats import beta, binom

from robustpolish.base.arrays import Array
from robustpolish.base.checks import invalid

# What a sample says about all that it was drawn from, whatever their distribution.


def share_at_least(good: int, samples: int, confidence: float) -> float:
    """Return the one-sided lower limit of Clopper and Pearson for a share.

    Parameters
    ----------
    good, samples : int
        How many of how many independent draws were good.
    confidence : float

    Returns
    -------
    float

    References
    ----------
    C.J. Clopper and E.S. Pearson, Biometrika 26, 1934.

    Examples
    --------
    >>> round(share_at_least(59, 59, 0.95), 4)
    0.9505
    """
    return float(beta.ppf(1 - confidence, good, samples - good + 1)) if good else 0.0


def share_limits(good: int, samples: int, confidence: float) -> tuple[float, float]:
    """Return the two-sided limits of Clopper and Pearson for a share.

    Examples
    --------
    >>> low, high = share_limits(8, 10, 0.95)
    >>> round(low, 4), round(high, 4)
    (0.4439, 0.9748)
    """
    bad, one_sided = samples - good, (1 + confidence) / 2
    lowest, most_bad = (share_at_least(n, samples, one_sided) for n in (good, bad))
    return lowest, 1.0 - most_bad


def percentile(values: Array, share: float) -> float:
    """Return the smallest value that at least this share of the sample does not exceed."""
    ordered = np.sort(values)
    place = int(np.ceil(share * ordered.size - 1e-9 * ordered.size))
    return float(ordered[min(max(place, 1), ordered.size) - 1])


def percentile_limits(values: Array, share: float, confidence: float) -> tuple[float, float]:
    """Return limits of a percentile of what a sample was drawn from, from the sample's order.

    The number of draws below the percentile is binomial, whatever the distribution: each limit is
    wrong with at most half of 1 - `confidence`. Infinite where the sample is too small to tell.

    Parameters
    ----------
    values : ndarray, shape (samples,)
        Independent draws; may be infinite.
    share, confidence : float

    References
    ----------
    H.A. David and H.N. Nagaraja, "Order Statistics", 3rd edition, 2003, section 7.1.

    Examples
    --------
    >>> percentile_limits(np.arange(1.0, 101.0), 0.5, 0.95)
    (40.0, 61.0)
    >>> percentile_limits(np.arange(1.0, 101.0), 0.99, 0.95)[1]
    inf
    """
    ordered, tail = np.sort(values), (1 - confidence) / 2
    below = int(binom.ppf(tail, ordered.size, share))
    above = int(binom.ppf(1 - tail, ordered.size, share)) + 1
    low = float(ordered[below - 1]) if below >= 1 else -np.inf
    high = float(ordered[above - 1]) if above <= ordered.size else np.inf
    return low, high


FORMS = (
    'a frozen distribution of scipy.stats, (low, high), ("normal", mean, deviation), '
    '("uniform", low, high), ("lognormal", median, deviation of the logarithm), '
    '("triangular", low, mode, high) or a list of values'
)


@runtime_checkable
class Distribution(Protocol):
    """What a frozen distribution of scipy.stats can do."""

    def rvs(self, *, random_state: Any) -> Any:
        """Draw a value."""
        ...


class Choice:
    """One of some values, all as likely."""

    def __init__(self, values: Sequence[Any]) -> None:
        self.values = list(values)

    def rvs(self, *, random_state: np.random.Generator) -> Any:
        """Draw a value."""
        return self.values[int(random_state.integers(len(self.values)))]


def draws(distributions: Mapping[str, Any], samples: int, seed: int) -> list[dict[str, Any]]:
    """Draw samples; each depends on the seed, its number and the name of the quantity.

    Longer samples begin with the shorter ones, and another quantity beside them changes nothing:
    two studies with one seed see the same machines.

    Parameters
    ----------
    distributions : mapping of str to distribution
        See :data:`FORMS`.
    samples, seed : int

    Returns
    -------
    list of dict

    Examples
    --------
    >>> found = draws({"mass": (1.0, 2.0), "run": [1, 2]}, 3, seed=0)
    >>> found[:2] == draws({"run": [1, 2], "mass": ("uniform", 1.0, 2.0)}, 2, seed=0)
    True
    """
    known = {name: read_distribution(name, distributions[name]) for name in sorted(distributions)}
    return [{name: _drawn(name, known[name], seed, i) for name in known} for i in range(samples)]


def _drawn(name: str, distribution: Distribution, seed: int, i: int) -> Any:
    own = np.random.SeedSequence(seed, spawn_key=(i, zlib.crc32(name.encode())))
    value = distribution.rvs(random_state=np.random.default_rng(own))
    value = value.item() if isinstance(value, np.ndarray | np.generic) else value
    if isinstance(value, float) and not math.isfinite(value):
        where = ("distributions", name)
        raise invalid(where, value, "finite draws", "Truncate the distribution.")
    return value


def read_distribution(name: str, given: Any) -> Distribution:
    """Return a distribution as an object that draws; see :data:`FORMS`."""
    if isinstance(given, Distribution):
        return given
    if isinstance(given, list | range | np.ndarray) and len(given):
        values = np.asarray(given)
        if values.ndim == 1 and values.dtype.kind in "biufU":
            return Choice(values.tolist())
    if isinstance(given, tuple) and len(given) == 2 and not isinstance(given[0], str):
        given = ("uniform", *given)
    if isinstance(given, tuple) and given and given[0] in _NAMED:
        sound, made = _NAMED[given[0]]
        try:
            numbers = [float(number) for number in given[1:]]
            if all(map(math.isfinite, numbers)) and sound(*numbers):
                return made(*numbers)
        except (TypeError, ValueError):  # not numbers, or not as many as it takes
            pass
    remedy = "Spreads have to be above zero, and bounds in rising order."
    raise invalid(("distributions", name), given, FORMS, remedy)


_NAMED: dict[str, tuple[Any, Any]] = {
    "normal": (lambda _, deviation: deviation > 0, stats.norm),
    "uniform": (lambda low, high: low < high, lambda low, high: stats.uniform(low, high - low)),
    "lognormal": (
        lambda median, deviation: median > 0 and deviation > 0,
        lambda median, deviation: stats.lognorm(deviation, scale=median),
    ),
    "triangular": (
        lambda low, mode, high: low <= mode <= high and low < high,
        lambda low, mode, high: stats.triang((mode - low) / (high - low), low, high - low),
    ),
}
"""Which numbers of a named distribution are sound, and what it becomes."""
