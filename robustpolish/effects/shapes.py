"""Candidate forces for screening: what an effect would do along a known motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Coefficients = NDArray[np.float64]


@dataclass(frozen=True)
class Motion:
    """The motion at a place, as far as it is known.

    Parameters
    ----------
    time : ndarray, shape (samples,)
        In s, uniform.
    q, v : ndarray, shape (ports, samples)
        Relative displacement and velocity (m, m/s or rad, rad/s); for an effect on an input or
        output, the signal and its derivative.
    context : mapping
        What the kind asked for, see `EffectKind.context`.
    force : ndarray, shape (ports, samples), optional
        Estimated missing force, for kinds that search a frequency.
    """

    time: NDArray[np.float64]
    q: NDArray[np.float64]
    v: NDArray[np.float64]
    context: Mapping[str, float] = field(default_factory=dict)
    force: NDArray[np.float64] | None = None

    @property
    def amplitude(self) -> float:
        """Robust amplitude of the first port's displacement about zero."""
        return float(np.percentile(np.abs(self.q[0]), 95))

    @property
    def speed(self) -> float:
        """Robust amplitude of the first port's velocity about zero."""
        return float(np.percentile(np.abs(self.v[0]), 95))

    def slips(self, shares: tuple[float, ...]) -> list[float]:
        """Return the shares of the amplitude that are longer than half a sample's travel.

        Parameters
        ----------
        shares : tuple of float

        Returns
        -------
        list of float
        """
        travel = 0.5 * self.speed * float(self.time[1] - self.time[0])
        return [s * self.amplitude for s in shares if s * self.amplitude > travel]


@dataclass(frozen=True)
class Shape:
    """Forces that are linear in unknown coefficients, at one choice of the rest.

    Parameters
    ----------
    columns : ndarray, shape (coefficients, ports, samples)
        Force on the first degree of freedom for a unit of each coefficient.
    values : callable
        Maps coefficients to the kind's parameters.
    signs : tuple of int
        Required sign of each coefficient: +1, -1, or 0 for either.
    valid : callable, optional
        Whether coefficients are near enough to this choice of the rest.
    """

    columns: NDArray[np.float64]
    values: Callable[[Coefficients], Mapping[str, float]]
    signs: tuple[int, ...]
    valid: Callable[[Coefficients], bool] = lambda c: True


def single(column: NDArray[np.float64], name: str, sign: int = 1, **fixed: float) -> Shape:
    """Return a shape of one coefficient, which is the parameter `name`."""
    return Shape(
        np.asarray(column, dtype=float).reshape(1, 1, -1),
        lambda c: {name: float(c[0]), **fixed},
        (sign,),
    )
