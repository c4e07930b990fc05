"""What is wrong with a channel by itself: clipped peaks, dropouts, no motion."""

from __future__ import annotations

import numpy as np

from robustpolish.arrays import Vector
from robustpolish.identification.sanity.limits import LIMITS
from robustpolish.measurements.gaps import runs
from robustpolish.measurements.quality import clipped_plateaus


def clipping(name: str, values: Vector) -> str:
    """Say so if a channel was cut off at the end of its range, "" if not.

    Parameters
    ----------
    name : str
    values : ndarray, shape (samples,)

    Returns
    -------
    str

    Examples
    --------
    >>> sine = np.sin(np.arange(1000) / 20)
    >>> clipping("x", sine), clipping("x", np.clip(sine, -0.8, 0.8))[:27]
    ('', 'x sticks at its extremes in')
    """
    plateaus = clipped_plateaus(values)
    if not plateaus:
        return ""
    return (
        f"{name} sticks at its extremes in {len(plateaus)} places ({sum(plateaus)} samples at "
        f"{values.min():.4g} or {values.max():.4g}): its peaks look clipped. Widen the range of "
        "the sensor or amplifier, or lower the amplitude, and record again; what a fit makes of "
        "clipped peaks is a stop or friction that is not there"
    )


def dropouts(name: str, values: Vector, time: Vector) -> str:
    """Say so if a channel freezes in the middle of a motion and jumps afterwards, "" if not.

    Parameters
    ----------
    name : str
    values, time : ndarray, shape (samples,)

    Returns
    -------
    str

    Examples
    --------
    >>> time = np.arange(1000) / 100
    >>> frozen = np.sin(5 * time)
    >>> frozen[700:715] = frozen[700]
    >>> dropouts("x", frozen, time)[:39]
    'x stands still for 15 samples at 7 s an'
    """
    still = runs(np.diff(values) == 0)
    long = [(a, b + 1) for a, b in still if b + 2 - a >= LIMITS.held]
    share = sum(b + 1 - a for a, b in long) / values.size
    if not long or share > LIMITS.repeats:
        return ""
    found = [(a, b) for a, b in long if _jumps_out(values, a, b)]
    if not found:
        return ""
    a, b = max(found, key=lambda run: run[1] - run[0])
    more = f", and in {len(found) - 1} other places" if len(found) > 1 else ""
    return (
        f"{name} stands still for {b + 1 - a} samples at {time[a]:.6g} s and then jumps{more}: it "
        "looks like a dropout of the sensor or the logger. Leave the part out with between=, or "
        "blank the samples in the file, so that they count as missing"
    )


def no_motion(name: str, values: Vector) -> str:
    """Say so if a displacement or velocity is noise from one sample to the next, "" if not.

    Parameters
    ----------
    name : str
    values : ndarray, shape (samples,)

    Returns
    -------
    str

    Examples
    --------
    >>> noise = np.random.default_rng(0).standard_normal(1000)
    >>> no_motion("x", noise)[:40], no_motion("x", np.cumsum(noise))
    ('x holds no motion: its samples know noth', '')
    """
    if values.size < LIMITS.least:
        return ""
    moving = values - values.mean()
    power = float(moving @ moving)
    if power == 0:
        return f"{name} never changes. Check the sensor and its cable"
    lags = [float(moving[k:] @ moving[:-k]) / power for k in range(1, 6)]
    if max(abs(lag) for lag in lags) > LIMITS.white:
        return ""
    return (
        f"{name} holds no motion: its samples know nothing of each other (correlation "
        f"{lags[0]:.2f}), as noise does. Check the sensor and its range, or move the machine more"
    )


def _jumps_out(values: Vector, first: int, last: int) -> bool:
    """Whether a stretch of one value inside a record ends in a jump, larger than steps nearby."""
    reach = 4 * (last + 1 - first)
    before = np.abs(np.diff(values[max(0, first - reach) : max(first, 0)]))
    behind = np.abs(np.diff(values[last + 1 : last + 2 + reach]))
    if before.size < LIMITS.held or behind.size < LIMITS.held:
        return False
    usual = float(max(before.max(), behind.max()))
    return usual > 0 and abs(values[last + 1] - values[last]) > LIMITS.jump * usual
