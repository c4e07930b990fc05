"""The noise of the sensors, apart from what a model does wrong.

What a model does wrong is a part of the motion: where the spectrum of the errors exceeds that of
the motion itself, they are noise. The colour of that noise, of first order, tells how much of it
lies under the motion (P. Whittle 1953, Arkiv foer Matematik 2, 423-434, on fits to spectra). Far
above its corner all colours look alike, though they differ by ten below: of those that the seen
part allows, the floor is the loudest that the errors under the motion leave room for.
Records that repeat each other need none of that, see :mod:`robustpolish.identification.repeats`.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import welch

from robustpolish.arrays import Array
from robustpolish.identification.fit.prepared import PreparedRecord
from robustpolish.models.mechanical import MechanicalModel

_POLES = np.concatenate([np.linspace(0.0, 0.9, 37), 1 - np.geomspace(0.1, 0.05, 12)[1:]])
_STEEPEST = 0.9
"""Where no colour up to that is plausible, the errors are harmonics of what the model lacks."""
_CONFUSABLE = 3e-3
"""Mean of the log-likelihood by which colours may differ: no sensor is quite of first order."""
_ROOM = 0.7
"""Errors over noise, both smoothed over frequencies, below which a colour has no room."""
_SURE = 3.0
"""Standard errors that an estimated density may lie below the true one by chance."""
_FEWEST, _SMOOTHED, _DETRENDED = 8, 5, 3
_ALIKE = 1.9
"""Neighbours in a spectrum over windows of Hann's shape that say as much as one alone."""
_STRETCHES, _SCATTER = 8, 1.2
"""Of an eighth of a record, and what the sizes of coloured noise in them differ by."""


def floor_beside(model: MechanicalModel, prepared: PreparedRecord, calm: bool) -> Array:
    """Return the noise of each output that the errors of a fitted model show, shape (ny,).

    Parameters
    ----------
    model : MechanicalModel
    prepared : PreparedRecord
    calm : bool
        Whether free runs over the whole record judge; windows do otherwise.
    """
    run, started = prepared.closest_runs(model, prepared.everything if calm else prepared.windows)
    motion = run.over_all(started).outputs
    known = prepared.repeats is not None
    record, scales = prepared.record, prepared.scales
    errors = record.Y - motion
    return noise_floor(errors, motion, scales.noise, known, record.honest, scales.rounded)


def noise_floor(
    errors: Array,
    motion: Array,
    least: Array,
    known: bool = False,
    honest: float = 1.0,
    steps: Array | float = 0.0,
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
    steps : ndarray, shape (ny,), optional
        What sensors round away that count in steps: where nothing moves it does not show.

    Returns
    -------
    ndarray, shape (ny,)
        At most the error.
    """
    found = least
    if not known:
        each = zip(errors.T, motion.T, least, strict=True)
        found = [_floor(e, y, low, honest) for e, y, low in each]
    whole = np.sqrt(np.mean(errors**2, axis=0))
    return np.minimum(np.maximum(np.minimum(found, _quietest(errors)), steps), whole)


def _quietest(errors: Array) -> Array:
    """Return the size that noise can have where it never falls: that of the quietest stretch.

    Where a motion dies away, or a blow is yet to come, a model does nothing wrong.
    """
    sizes = [np.sqrt(np.mean(part**2, axis=0)) for part in np.array_split(errors, _STRETCHES)]
    return _SCATTER * np.min(sizes, axis=0)


def _floor(error: Array, motion: Array, least: float, honest: float) -> float:
    if not (np.isfinite(error).all() and np.isfinite(motion).all()):
        return least
    length = min(512, len(error) // 4)
    frequency, noise = welch(error, nperseg=length, detrend="linear")
    _, moving = welch(motion, nperseg=length, detrend="linear")
    inner = (frequency > 0) & (frequency < 0.5 * honest)
    seen = inner & (noise > moving)
    if np.count_nonzero(seen) < _FEWEST:
        return least
    density, turn = noise / 2, np.cos(2 * np.pi * frequency)
    shapes = 1 / (1 + _POLES[:, None] ** 2 - 2 * _POLES[:, None] * turn)
    strength = np.mean(density[seen] / shapes[:, seen], axis=1)
    if not np.min(strength) > 0:
        return least
    misfit = np.log(strength) + np.mean(np.log(shapes[:, seen]), axis=1)
    averaged = 1.5 * len(error) / length  # of segments that overlap by half
    confusable = max(_CONFUSABLE, 3 / (averaged * np.count_nonzero(seen)))
    plausible = misfit < np.min(misfit) + confusable
    if np.min(_POLES[plausible]) > _STEEPEST:
        return max(float(np.sqrt(np.percentile(density[seen], 25))), least)
    sizes = np.sqrt(strength / (1 - _POLES**2))
    hidden = inner & ~seen & (np.arange(frequency.size) >= _DETRENDED)
    spread = np.ones(_SMOOTHED) / _SMOOTHED
    there = np.convolve(density, spread, "same")
    wanted = np.array([np.convolve(row, spread, "same") for row in strength[:, None] * shapes])
    chance = _SURE / np.sqrt(_SMOOTHED * averaged / _ALIKE)
    least_room = min(_ROOM, 1 - chance)
    room = np.min((there / wanted)[:, hidden], axis=1, initial=np.inf) > least_room
    if not np.any(plausible & room):
        return max(float(np.min(sizes[plausible])), least)
    return max(float(np.max(sizes[plausible & room])), least)
