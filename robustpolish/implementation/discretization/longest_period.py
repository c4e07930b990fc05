"""The longest period at which an imitated controller keeps its loop stable."""

from __future__ import annotations

import math

import control
import numpy as np

from robustpolish.errors import InvalidInputError
from robustpolish.implementation.discretization.certify_sampled import MOST_PERIODS
from robustpolish.implementation.discretization.emulation import emulated
from robustpolish.implementation.sampled.loop_delays import loop_delay_taken_out
from robustpolish.implementation.sampled.period_map import period_map
from robustpolish.implementation.sampled.scaled_map import scaled
from robustpolish.models import GeneralizedPlant

STEP = 1.08
"""Ratio of neighbouring periods that are tried: loops lose their stability over wider ranges."""

_FAST, _SLOW = 1e-2, 1e3
_BISECTIONS = 30


def longest_period(
    plant: GeneralizedPlant,
    controller: control.StateSpace,
    delay: float = 0.0,
    *,
    delay_periods: float = 0.0,
    method: str = "tustin",
    prewarp_hz: float | None = None,
) -> float:
    """Return the longest period up to which the sampled loop is stable.

    Parameters
    ----------
    plant : GeneralizedPlant
        Continuous, with its filter.
    controller : control.StateSpace
        Continuous, or a static gain.
    delay : float, optional
        Seconds from a sample until its control acts, whatever the period.
    delay_periods : float, optional
        Delay in periods, which is added.
    method : str, optional
    prewarp_hz : float, optional
        See `emulated`.

    Returns
    -------
    float
        In s; infinite if no period makes it unstable, 0 if none was found that keeps it stable,
        because of the delay, or because poles differ by so much that doubles cannot tell.

    Notes
    -----
    Periods are tried from a hundredth of the fastest time constant of the loop upwards, each 8 %
    longer than the one before; where stability is lost, the limit is bisected. Beyond it a loop may
    be stable once more.
    """
    plant, own = loop_delay_taken_out(plant)
    delay += own

    def stable(period: float) -> bool:
        try:
            K = emulated(controller, period, method, prewarp_hz)
        except InvalidInputError:
            return False
        late = delay + delay_periods * period
        A = scaled(period_map(plant, K, period, late)).transition()
        grows = not np.isfinite(A).all()  # beyond doubles within a period
        return not grows and bool(np.abs(np.linalg.eigvals(A)).max(initial=0.0) < 1)

    rates = np.abs(np.linalg.eigvals(np.asarray(plant.closed_loop(controller).A)))
    rates = rates[rates > rates.max(initial=0.0) * 1e-12]
    if not rates.size:
        return math.inf
    shortest = max(_FAST / rates.max(), delay / MOST_PERIODS * 4)
    if not stable(shortest):
        return _downwards(stable, shortest, delay)
    low, limit = shortest, _SLOW / rates.min()
    if prewarp_hz is not None:
        limit = min(limit, 0.499 / prewarp_hz)
    while low < limit:
        high = low * STEP
        if not stable(high):
            return _between(stable, low, high)
        low = high
    return math.inf if prewarp_hz is None else limit


def _downwards(stable, high: float, delay: float) -> float:
    """Look for a shorter period that is stable, as far down as the delay lets one."""
    for _ in range(12):
        low = high / 4
        if delay / low > MOST_PERIODS:
            return 0.0
        if stable(low):
            return _between(stable, low, high)
        high = low
    return 0.0


def _between(stable, low: float, high: float) -> float:
    for _ in range(_BISECTIONS):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low
