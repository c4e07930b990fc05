"""A packed path in compiled code: intervals per second, then the coefficients of x and of y."""

from __future__ import annotations

from robustpolish.brush.surfaces.uniform_spline import cell, slope_weights, weights
from robustpolish.compiling import njit


@njit(cache=True)
def follow(time, packed, place, velocity):  # pragma: no cover - compiled
    """Write the horizontal place [m] and velocity [m/s] at a time [s]."""
    count = (packed.size - 1) // 2
    number, fraction = cell(time, 0.0, packed[0], count)
    share, rate = weights(fraction), slope_weights(fraction)
    for axis in range(2):
        first = 1 + axis * count + number
        here = moving = 0.0
        for i in range(4):
            here += share[i] * packed[first + i]
            moving += rate[i] * packed[first + i]
        place[axis] = here
        velocity[axis] = moving * packed[0]
