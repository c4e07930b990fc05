"""The gain that a loop is wanted to have, and how near a loop comes to it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from robustpolish.analysis.delays.delayed_system import resolvent_response
from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.arrays import AnyVector as Vector
from robustpolish.synthesis.problem.matrices import SystemMatrices
from robustpolish.validation import described, invalid


@dataclass(frozen=True)
class TargetPolicy:
    """What is decided about a wanted loop.

    Attributes
    ----------
    below, above : float
        The band reaches from the first crossover over this to the last one times that, as far as a
        discrete system goes: two decades of gain that rejects disturbances, one of roll-off.
    points : int
        Frequencies of the band at which gains are compared, evenly in its logarithm.
    roll_off : float
        The weight inverts the plant where its smallest gain is above this share of the least
        within the band, and becomes constant beyond, for no inverse of a strictly proper plant is
        proper. Within the band that moves the gain by its square: 0.5 %.
    faintest : float
        The least gain that is inverted, over the largest of the band: what lies below is a zero.
    shift : float
        Poles on the axis, which no stable factor can have, are moved by this share of the lower
        end of the band: 1e-4 of the gain at that end.
    on_axis : float
        Poles this near to the axis, over the largest pole or the lower end of the band, are on it.
    """

    below: float = 100.0
    above: float = 10.0
    points: int = 300
    roll_off: float = 0.1
    faintest: float = 1e-8
    shift: float = 1e-2
    on_axis: float = 1e-9


POLICY = TargetPolicy()


@dataclass(frozen=True, eq=False)
class WantedLoop:
    """The gain that a loop is wanted to have.

    Attributes
    ----------
    system : SystemMatrices
        As many inputs and outputs as the plant has controls.
    dt : float or bool
    crossovers : (float, float)
        The lowest and highest frequency in rad/s at which a gain falls to 1.
    band : (float, float)
        Where the loop is compared with it, in rad/s.
    """

    system: SystemMatrices
    dt: float | bool
    crossovers: tuple[float, float]
    band: tuple[float, float]

    @classmethod
    def checked(cls, system: SystemMatrices, dt: float | bool, band_hz: Any) -> WantedLoop:
        """Check a target and the band.

        Raises
        ------
        InvalidInputError
            If it is unstable, has no crossover, or the band is no range of frequencies.
        """
        poles = np.linalg.eigvals(system.A)
        size = float(np.abs(poles).max(initial=0.0))
        outside = np.abs(poles) - 1 > 1e-7 if dt else poles.real > 1e-7 * size
        if outside.any():
            shown = described(f"an unstable system with a pole at {poles[outside][0]:.4g}")
            remedy = "Only its gain counts: mirror the pole, which keeps the gain."
            raise invalid("target", shown, "poles that are stable or on the boundary", remedy)
        crossovers = _crossovers(system, dt)
        if crossovers is None:
            shown = described("a gain that never falls from above 1 to below 1")
            remedy = "Pass a shape with a crossover, such as 2 * pi * f / s for f in Hz."
            raise invalid("target", shown, "the open-loop gain that is wanted", remedy)
        return cls(system, dt, crossovers, _band(band_hz, crossovers, dt))

    @property
    def frequencies(self) -> Vector:
        """Where gains are compared, in rad/s."""
        return np.geomspace(*self.band, POLICY.points)

    def distance_of(self, loop: SystemMatrices) -> tuple[float, float]:
        """Return the largest factor, up or down, between the gains of a loop and the wanted ones.

        Parameters
        ----------
        loop : SystemMatrices

        Returns
        -------
        factor, frequency : float
            At least 1, and where it is met in rad/s.
        """
        return self._worst(np.abs(self._ratios(loop)[0]))

    def shortfall_of(self, loop: SystemMatrices) -> tuple[float, float]:
        """Return the factor by which gains fall short of those above 1, or exceed those below.

        Parameters
        ----------
        loop : SystemMatrices

        Returns
        -------
        factor, frequency : float
        """
        ratios, wanted = self._ratios(loop)
        return self._worst(np.where(wanted > 1, -ratios, ratios).clip(min=0.0))

    def _ratios(self, loop: SystemMatrices) -> tuple[Matrix, Matrix]:
        """Return logarithms of gains over wanted ones, as many as are wanted, and the latter."""
        own, wanted = (gains(each, self.frequencies, self.dt) for each in (loop, self.system))
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.log(own[:, : wanted.shape[1]]) - np.log(wanted), wanted

    def _worst(self, ratios: Matrix) -> tuple[float, float]:
        sizes = np.nan_to_num(ratios.max(axis=1), nan=math.inf)
        return float(np.exp(sizes.max())), float(self.frequencies[np.argmax(sizes)])


def gains(system: SystemMatrices, omega: Vector, dt: float | bool) -> Matrix:
    """Return the singular values over frequencies in rad/s, shape (k, count), largest first."""
    values = resolvent_response(*system, points_of(omega, dt))
    finite = np.isfinite(values).all(axis=(1, 2))
    sizes = np.full((len(values), min(values.shape[1:])), math.inf)
    sizes[finite] = np.linalg.svd(values[finite], compute_uv=False)
    return sizes


def step_of(dt: float | bool) -> float:
    """Return the sampling time in s, 1 where it is not told."""
    return 1.0 if dt is True else float(dt)


def points_of(omega: Vector, dt: float | bool) -> Any:
    """Return the points of s or z at frequencies in rad/s."""
    return np.exp(1j * omega * step_of(dt)) if dt else 1j * omega


def _crossovers(system: SystemMatrices, dt: float | bool) -> tuple[float, float] | None:
    """Return the lowest and highest frequency at which a singular value falls to 1."""
    # As wide as any machine, for a target such as 10 / s has no rate of its own.
    first, end = (1e-9 * math.pi / step_of(dt), math.pi / step_of(dt)) if dt else (1e-9, 1e12)
    omega = np.geomspace(first, end, 2101)
    sizes = gains(system, omega, dt)
    falls = (sizes[:-1] > 1) & (sizes[1:] <= 1)
    found = []
    for i, k in zip(*np.nonzero(falls), strict=True):
        low, high = omega[i], omega[i + 1]
        for _ in range(40):
            middle = math.sqrt(low * high)
            above = gains(system, np.array([middle]), dt)[0, k] > 1
            low, high = (middle, high) if above else (low, middle)
        found.append(math.sqrt(low * high))
    return (min(found), max(found)) if found else None


def _band(given: Any, crossovers: tuple[float, float], dt: float | bool) -> tuple[float, float]:
    """Return the band in rad/s, within what a discrete system has."""
    end = math.pi / step_of(dt) if dt else math.inf
    if given is None:
        low, high = crossovers[0] / POLICY.below, crossovers[1] * POLICY.above
        return low, min(high, end * (1 - 1e-6))
    try:
        low, high = (2 * math.pi * float(f) for f in given)
    except (TypeError, ValueError):
        low = high = math.nan
    if not 0 < low < high <= end * (1 + 1e-12) or math.isinf(high):
        want = "(low, high) with 0 < low < high" + (" up to half the sample rate" if dt else "")
        raise invalid("band_hz", given, want, "Leave it out for the target's own band.")
    return low, min(high, end * (1 - 1e-6))
