"""Frequencies that show what a system does: an even background, and points at every resonance."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from robustpolish.arrays import Vector

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
    >>> from robustpolish.analysis.norms.frequency_grid import frequency_grid
    >>> grid = frequency_grid(np.array([-1e-9 + 3j, -1e-9 - 3j]))
    >>> int(np.sum(abs(grid - 3) < 1e-8)) > 10
    True
    """
    rates = np.abs(poles)
    rates = rates[(rates > 0) & np.isfinite(rates)]
    rates = rates[rates > _AT_REST * rates.max(initial=0.0)]
    low, high = (rates.min(), rates.max()) if rates.size else (1.0, 1.0)
    grid = [np.geomspace(low / 10, min(high * 10, highest), _BACKGROUND)]
    for pole in poles[(np.abs(poles.imag) > 0) & np.isfinite(poles)]:
        width = abs(pole.real / pole.imag)
        away = np.geomspace(max(width, 1e-12) / 10, 0.3, 40)
        grid.append(abs(pole.imag) * np.concatenate([1 - away[::-1], [1.0], 1 + away]))
    points = np.unique(np.concatenate(grid))
    return points[(points > 0) & (points <= highest)]
