"""The peak of the gain by branch and bound over the frequency axis, in modal coordinates.

Pieces whose gain is surely below the best one found are done; the others are cut about the place
where their gain seems to be largest, and a larger gain found there is climbed to its top. When none
is left, the bound is proven up to the errors of the modal form.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from robustpolish.analysis.norms.modal.bound import below, sizes, squares
from robustpolish.analysis.norms.modal.cover import FAR, first_pieces, overlapping
from robustpolish.analysis.norms.modal.expansion import (
    ORDER,
    expand,
    expand_far,
    expansion_error,
)
from robustpolish.analysis.norms.modal.modal_form import ModalForm
from robustpolish.analysis.norms.modal.modes import modes_of
from robustpolish.analysis.norms.modal.small_hermitian import eigen, largest_gain
from robustpolish.analysis.poles.eigen import EPS
from robustpolish.compiling import njit
from robustpolish.deadline import look_at_the_clock


@dataclass(frozen=True)
class ModalPeak:
    """The largest gain with bounds, in the units of the form that it was found in.

    Attributes
    ----------
    frequency : float
        In x, s = i x.
    gain, lower, upper : float
    """

    frequency: float
    gain: float
    lower: float
    upper: float


def modal_peak(form: ModalForm, tolerance: float, widest: float) -> ModalPeak | None:
    """Find the peak.

    Parameters
    ----------
    form : ModalForm
    tolerance, widest : float
        Relative widths of the bracket: wanted, and accepted where the errors of the form are
        larger.

    Returns
    -------
    ModalPeak or None
        None if these errors, or too much work, leave it open.
    """
    modes = modes_of(form)
    by_height = np.argsort(modes.high)
    centre, half, count = first_pieces(modes.real[by_height], modes.high[by_height])
    search: Any = _search  # compiled, so that no types are known
    look_at_the_clock()
    pieces = centre[:count], half[:count]
    settled, *found = search(modes, *pieces, float(tolerance), float(widest))
    return ModalPeak(*found) if settled else None


@njit(cache=True, error_model="numpy")
def _search(modes, centre, half, tolerance, widest):  # type: ignore[no-untyped-def]  # compiled
    """Return whether the peak is settled, where it is, its gain, and both bounds."""
    p, m = modes.D.shape
    terms, norms = np.empty((ORDER, p, m), np.complex128), np.empty(ORDER)
    found = np.empty((4, m, m), np.complex128)
    end = 0.0
    for i in range(modes.real.size):
        bounds = modes.sizes[i] + modes.shown[i] + modes.moved[i] + modes.signal_errors[i]
        if not np.isfinite(bounds + modes.rows[i] + modes.stretch[i]):
            return False, np.nan, 0.0, 0.0, np.inf
        end = max(end, FAR * np.hypot(modes.real[i], modes.high[i]))
    gain = largest_gain(modes.D)
    rounding = EPS * (8 * p + 8 * m + 32)
    best = (np.inf, gain, max(0.0, gain * (1.0 - rounding) - 2.0 * modes.D_error))
    best = _highest_middle(modes, centre, half, best, terms, found)
    done, most, level = 0, 100 + 60 * modes.real.size, 0.0
    open_pieces = np.empty((centre.size + 8 + 2 * most, 2))
    open_pieces[0, 0], open_pieces[0, 1], left = np.inf, end, 1
    for k in range(centre.size):
        open_pieces[left, 0], open_pieces[left, 1] = centre[k], half[k]
        left += 1
        if abs(centre[k] - best[0]) <= half[k]:
            left = _cut(open_pieces, left - 1, (best[0] - centre[k]) / half[k], 0.3)
    while left > 0:
        left -= 1
        middle, reach = open_pieces[left, 0], open_pieces[left, 1]
        far = np.isinf(middle)
        if far:
            error = expand_far(modes, reach, terms)
        else:
            error, most_gain = expansion_error(modes, middle, reach, best[1])
            if most_gain < level:
                continue
            expand(modes, middle, reach, terms)
            best = _climbed(modes, middle, reach, best, terms, found)
        # Errors of the form keep the bracket from being narrower; what is done stays so.
        width = max(tolerance, 4.0 * (best[1] - best[2]) / best[1]) if best[2] > 0.0 else np.inf
        if not width <= widest or done > most or (far and reach > 1e6 * end):
            return False, best[0], best[1], best[2], np.inf
        level = max(level, best[1] * (1.0 + width))
        hint = 0.0
        if error < np.inf:
            total = sizes(terms, norms)
            if total + error < level:
                continue
            late, lost = squares(terms, norms, total, error, found)
            proven, hint = below(found, late, lost, level)
            if proven:
                continue
        done += 1
        if far:
            open_pieces[left, 1] = 2.0 * reach
            open_pieces[left + 1, 0], open_pieces[left + 1, 1] = overlapping(reach, 2.0 * reach)
            left += 2
        else:
            left = _cut(open_pieces, left, hint, 0.3 if error < np.inf else 0.1)
    return True, best[0], best[1], best[2], level


@njit(cache=True, error_model="numpy")
def _cut(pieces, k, hint, share):  # type: ignore[no-untyped-def]  # compiled
    """Put three pieces in the place of the last one, k; return how many there are then.

    The one about the place that the hint tells comes last.
    """
    centre, half = pieces[k, 0], pieces[k, 1]
    middle = min(max(hint, -0.7), 0.7)
    part = share * (1.0 - abs(middle))
    left, right = centre + half * (middle - part), centre + half * (middle + part)
    pieces[k, 0], pieces[k, 1] = overlapping(centre - half, left)
    pieces[k + 1, 0], pieces[k + 1, 1] = overlapping(right, centre + half)
    pieces[k + 2, 0] = centre + half * middle
    pieces[k + 2, 1] = half * part * (1.0 + 1e-9) + 4e-16 * abs(pieces[k + 2, 0])
    return k + 3


@njit(cache=True, error_model="numpy")
def _highest_middle(modes, centre, half, best, terms, found):  # type: ignore[no-untyped-def]  # compiled
    """Climb from the highest of all middles."""
    p, m = modes.D.shape
    highest, which = -1.0, 0
    G = np.empty((p, m), np.complex128)
    for k in range(centre.size):
        for i in range(p):
            for j in range(m):
                G[i, j] = modes.D[i, j]
        for q in range(modes.real.size):
            factor = 1.0 / complex(-modes.real[q], (centre[k] - modes.high[q]) - modes.low[q])
            for i in range(p):
                for j in range(m):
                    G[i, j] += factor * modes.residues[q, i * m + j]
        square = 0.0
        for i in range(p):
            for j in range(m):
                square += G[i, j].real ** 2 + G[i, j].imag ** 2
        if np.sqrt(square) >= highest:  # no singular value is larger than that
            gain = largest_gain(G)
            if gain > highest:
                highest, which = gain, k
    expand(modes, centre[which], half[which], terms)
    return _climbed(modes, centre[which], half[which], best, terms, found)


@njit(cache=True, error_model="numpy")
def _climbed(modes, at, half, best, terms, found):  # type: ignore[no-untyped-def]  # compiled
    """Climb by Newton's method from a middle whose gain is above the best one; keep `terms`."""
    gain = largest_gain(terms[0])
    if not gain > best[1] * (1.0 + 1e-14):
        return best
    p, m = modes.D.shape
    here = np.empty((ORDER, p, m), np.complex128)
    expand(modes, at, half, here)
    for _ in range(12):
        trial = at + half * _step(here, found)
        if abs(trial - at) <= 1e-12 * half:
            break
        expand(modes, trial, half, here)
        reached = largest_gain(here[0])
        if not reached > gain:
            break
        at, progress, gain = trial, reached - gain, reached
        if progress <= 1e-13 * gain:
            break
    error, _ = expansion_error(modes, at, 0.0, 0.0)
    lower = max(0.0, gain * (1.0 - EPS * (8 * p + 8 * m + 32)) - error)
    return abs(at), gain, lower


