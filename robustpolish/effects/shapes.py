"""Candidate forces for screening: what an effect would do along a known motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

Coefficients = NDArray[np.float64]
LINE = "line of the force"


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


@dataclass(frozen=True)
class Scan:
    """Values of one parameter that screening tries, because the force is not linear in it.

    Parameters
    ----------
    parameter : str
    of : str or (float, float)
        What the shares are multiplied by: ``"1"``, the ``"amplitude"`` or the ``"speed"`` of the
        motion, or powers of these two. ``"per slip"`` is the inverse of a share of the amplitude,
        if that is longer than half a sample's travel: the stiffness of what slips at a unit of
        force. ``"percentile"`` is the displacement at which so many percent of the samples are
        below, and its mirror image. ``"line of the force"`` is the frequency in Hz of the line
        of the missing force that stands out most (0), of the second one (1), and so on.
    shares : tuple of float
    kept : bool
        False for what only rounds a candidate's corners: the effect keeps its default.

    Examples
    --------
    >>> time = np.linspace(0.0, 1.0, 1001)
    >>> swing = Motion(time, 2.0 * np.ones((1, 1001)), np.zeros((1, 1001)))
    >>> Scan("gap", "amplitude", (0.1, 0.5)).values(swing)
    [0.2, 1.0]
    """

    parameter: str
    of: str | tuple[float, float]
    shares: tuple[float, ...]
    kept: bool = True

    def values(self, motion: Motion) -> list[float]:
        """Return the values along a motion.

        Parameters
        ----------
        motion : Motion

        Returns
        -------
        list of float
            Empty if the motion, or the missing force, says nothing about the parameter.
        """
        if self.of == "percentile":
            levels = [level for share in self.shares for level in (share, 100 - share)]
            return np.percentile(motion.q[0], levels).tolist()
        if self.of == LINE:
            return [] if motion.force is None else _lines(motion, [int(n) for n in self.shares])
        if self.of == "per slip":
            travel = 0.5 * motion.speed * float(motion.time[1] - motion.time[0])
            slips = (share * motion.amplitude for share in self.shares)
            return [1 / slip for slip in slips if slip > travel]
        if isinstance(self.of, str):
            size = {"1": 1.0, "amplitude": motion.amplitude, "speed": motion.speed}[self.of]
        elif motion.amplitude and motion.speed:
            size = motion.amplitude ** self.of[0] * motion.speed ** self.of[1]
        else:
            size = 0.0
        return [share * size for share in self.shares] if size else []


_AROUND = 401
"""Bins, a quarter of what the record resolves each, over which a spectrum counts as even."""
_LEAST_AROUND = 1e-6
"""Share of the largest line below which what is around a line is rounding."""


def _lines(motion: Motion, ranks: list[int]) -> list[float]:
    """Return the frequencies of the most prominent lines of the force, refined between the bins.

    A force that is smoothed from poor sensors drifts: there is more of it at low frequencies than a
    line has, but spread out.
    """
    assert motion.force is not None
    force = motion.force[0]
    n = force.size
    spectrum = np.abs(np.fft.rfft((force - force.mean()) * np.hanning(n), 4 * n))
    bins = np.fft.rfftfreq(4 * n, motion.time[1] - motion.time[0])
    around = median_filter(spectrum, _AROUND, mode="nearest")
    spectrum /= np.maximum(around, _LEAST_AROUND * spectrum.max(initial=1e-300))
    spectrum[:8] = 0.0
    lines = []
    for _ in range(max(ranks) + 1):
        k = int(np.argmax(spectrum))
        lines.append(float(bins[k]))
        spectrum[max(k - 10, 0) : k + 11] = 0.0
    return [lines[rank] for rank in ranks]


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
