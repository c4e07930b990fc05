"""What a sample says about all that it was drawn from, whatever their distribution."""

from __future__ import annotations

import numpy as np
from scipy.stats import beta, binom

from robustpolish.arrays import Array


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
    one_sided = (1 + confidence) / 2
    return (
        share_at_least(good, samples, one_sided),
        1.0 - share_at_least(samples - good, samples, one_sided),
    )


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