@njit(cache=True, error_model="numpy")
def _step(here, found):  # type: ignore[no-untyped-def]  # compiled
    """Return t of the top of the gain about a middle, at most 1 away."""
    _, p, m = here.shape
    for order in range(3):
        for i in range(m):
            for j in range(m):
                entry = complex(0.0, 0.0)
                for a in range(order + 1):
                    for k in range(p):
                        entry += np.conj(here[a, k, i]) * here[order - a, k, j]
                found[order, i, j] = entry
    V = np.empty((m, m), np.complex128)
    eigen(found[0], V)
    first, second = 0.0, 0.0
    for i in range(m - 1, -1, -1):  # the last vector is that of the largest gain
        slope, bend = complex(0.0, 0.0), complex(0.0, 0.0)
        for j in range(m):
            for k in range(m):
                pair = np.conj(V[j, i]) * V[k, m - 1]
                slope += pair * found[1, j, k]
                bend += pair * found[2, j, k]
        if i == m - 1:
            first, second = slope.real, bend.real
        else:
            apart = found[0, m - 1, m - 1].real - found[0, i, i].real
            if apart > 0.0:
                second += (slope.real**2 + slope.imag**2) / apart
    if second < 0.0 and abs(first) < -2.0 * second:
        return -0.5 * first / second
    return 1.0 if first > 0.0 else -1.0
