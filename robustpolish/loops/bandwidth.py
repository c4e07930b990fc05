"""Where in frequency a loop works: bandwidths of S and T, gain crossovers, peaks."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robustpolish.loops.loop import PLACES, Loop, Place
from robustpolish.loops.margins.one_loop import LoopMargins
from robustpolish.loops.response import Response

_HALF_POWER = 1 / math.sqrt(2)


@dataclass(frozen=True)
class LoopBandwidth:
    """Frequencies in Hz at which one loop, or the largest singular value of several, changes sides.

    Attributes
    ----------
    name : str
        The signal at which the loop is broken, the others closed; "all" for the largest singular
        value with all signals of the place.
    place : {"input", "output"}
        Of the plant.
    crossover_hz : float
        Highest frequency at which the gain of L is 1; nan if it never is.
    sensitivity_hz : float
        Where S first crosses -3 dB from below: disturbances below it are reduced; nan if S
        is nowhere below.
    complementary_hz : float
        Where T crosses -3 dB from above for the last time; nan if T is nowhere above, infinite
        if it stays above.
    peak_s, peak_t : float
        Peaks of S and T.
    peak_s_hz, peak_t_hz : float
        Where they are.

    Notes
    -----
    Definitions of S. Skogestad, I. Postlethwaite, Multivariable Feedback Control, 2nd ed.,
    section 2.4.5.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> rows = rp.loop_analysis(control.tf([1], [1, 0]), -6.283185307179586).bandwidths
    >>> round(rows[0].crossover_hz, 6), round(rows[0].complementary_hz, 6)
    (1.0, 1.0)
    """

    name: str
    place: Place
    crossover_hz: float
    sensitivity_hz: float
    complementary_hz: float
    peak_s: float
    peak_t: float
    peak_s_hz: float
    peak_t_hz: float


def bandwidths(loop: Loop, margins: Sequence[LoopMargins]) -> tuple[LoopBandwidth, ...]:
    """Return the bandwidths of a stable loop's single loops, and of all signals of a place.

    Parameters
    ----------
    loop : Loop
    margins : sequence of LoopMargins
        Of its single loops, whose gain crossovers are known.

    Returns
    -------
    tuple of LoopBandwidth
    """
    found = []
    for place in PLACES:
        own = [m for m in margins if m.place == place]
        for i, single in enumerate(own):
            crossovers = [c.frequency_hz for c in single.gain_crossovers]
            found.append(_bandwidth(loop, place, single.name, [i], crossovers))
        if len(own) > 1:
            every = loop.response(place).level_crossings(1.0)
            crossovers = [omega / (2 * math.pi) for omega in every]
            found.append(_bandwidth(loop, place, "all", list(range(len(own))), crossovers))
    return tuple(found)


def _bandwidth(
    loop: Loop, place: Place, name: str, signals: list[int], crossovers: list[float]
) -> LoopBandwidth:
    at = loop.at(place, signals)
    S, T = loop.response_around(at), loop.response_around(at, -1.0, -1.0)
    peak_s, peak_t = loop.peak(at), loop.peak(at, -1.0, -1.0)
    return LoopBandwidth(
        name,
        place,
        max(crossovers, default=math.nan),
        _rising(S) / (2 * math.pi),
        _falling(T) / (2 * math.pi),
        peak_s.value,
        peak_t.value,
        peak_s.frequency / (2 * math.pi),
        peak_t.frequency / (2 * math.pi),
    )


def _sides(response: Response) -> tuple[list[float], list[bool]]:
    """Return the half-power frequencies, and whether the gain is above in each stretch between."""
    found = response.level_crossings(_HALF_POWER)
    last = max(found, default=1.0)
    ends = [0.0, *found, response.highest if math.isfinite(response.highest) else 3 * last]
    middles = np.array([(low + high) / 2 for low, high in itertools.pairwise(ends)])
    return found, [bool(size > _HALF_POWER) for size in response.sizes(middles)[:, 0]]


def _rising(response: Response) -> float:
    found, above = _sides(response)
    upwards = [w for w, low, high in zip(found, above[:-1], above[1:], strict=True) if high > low]
    return min(upwards, default=math.nan)


def _falling(response: Response) -> float:
    found, above = _sides(response)
    if above[-1]:
        return math.inf
    return max(found, default=math.nan)
