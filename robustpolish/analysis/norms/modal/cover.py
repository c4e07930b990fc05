"""Pieces of the frequency axis that are as long as the distance to the nearest pole lets them."""

from __future__ import annotations

import numpy as np

from robustpolish.analysis.norms.modal.modal_form import ModalForm
from robustpolish.arrays import Vector

# A piece from sinh(k STEP) to sinh((k + 1) STEP) is at most 0.46 times as long to either side of
# its middle as the middle is away from a pole beside zero, one unit from the axis.
_STEP = 0.9
FAR = 4.0
"""Beyond so many times the largest pole, the response is expanded about infinity."""


def first_pieces(form: ModalForm) -> tuple[Vector, Vector]:
    """Return middles and half lengths of pieces that cover 0 to FAR times the largest pole.

    They are short beside poles near the axis and grow with the distance from these, so that a
    power series about the middle of each converges quickly.
    """
    heights = np.unique(np.concatenate([[0.0], np.abs(form.imag).astype(float)]))
    distance = _distances(form, heights)
    zero = 0.45 * distance[0]
    end = FAR * float(np.hypot(form.real, form.imag.astype(float)).max())
    kept = heights[1:] > 1.5 * zero
    marks = np.concatenate([[zero], heights[1:][kept], [end]])
    scale = np.concatenate([[distance[0]], distance[1:][kept], [np.inf]])
    left, right = marks[:-1], marks[1:]
    middle = np.where(np.isinf(scale[1:]), right, 0.5 * (left + right))
    edges = np.concatenate(
        [
            _graded(left, middle - left, scale[:-1], 1.0),
            _graded(right[:-1], (right - middle)[:-1], scale[1:-1], -1.0),
            marks,
        ]
    )
    edges = np.unique(edges)
    apart = np.diff(edges, prepend=0.0) > 1e-12 * edges
    apart[-1] = True
    centre, half = overlapping(edges[apart][:-1], edges[apart][1:])
    return np.concatenate([[0.0], centre]), np.concatenate([[zero * (1 + 1e-15)], half])


def overlapping(left: Vector, right: Vector) -> tuple[Vector, Vector]:
    """Return middles and half lengths of pieces that reach at least from `left` to `right`."""
    centre = 0.5 * (left + right)
    half = 0.5 * (right - left)
    return centre, half * (1 + 1e-15) + 1e-15 * np.abs(centre)


def _distances(form: ModalForm, heights: Vector) -> Vector:
    """Return how far each height is from the nearest pole."""
    imag = form.imag.astype(float)
    nearest = [
        np.hypot(heights[i : i + 64, None] - imag, form.real).min(axis=1)
        for i in range(0, heights.size, 64)
    ]
    return np.concatenate(nearest)


def _graded(start: Vector, length: Vector, scale: Vector, sign: float) -> Vector:
    """Return points that leave `start` with growing steps, up to `length` away."""
    reach = np.arcsinh(length / scale)
    count = np.maximum(np.ceil(reach / _STEP), 1.0).astype(int)
    which = np.repeat(np.arange(count.size), count)
    number = np.arange(which.size) - np.repeat(np.cumsum(count) - count, count) + 1
    step = (reach / count)[which]
    return start[which] + sign * scale[which] * np.sinh(number * step)
