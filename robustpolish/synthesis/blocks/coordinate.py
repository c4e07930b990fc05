"""From a coordinate without a unit, in which a search moves, to a number in its unit."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

# Decades from 1 at which the search for a positive number ends, in units that suit the loop:
# nothing in it depends on what is so small or large.
_FAR = 6.0
# The smallest gain of an integrator in these units: with less the loop has a pole so slow that
# nobody would notice the integral action, and at 0 it is not stable.
LEAST = 1e-4
# Within this factor of the smallest, in natural logarithms, an integral gain counts as not wanted.
_IDLE = math.log(10.0)


@dataclass(frozen=True)
class Coordinate:
    """A number as a monotonic function of its coordinate.

    A positive number is searched over its logarithm. So is the size of an integral gain, on both
    sides of a gap around 0: where a norm wants none of it, it comes to rest there.

    Attributes
    ----------
    size : float
        The number that is 1 in units of order one.
    low, high : float
        Limits of the number.
    search : {"linear", "positive", "integral"}
    """

    size: float
    low: float
    high: float
    search: Literal["linear", "positive", "integral"] = "linear"

    @property
    def least(self) -> float:
        """The smallest size of an integral gain."""
        return min(LEAST * self.size, 1e-3 * max(abs(self.low), abs(self.high)))

    def idle(self, theta: float) -> bool:
        """Tell whether an integral gain has come to rest next to 0."""
        return self.search == "integral" and abs(theta) < _IDLE

    def value(self, theta: float) -> float:
        """Return the number at a coordinate, inside its limits in spite of rounding."""
        if self.search == "positive":
            value = self.size * math.exp(min(theta, 700.0))
        elif self.search == "integral":
            # Folded at 0, where the number jumps.
            below = theta < 0 or self.high <= 0
            value = (-1 if below else 1) * self.least * math.exp(min(abs(theta), 700.0))
        else:
            value = self.size * theta
        return min(max(value, self.low), self.high)

    def slope(self, theta: float) -> float:
        """Return the derivative of the number over its coordinate."""
        if self.search == "positive":
            return self.size * math.exp(min(theta, 700.0))
        if self.search == "integral":
            return self.least * math.exp(min(abs(theta), 700.0))
        return self.size

    def theta(self, value: float) -> float:
        """Return the coordinate of a number."""
        if self.search == "positive":
            return math.log(value / self.size) if value > 0 else -math.inf
        if self.search == "integral":
            far = math.log(max(abs(value) / self.least, 1.0)) if math.isfinite(value) else math.inf
            return math.copysign(far, value)
        return value / self.size

    def bounds(self, start: float) -> tuple[float, float]:
        """Return the limits of the coordinate, which leave room around a start."""
        low, high = self.theta(self.low), self.theta(self.high)
        if self.search != "positive":
            return low, high
        far = _FAR * math.log(10.0)
        return max(low, min(-far, start - 1)), min(high, max(far, start + 1))
