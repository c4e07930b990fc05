"""Pieces of the frequency axis that are as long as the distance to the nearest pole lets them."""

from __future__ import annotations

import numpy as np

from robustpolish.compiling import njit

# A piece from sinh(k STEP) to sinh((k + 1) STEP) is at most 0.46 times as long to either side of
# its middle as the middle is away from a pole beside zero, one unit from the axis.
_STEP = 0.9
FAR = 4.0
"""Beyond so many times the largest pole, the response is expanded about infinity."""


@njit(cache=True, error_model="numpy")
def first_pieces(real, imag):  # type: ignore[no-untyped-def]  # compiled
    """Return middles and half lengths of pieces that cover 0 to FAR times the largest pole.

    They are short beside poles near the axis and grow with the distance from these, so that a
    power series about the middle of each converges quickly.

    Parameters
    ----------
    real, imag : ndarray, shape (n,)
        Of the poles, by rising imaginary part.
    """
    marks, scales, count = _marks(real, imag)
    total = 0
    for k in range(count - 1):
        one, other = _steps(marks, scales, count, k)
        total += one + other
    edges = np.empty(total + 1)
    edges[0], size = marks[0], 1
    for k in range(count - 1):
        left, right = marks[k], marks[k + 1]
        one, other = _steps(marks, scales, count, k)
        middle = right if other == 0 else 0.5 * (left + right)
        reach = np.arcsinh((middle - left) / scales[k])
        for number in range(1, one + 1):
            edges[size] = left + scales[k] * np.sinh(number * reach / one)
            size += 1
        if other > 0:
            reach = np.arcsinh((right - middle) / scales[k + 1])
            for number in range(other - 1, -1, -1):
                edges[size] = right - scales[k + 1] * np.sinh(number * reach / other)
                size += 1
    edges[total] = marks[count - 1]
    return _between(edges)


@njit(cache=True, error_model="numpy")
def _between(edges):  # type: ignore[no-untyped-def]  # compiled
    """Return the pieces between edges that rise, and the one from below zero to the first."""
    centre, half = np.empty(edges.size), np.empty(edges.size)
    centre[0], half[0] = 0.0, edges[0] * (1.0 + 1e-15)
    count, start = 1, edges[0]
    for k in range(1, edges.size):
        if edges[k] - start > 1e-12 * edges[k] or k == edges.size - 1:
            centre[count], half[count] = overlapping(start, edges[k])
            count, start = count + 1, edges[k]
    return centre, half, count


@njit(cache=True, error_model="numpy")
def _marks(real, imag):  # type: ignore[no-untyped-def]  # compiled
    """Return the heights of the poles with the two ends, the distances from the nearest, a count.

    Poles come in pairs, so that those of the lower half plane tell nothing new.
    """
    n = real.size
    furthest, nearest = 0.0, np.inf
    for i in range(n):
        size = np.hypot(real[i], imag[i])
        furthest, nearest = max(furthest, size), min(nearest, size)
    marks, scales = np.empty(n + 2), np.empty(n + 2)
    marks[0], scales[0], count = 0.45 * nearest, nearest, 1
    for k in range(n):
        height = imag[k]
        if height > 1.5 * marks[0] and height > marks[count - 1]:
            square = np.inf
            for i in range(n):
                away = height - imag[i]
                square = min(square, real[i] * real[i] + away * away)
            marks[count], scales[count] = height, max(np.sqrt(square), 1e-300)
            count += 1
    marks[count], scales[count] = FAR * furthest, np.inf
    return marks, scales, count + 1


@njit(cache=True, error_model="numpy")
def _steps(marks, scales, count, k):  # type: ignore[no-untyped-def]  # compiled
    """Return the numbers of steps away from a mark, and towards the next one from half way."""
    length = marks[k + 1] - marks[k]
    if k == count - 2:
        return max(int(np.ceil(np.arcsinh(length / scales[k]) / _STEP)), 1), 0
    one = np.ceil(np.arcsinh(0.5 * length / scales[k]) / _STEP)
    other = np.ceil(np.arcsinh(0.5 * length / scales[k + 1]) / _STEP)
    return max(int(one), 1), max(int(other), 1)


@njit(cache=True, error_model="numpy")
def overlapping(left, right):  # type: ignore[no-untyped-def]  # compiled
    """Return middle and half length of a piece that reaches at least from `left` to `right`."""
    centre = 0.5 * (left + right)
    half = 0.5 * (right - left)
    return centre, half * (1.0 + 1e-15) + 1e-15 * abs(centre)
