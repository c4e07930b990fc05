"""Where the search for the numbers of blocks starts."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from robustpolish.arrays import AnyVector as Vector
from robustpolish.long_calls import Budget
from robustpolish.synthesis.blocks.block_gain import BlockGain
from robustpolish.synthesis.blocks.coordinate import Coordinate
from robustpolish.synthesis.blocks.loop_units import LoopUnits
from robustpolish.synthesis.blocks.placement import Placement
from robustpolish.synthesis.blocks.wiring import wired
from robustpolish.synthesis.nonsmooth import Bounds, Folded
from robustpolish.synthesis.problem.scaling import ScaledPlant

# Gains of a first guess, where 1 makes the loop cross over: low, so that a stable plant stays so.
_LOW = 0.1
# Scatter of drawn numbers, in natural logarithms, and how often a gain has another sign than the
# others of its block.
_SCATTER, _ODD = 1.0, 0.15


@dataclass(frozen=True, eq=False)
class BlockStarts:
    """Guesses from what makes the loop cross over somewhere.

    Attributes
    ----------
    placement : Placement
    scaled : ScaledPlant
    units : LoopUnits
    initial : mapping of str to float
        Values to start from, by name.
    """

    placement: Placement
    scaled: ScaledPlant
    units: LoopUnits
    initial: Mapping[str, float]

    @cached_property
    def gain(self) -> BlockGain:
        """K of the numbers."""
        return wired(self.placement, self.scaled, self.units)

    @cached_property
    def first(self) -> Vector:
        """Numbers that were given, and low gains."""
        return self._guess(self.units.middle, _LOW, None)

    @cached_property
    def bounds(self) -> Bounds:
        """Limits of the coordinates."""
        pairs = zip(self.gain.coordinates, self.first, strict=True)
        low, high = np.array([c.bounds(t) for c, t in pairs]).T
        return low, high

    def propose(
        self, earlier: Sequence[Vector], budget: Budget, rng: np.random.Generator
    ) -> Iterator[Vector]:
        """Propose the first guess, then numbers for a crossover drawn anew each time."""
        yield self.first
        folded = Folded(self.gain, self.bounds)
        low, high = np.log(self.units.band)
        while True:
            drawn = self._guess(float(np.exp(rng.uniform(low, high))), 1.0, rng)
            yield folded.point(drawn)

    def _guess(self, crossover: float, share: float, rng: np.random.Generator | None) -> Vector:
        units = LoopUnits(self.units.plant, crossover)
        signs = np.ones(len(self.placement.blocks))
        if rng is not None:
            signs = rng.choice([-1.0, 1.0], len(signs))
        # Numbers that were given are kept in half of the draws.
        keep = rng is None or rng.random() < 0.5
        there = wired(self.placement, self.scaled, units).coordinates
        theta = []
        for number, own, size in zip(
            self.placement.numbers, self.gain.coordinates, there, strict=True
        ):
            scatter = 0.0 if rng is None else rng.normal() * _SCATTER
            value = self.initial.get(number.key, number.tunable.value)
            if value is not None and keep:
                odd = 0.0 if rng is None else 0.3 * scatter
                theta.append(own.theta(value) + (odd if own.search != "linear" else 0.0))
                continue
            if number.slot.default:
                value = number.slot.default * size.size * math.exp(scatter)
            else:
                value = share * signs[number.block] * size.size * math.exp(scatter)
                if rng is not None and rng.random() < _ODD:
                    value = -value
            theta.append(_placed(own, value))
        return np.array(theta)


def _placed(coordinate: Coordinate, value: float) -> float:
    """Return the coordinate of a number, or of one that its limits allow."""
    low, high = coordinate.low, coordinate.high
    if not low < value < high:
        value = min(max(-value, low), high)
    if value in (low, high):
        if math.isfinite(low) and math.isfinite(high):
            value = math.sqrt(low * high) if low > 0 else 0.5 * (low + high)
        elif coordinate.search == "positive":
            value = 2 * low if math.isfinite(low) and low > 0 else 0.5 * high
    return coordinate.theta(value)
