"""The noise of the sensors, apart from what a model does wrong.

What a model does wrong is a part of the motion: where the spectrum of the errors exceeds that of
the motion itself, they are noise. The colour of that noise, of first order, tells how much of it
lies under the motion (P. Whittle 1953, Arkiv foer Matematik 2, 423-434, on fits to spectra).
Records that repeat each other need none of that, see :mod:`robustpolish.identification.repeats`.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import welch

from robustpolish.arrays import Array

_POLES = np.linspace(0.0, 0.95, 39)
_FEWEST = 8


def noise_floor(
    errors: Array, motion: Array, least: Array, known: bool = False, honest: float = 1.0
) -> Array:
    """Return the standard deviation of the noise of each output.

    Parameters
    ----------
    errors, motion : ndarray, shape (samples, ny)
        Of a model's runs, and its outputs there.
    least : ndarray, shape (ny,)
        Noise that is seen in the quietest band of the record, if the motion hides all other.
    known : bool, optional
        Whether `least` is the noise itself, as records show it that repeat each other.
    honest : float, optional
        Share of half the sampling rate in which noise is looked for, see :class:`Record`.

    Returns
    -------
    ndarray, shape (ny,)
        At most the error.
    """
    found = least
    if not known:
        each = zip(errors.T, motion.T, least, strict=True)
        found = [_floor(e, y, low, honest) for e, y, low in each]
    return np.minimum(found, np.sqrt(np.mean(errors**2, axis=0)))


def _floor(error: Array, motion: Array, least: float, honest: float) -> float:
    if not (np.isfinite(error).all() and np.isfinite(motion).all()):
        return least
    length = min(512, len(error) // 4)
    frequency, noise = welch(error, nperseg=length, detrend="linear")
    _, moving = welch(motion, nperseg=length, detrend="linear")
    seen = (noise > moving) & (frequency > 0) & (frequency < 0.5 * honest)
    if np.count_nonzero(seen) < _FEWEST:
        return least
    density, turn = noise[seen] / 2, np.cos(2 * np.pi * frequency[seen])
    best, chosen, steepest = np.inf, least, False
    for pole in _POLES:
        whitened = density * (1 + pole**2 - 2 * pole * turn)
        power = float(np.mean(whitened))
        if power <= 0:
            return least
        misfit = np.log(power) - np.mean(np.log(1 + pole**2 - 2 * pole * turn))
        if misfit < best:
            best, chosen = misfit, float(np.sqrt(power / (1 - pole**2)))
            steepest = pole == _POLES[-1]
    if steepest:  # no sensor is that: harmonics of what the model lacks
        chosen = float(np.sqrt(np.percentile(density, 25)))
    return max(chosen, least)
