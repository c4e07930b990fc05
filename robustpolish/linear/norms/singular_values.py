"""Singular values of the frequency response."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import control
import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from robustpolish.base.arrays import Vector
from robustpolish.base.checks import described, invalid
from robustpolish.linear.arithmetic.realisation import Realisation, realisation, rescaled
from robustpolish.linear.delayed_systems import resolvent_response

# Frequencies that show what a system does: an even background, and points at every resonance.

_BACKGROUND = 400
# Rates this far below the fastest are poles at 0 that rounding moved (a double one by the root
# of the precision).
_AT_REST = 1e-8


def frequency_grid(poles: Any, highest: float = math.inf) -> Vector:
    """Return frequencies from a tenth of the slowest pole to ten times the fastest.

    Parameters
    ----------
    poles : ndarray of complex
        Poles, and zeros if these count too, in rad/s; infinities and what is at 0 are ignored.
    highest : float, optional
        No frequency lies above it, such as pi over the sampling time.

    Returns
    -------
    ndarray of float
        Rising, in rad/s, above 0; dense around each resonance however narrow it is.

    Examples
    --------
    >>> import numpy as np
    >>> from robustpolish.linear.norms.singular_values import frequency_grid
    >>> grid = frequency_grid(np.array([-1e-9 + 3j, -1e-9 - 3j]))
    >>> int(np.sum(abs(grid - 3) < 1e-8)) > 10
    True
    """
    rates = np.abs(poles)
    rates = rates[(rates > 0) & np.isfinite(rates)]
    rates = rates[rates > _AT_REST * rates.max(initial=0.0)]
    low, high = (rates.min(), rates.max()) if rates.size else (1.0, 1.0)
    background = np.geomspace(low / 10, min(high * 10, highest), _BACKGROUND)
    points = np.unique(np.concatenate([background, *around_resonances(poles)]))
    return points[(points > 0) & (points <= highest)]


def around_resonances(poles: Any) -> Iterator[Vector]:
    """Yield frequencies in rad/s around each complex pole, dense however narrow its resonance."""
    for pole in poles[(np.abs(poles.imag) > 0) & np.isfinite(poles)]:
        away = np.geomspace(max(abs(pole.real / pole.imag), 1e-12) / 10, 0.3, 40)
        yield abs(pole.imag) * np.concatenate([1 - away[::-1], [1.0], 1 + away])


def singular_values(
    system: control.StateSpace, frequencies_hz: ArrayLike | None = None
) -> xr.DataArray:
    """Compute the singular values of a system's frequency response.

    Parameters
    ----------
    system : control.StateSpace
        Continuous or discrete; an unspecified sampling time means continuous.
    frequencies_hz : array_like, optional
        Frequencies in Hz, not negative (cycles per sample if ``dt`` is True). By default from a
        tenth of the slowest pole to ten times the fastest, dense around every resonance however
        narrow it is.

    Returns
    -------
    xarray.DataArray
        Over ``frequency`` in Hz and ``singular_value`` (0 is the largest), in output units per
        input unit. Infinite at a pole on the boundary of stability, and where it is beyond doubles.

    Raises
    ------
    InvalidInputError
        If it is no ``StateSpace``, has entries that are not finite, or a frequency is negative.

    See Also
    --------
    hinf_norm : the largest of all, proven.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> lag = control.ss([[-2.0]], [[2.0]], [[1.0]], 0)
    >>> gains = rp.singular_values(lag, [0.0, 1 / 3.141592653589793])
    >>> [round(float(gain), 6) for gain in gains.isel(singular_value=0)]
    [1.0, 0.707107]
    """
    model = realisation("system", system)
    scaled = rescaled(model) if model.states else model
    if frequencies_hz is None:
        hertz = _grid(scaled)
    else:
        hertz = np.atleast_1d(np.asarray(frequencies_hz, dtype=float))
        if hertz.ndim != 1 or not (hertz >= 0).all():
            shown = described(repr(frequencies_hz))
            raise invalid("frequencies_hz", shown, "a list of numbers from 0 on", "Give Hz.")
    angles = 2 * math.pi * hertz * (scaled.step if scaled.discrete else 1 / scaled.time)
    values = scaled.gain * np.array([_at(scaled, angle) for angle in angles])
    coords = {"frequency": ("frequency", hertz, {"units": "Hz"})}
    dims = ("frequency", "singular_value")
    return xr.DataArray(values.reshape(hertz.size, -1), coords, dims, "gain")


def _grid(model: Realisation) -> Vector:
    """Return frequencies in Hz: an even background, and points around each resonance."""
    poles: Any = np.linalg.eigvals(model.A) if model.states else np.zeros(0, complex)
    highest = math.inf
    if model.discrete:
        with np.errstate(divide="ignore"):
            poles = np.log(poles.astype(complex)) / model.step
        highest = math.pi / model.step
    return frequency_grid(poles, highest) * model.time / (2 * math.pi)


def _at(model: Realisation, angle: float) -> Vector:
    """Return the singular values at one frequency, scaled, in rad (per sample)."""
    point = np.exp(1j * angle) if model.discrete else 1j * angle
    if 0 in model.D.shape:
        return np.zeros(0)
    response = model.D
    if math.isfinite(angle):
        points = np.array([point])
        response = resolvent_response(model.A, model.B, model.C, model.D, points)[0]
    if not np.isfinite(response).all():  # a pole, or one that it all but hits
        return np.full(min(model.D.shape), np.inf)
    return np.asarray(np.linalg.svd(response, compute_uv=False), dtype=float)
