"""The highest peak of a loop's singular values over frequency, and all others near it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from robustpolish.arrays import Vector
from robustpolish.synthesis.nonsmooth.loop_response import LoopResponse

# The level-set search stops when no frequency exceeds the norm by more than this share; the
# design is certified afresh afterwards, so it need not be sharper than the line search.
_RELATIVE_STEP = 1e-8


def highest_peak(response: LoopResponse, guesses: Sequence[float]) -> tuple[float, float]:
    """Return the norm and its frequency: level sets of Bruinsma and Steinbuch (1990)."""
    frequencies = np.unique(np.concatenate([response.start(), np.asarray(guesses, float)]))
    values = response.sigma(frequencies)
    best = int(np.argmax(values))
    norm, peak = float(values[best]), float(frequencies[best])
    if response.feedthrough > norm:
        norm, peak = response.feedthrough, (np.pi if response.discrete else np.inf)
    if norm == 0:
        return norm, peak
    tops = _hills(values)
    hills = frequencies[tops]
    climbed = _climbed(response, frequencies, values, tops)
    if climbed[0] > norm:
        norm, peak = climbed
    for _ in range(40):
        better = _exceeding(response, norm)
        if better is None:
            near = [peak, *hills] if np.isfinite(peak) else list(hills)
            better = _around(response, norm, np.array(near))
        if better is None:
            break
        norm, peak = better
    return norm, peak


def local_peaks(response: LoopResponse, level: float) -> list[float]:
    """Return a frequency of a local maximum in each interval above `level`."""
    edges = response.crossings(level)
    if len(edges) == 0:
        return []
    last = np.pi if response.discrete else edges[-1]
    edges = np.unique(np.concatenate([[0.0], edges, [last]]))
    low, high = edges[:-1], edges[1:]
    above = response.sigma(0.5 * (low + high)) > level
    low, high = low[above], high[above]
    for _ in range(6):
        if len(low) == 0:
            break
        grid = low[:, None] + (high - low)[:, None] * np.linspace(0, 1, 9)
        values = response.sigma(grid.ravel()).reshape(grid.shape)
        best = np.argmax(values, axis=1)
        rows = np.arange(len(low))
        low, high = grid[rows, np.maximum(best - 1, 0)], grid[rows, np.minimum(best + 1, 8)]
    return [float(w) for w in 0.5 * (low + high)]


def _hills(values: Vector) -> NDArray[np.intp]:
    """Return the local maxima within a twentieth of the largest value, three at most."""
    padded = np.concatenate([[-np.inf], values, [-np.inf]])
    local = (values >= padded[:-2]) & (values >= padded[2:])
    near = np.flatnonzero(local & (values >= 0.95 * values.max(initial=0.0)))
    return near[np.argsort(-values[near])][:3]


_CLIMBS = 4


def _climbed(
    response: LoopResponse, frequencies: Vector, values: Vector, tops: NDArray[np.intp]
) -> tuple[float, float]:
    """Climb some hills of a grid along parabolas: cheaper than one more level set."""
    last = len(frequencies) - 1
    inner = tops[(tops > 0) & (tops < last)]
    if len(inner) == 0:
        return 0.0, 0.0
    w = np.stack([frequencies[inner - 1], frequencies[inner], frequencies[inner + 1]])
    f = np.stack([values[inner - 1], values[inner], values[inner + 1]])
    for _ in range(_CLIMBS):
        before = f.max()
        width = w[2] - w[0]
        left, right = (w[1] - w[0]) * (f[1] - f[2]), (w[1] - w[2]) * (f[1] - f[0])
        with np.errstate(all="ignore"):
            step = 0.5 * ((w[1] - w[0]) * left - (w[1] - w[2]) * right) / (left - right)
        top = np.where(np.isfinite(step), w[1] - step, w[1])
        tried = np.sort(np.clip(top + width * _SPREAD[:, None], w[0], w[2]), axis=0)
        found = response.sigma(tried.ravel()).reshape(tried.shape)
        w, f = np.concatenate([w, tried]), np.concatenate([f, found])
        order = np.argsort(w, axis=0, kind="stable")
        w, f = np.take_along_axis(w, order, 0), np.take_along_axis(f, order, 0)
        best = np.clip(np.argmax(f, axis=0), 1, len(f) - 2)
        rows = best + np.array([[-1], [0], [1]])
        w, f = np.take_along_axis(w, rows, 0), np.take_along_axis(f, rows, 0)
        if f.max() <= before * (1 + 0.1 * _RELATIVE_STEP):
            break
    flat = int(np.argmax(f))
    return float(f.ravel()[flat]), float(w.ravel()[flat])


# Where a hill is looked at around the top of its parabola, as shares of what brackets it.
_SPREAD = np.array([-0.05, 0.0, 0.05])


def _exceeding(response: LoopResponse, norm: float) -> tuple[float, float] | None:
    """Find a frequency above `norm` among the level sets a little above it.

    Near the feedthrough the Hamiltonian is close to singular and hides crossings, so
    that a higher level is asked as well.
    """
    close = norm < 1.01 * response.feedthrough
    for step in (_RELATIVE_STEP, 1e-6, 1e-4) if close else (_RELATIVE_STEP,):
        edges = response.crossings(norm * (1 + step))
        if len(edges) == 0:
            continue
        found = _highest(response, norm, np.concatenate([0.5 * (edges[1:] + edges[:-1]), edges]))
        if found is not None:
            return found
    return None


def _around(response: LoopResponse, norm: float, places: Vector) -> tuple[float, float] | None:
    """Look around some frequencies, on the scale of the nearest pole.

    Rounding in the Hamiltonian of a loop with large gains can hide a peak that ties.
    """
    poles = response.closed.poles
    if len(poles) == 0 or len(places) == 0:
        return None
    points = np.atleast_1d(response.point(places))
    scale = np.abs(points[:, None] - poles).min(axis=1)
    offsets = (scale[:, None] * _OFFSETS).ravel()
    return _highest(response, norm, np.abs(np.repeat(places, len(_OFFSETS)) + offsets))


_OFFSETS = np.outer([-1, 1], [1e-4, 1e-3, 1e-2, 0.1, 0.5]).ravel()


def _highest(response: LoopResponse, norm: float, places: Vector) -> tuple[float, float] | None:
    """Return the best of some frequencies if it exceeds `norm` noticeably."""
    values = response.sigma(places)
    best = int(np.argmax(values))
    if not values[best] > norm * (1 + _RELATIVE_STEP):
        return None
    return float(values[best]), float(places[best])
