"""Corners made round, and gone along with one speed."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d

from robustpolish.brush.surfaces.polished_surface import Floats, PolishedSurface
from robustpolish.validation import described, invalid

_PER_ROUNDING = 4  # places of the spline per length of a rounding
_FINE = 4  # finer than that before rounding
_MOST = 200_000


def at_constant_speed(
    corners: Floats, rounding: float, speed: float, over: PolishedSurface | None
) -> tuple[Floats, float]:
    """Return places at equal times along a rounded line, shape (n, 2), and the interval [s].

    Corners are rounded by a Gaussian mean along the line whose standard deviation is half the
    rounding; the ends stay where they are.

    Parameters
    ----------
    corners : ndarray, shape (n, 2)
        [m].
    rounding : float
        [m].
    speed : float
        [m/s], along the surface `over`, or in the plane without one.
    over : PolishedSurface or None
    """
    length = float(_lengths(corners)[-1])
    step = rounding / _PER_ROUNDING / _FINE
    count = int(np.ceil(length / step)) + 1
    if not length > 0 or count > _FINE * _MOST:
        shown = described(f"a length of {length:g} m with {rounding:g} m between turns")
        raise invalid("step", shown, f"at most {_MOST} places", "Take larger steps.")
    fine = _evenly(corners, _lengths(corners), max(count, 64))
    width = 0.5 * rounding * (len(fine) - 1) / length
    # Mirrored through its end points, a line keeps them, and its direction there.
    around = [gaussian_filter1d(_mirrored(column), width) for column in fine.T]
    inner = slice(len(fine) - 1, 2 * len(fine) - 1)
    rounded = np.stack([column[inner] for column in around], axis=1)
    far = _lengths(rounded, over)
    places = _evenly(rounded, far, max(len(fine) // _FINE, 16))
    return places, float(far[-1]) / speed / (len(places) - 1)


def _mirrored(values: Floats) -> Floats:
    before = 2 * values[0] - values[:0:-1]
    after = 2 * values[-1] - values[-2::-1]
    return np.concatenate([before, values, after])


def _lengths(places: Floats, over: PolishedSurface | None = None) -> Floats:
    """Length of the line up to each place [m], shape (n,)."""
    steps = np.hypot(*np.diff(places, axis=0).T)
    if over is not None:
        rise = np.diff(over.height(places[:, 0], places[:, 1]))
        outside = np.flatnonzero(~np.isfinite(rise))
        if outside.size:
            x, y = 1e3 * places[outside[0]]
            shown = described(f"a path that leaves the surface near x = {x:.4g} mm, y = {y:.4g} mm")
            raise invalid("over", shown, "a surface below all of the path", "Move the path.")
        steps = np.hypot(steps, rise)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _evenly(places: Floats, far: Floats, count: int) -> Floats:
    """Return places at equal distances along a line of straight pieces."""
    wanted = np.linspace(0.0, far[-1], count)
    return np.stack([np.interp(wanted, far, column) for column in places.T], axis=1)
