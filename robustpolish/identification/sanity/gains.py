"""How large and in which phase measured outputs are against simulated ones, line by line."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import get_window

from robustpolish.arrays import AnyVector, Vector
from robustpolish.identification.sanity.limits import LIMITS


@dataclass(frozen=True, eq=False)
class CoherentGain:
    """Measured over simulated, at the frequencies where one follows from the other.

    Attributes
    ----------
    frequencies : ndarray, shape (lines,)
        In Hz.
    values : ndarray of complex, shape (lines,)
        1 where the model is right.
    """

    frequencies: Vector
    values: AnyVector

    @property
    def enough(self) -> bool:
        """Whether so many lines over so wide a band speak, that no resonance speaks for all."""
        f = self.frequencies
        return f.size >= LIMITS.lines and bool(f[-1] >= LIMITS.band * f[0])

    @property
    def size(self) -> float:
        """Median of the absolute value."""
        return float(np.median(np.abs(self.values)))

    @property
    def scatter(self) -> float:
        """Factor that half of the lines lie within, around `size`."""
        return float(np.exp(np.median(np.abs(np.log(np.abs(self.values) / self.size)))))

    @property
    def reversed(self) -> float:
        """Share of the lines whose sign is turned, within 45 degrees."""
        return float(np.mean(np.abs(np.angle(-self.values)) < np.pi / 4))

    @property
    def distance(self) -> float:
        """Median distance from 1, in the logarithm: 0.1 is 10 % or 6 degrees."""
        return float(np.median(np.abs(np.log(self.values))))


def coherent_gain(simulated: Vector, measured: Vector, dt: float) -> CoherentGain:
    """Compare two signals line by line, by Welch's method.

    What follows from the inputs counts, however the record starts: a free run with a fitted start
    can take any size and sign, this cannot.

    Parameters
    ----------
    simulated, measured : ndarray, shape (samples,)
    dt : float
        Sampling step in s.

    Returns
    -------
    CoherentGain

    References
    ----------
    P. D. Welch, IEEE Trans. Audio Electroacoustics 15 (1967) 70-73; J. S. Bendat and A. G.
    Piersol, Random Data, 4th ed., section 6.2.1.

    Examples
    --------
    >>> noise = np.random.default_rng(0).standard_normal(4000)
    >>> gain = coherent_gain(noise, -2 * noise, 0.01)
    >>> gain.enough, round(gain.size, 6), gain.reversed
    (True, 2.0, 1.0)
    """
    length = int(2 * simulated.size / (LIMITS.averages + 1))
    window = get_window("hann", length)
    parts = [
        [np.fft.rfft(window * _without_trend(y[i : i + length])) for y in (simulated, measured)]
        for i in range(0, simulated.size - length + 1, length // 2)
    ]
    S, Y = np.transpose(np.array(parts), (1, 0, 2))
    across = np.mean(S.conj() * Y, axis=0)
    power, seen = np.mean(np.abs(S) ** 2, axis=0), np.mean(np.abs(Y) ** 2, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        coherence = np.abs(across) ** 2 / (power * seen)
    # The lowest two lines hold what is left of trends.
    spoken = np.flatnonzero((coherence > LIMITS.coherence) & (power > LIMITS.excited * power.max()))
    spoken = spoken[spoken >= 2]
    frequencies = spoken / (length * dt)
    return CoherentGain(frequencies, across[spoken] / power[spoken])


def _without_trend(values: Vector) -> Vector:
    place = np.arange(values.size) - (values.size - 1) / 2
    moving = values - values.mean()
    return moving - place * float(place @ moving) / float(place @ place)
