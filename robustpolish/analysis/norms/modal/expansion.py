r"""Power series of the response about the middles of pieces of the axis, with their errors."""

from __future__ import annotations

import numpy as np

from robustpolish.analysis.norms.modal.cover import FAR
from robustpolish.analysis.poles.eigen import EPS
from robustpolish.compiling import njit

ORDER = 8
"""Number of terms."""
# Half lengths over the distance to the nearest pole; beyond, the series are not used.
_LONGEST = 0.55
# An error this small beside the gain that is sought may be bounded more coarsely.
_COARSE = 1e-12


@njit(cache=True, error_model="numpy")
def expand(modes, centre, half, terms):  # type: ignore[no-untyped-def]  # compiled
    """Expand the response: G(c + h t) = sum of terms[j] t^j + a rest, for t from -1 to 1.

    Parameters
    ----------
    modes : Modes
    centre, half : float
        c and h.
    terms : ndarray of complex, shape (ORDER, p, m)
        Overwritten.
    """
    n = modes.real.size
    p, m = modes.D.shape
    _start(modes.D, terms)
    step = complex(0.0, -half)
    for i in range(n):
        power = 1.0 / complex(-modes.real[i], (centre - modes.high[i]) - modes.low[i])
        factor = power * step
        for j in range(ORDER):
            for k in range(p):
                for q in range(m):
                    terms[j, k, q] += power * modes.residues[i, k * m + q]
            power = power * factor


@njit(cache=True, error_model="numpy")
def _start(D, terms):  # type: ignore[no-untyped-def]  # compiled
    """Make D the first term and all others zero."""
    for j in range(ORDER):
        for k in range(D.shape[0]):
            for q in range(D.shape[1]):
                terms[j, k, q] = D[k, q] if j == 0 else 0.0


@njit(cache=True, error_model="numpy")
def expansion_error(modes, centre, half, gain):  # type: ignore[no-untyped-def]  # compiled
    """Bound what :func:`expand` leaves out on a piece.

    These are the rest of the series, the errors of poles and vectors, and rounding.

    Parameters
    ----------
    modes : Modes
    centre, half : float
    gain : float
        What is tiny beside it may be bounded coarsely; zero for the sharpest bound.

    Returns
    -------
    error : float
        Infinite where the piece is too long for the series.
    gain : float
        No gain on the piece is larger, by the sizes and distances of the modes alone.
    """
    n = modes.real.size
    nearest = np.empty(n)
    rest, size = 0.0, modes.D_size
    for i in range(n):
        near = 1.0 / np.hypot(modes.real[i], (centre - modes.high[i]) - modes.low[i])
        share = half * near
        if not share <= _LONGEST:
            return np.inf, np.inf
        nearest[i] = near / (1.0 - share)
        fourth = (share * share) * (share * share)
        rest += nearest[i] * fourth * fourth * modes.sizes[i]
        size += nearest[i] * modes.sizes[i]
    weight = np.hypot(1.0, centre) + half if modes.discrete else 1.0
    error = _error_of_modes(modes, nearest, weight, gain)
    return rest + error, (size + error) * (1.0 + 1e-9)


@njit(cache=True, error_model="numpy")
def expand_far(modes, start, terms):  # type: ignore[no-untyped-def]  # compiled
    """Expand the response in t = start/x from `start` on, at least FAR times the largest pole.

    Returns
    -------
    float
        Bound of what is left out.
    """
    n = modes.real.size
    p, m = modes.D.shape
    _start(modes.D, terms)
    nearest = np.empty(n)
    rest = 0.0
    for i in range(n):
        nearest[i] = FAR / (FAR - 1.0) / start * (1.0 + 1e-9)
        ratio = complex(modes.real[i], modes.high[i]) / complex(0.0, start)
        power = 1.0 / complex(0.0, start)
        for j in range(1, ORDER):
            for k in range(p):
                for q in range(m):
                    terms[j, k, q] += power * modes.residues[i, k * m + q]
            power = power * ratio
        rest += nearest[i] * modes.sizes[i] * np.hypot(ratio.real, ratio.imag) ** (ORDER - 1)
    # Within the weight of discrete time, |1 - i x| <= 1 + x, x cancels the x of the distance.
    weight = 1.0 + start if modes.discrete else 1.0
    return rest + _error_of_modes(modes, nearest, weight, 0.0)


@njit(cache=True, error_model="numpy")
def _error_of_modes(modes, nearest, weight, gain):  # type: ignore[no-untyped-def]  # compiled
    """Bound rounding and what the errors of the modal form do, within a piece.

    With E the diagonal matrix of 1/|z - eigenvalue|, the solution w of (1 - E F) w = E b is at
    most E |b| plus the row sums of E F times the largest entry of w, and what F changes in the
    response is |c| E F w.
    """
    n = nearest.size
    rounding, signals, share, largest = 0.0, 0.0, 0.0, 0.0
    for i in range(n):
        rounding += nearest[i] * modes.sizes[i]
        E = nearest[i] * modes.stretch[i] * weight
        signals += E * modes.signal_errors[i]
        share = max(share, E * modes.rows[i])
        largest = max(largest, E * modes.moved[i])
    if not share < 0.5:
        return np.inf
    largest /= 1.0 - share
    w = np.empty(n)
    most, coarse = 0.0, 0.0
    for i in range(n):
        E = nearest[i] * modes.stretch[i] * weight
        w[i] = E * modes.moved[i] + E * modes.rows[i] * largest
        most = max(most, w[i])
        coarse += E * modes.shown[i] * modes.rows[i]
    coupled = coarse * most  # the row sums stand for the rows
    if not coupled <= _COARSE * gain:
        coupled = 0.0
        alone = modes.coupling.shape[0] == 1
        for i in range(n):
            if alone:
                inner = modes.coupling[0, i] * w[i]
            else:
                inner = 0.0
                for j in range(n):
                    inner += modes.coupling[i, j] * w[j]
            coupled += nearest[i] * modes.stretch[i] * weight * modes.shown[i] * inner
    rounding = EPS * (4 * n + 256) * rounding + EPS * modes.D_size
    return (rounding + modes.D_error + coupled + signals) * (1.0 + 1e-9)
