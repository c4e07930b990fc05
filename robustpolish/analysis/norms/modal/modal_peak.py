"""The peak of the gain by branch and bound over the frequency axis, in modal coordinates.

Pieces whose gain is surely below the best one found are done; the others are cut about the place
where their gain seems to be largest, and a larger gain found there is climbed to its top. When none
is left, the bound is proven up to the errors of the modal form.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from robustpolish.analysis.norms.modal.bound import below, sizes, squares
from robustpolish.analysis.norms.modal.cover import FAR, first_pieces, overlapping
from robustpolish.analysis.norms.modal.expansion import Expansion, expand, expand_far
from robustpolish.analysis.norms.modal.modal_form import ModalForm
from robustpolish.arrays import AnyArray, Vector


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
    pieces = expand(form, *first_pieces(form))
    best = _improved(form, pieces, _at_infinity(form))
    end = FAR * _largest_pole(form)
    pieces = _joined([_about(form, pieces, best.frequency), expand_far(form, end)])
    done, most, level = 0, 100 + 60 * form.states, 0.0
    while True:
        width = _width(best, tolerance)
        if not width <= widest or done > most or pieces.half.max() > 1e6 * end:
            return None
        level = max(level, best.gain * (1 + width))  # what is done stays so
        pieces, hints = _open(pieces, level)
        if not pieces.centre.size:
            return replace(best, upper=level)
        done += pieces.centre.size
        pieces = _cut(form, pieces, hints)
        best = _improved(form, pieces, best)


def _largest_pole(form: ModalForm) -> float:
    return float(np.hypot(form.real, form.imag.astype(float)).max())


def _width(best: ModalPeak, tolerance: float) -> float:
    """Return the width of the bracket that the errors of the form allow."""
    if not best.lower > 0:
        return math.inf
    return max(tolerance, 4 * (best.gain - best.lower) / best.gain)


def _open(pieces: Expansion, level: float) -> tuple[Expansion, Vector]:
    """Return the pieces on which the gain may reach a level, and where it seems to be largest."""
    left = pieces.chosen(~(sizes(pieces) < level))
    usable = np.isfinite(left.error)
    hints = np.zeros(left.centre.size)
    closed = np.zeros(left.centre.size, bool)
    if usable.any():
        closed[usable], hints[usable] = below(squares(left.chosen(usable)), level)
    return left.chosen(~closed), hints[~closed]


def _about(form: ModalForm, pieces: Expansion, frequency: float) -> Expansion:
    """Cut the piece that holds a frequency about it."""
    holds = np.abs(pieces.centre - frequency) <= pieces.half
    if not math.isfinite(frequency) or not holds.any():
        return pieces
    inside = pieces.chosen(holds)
    cut = _cut(form, inside, (frequency - inside.centre) / inside.half)
    return _joined([pieces.chosen(~holds), cut])


def _cut(form: ModalForm, pieces: Expansion, hints: Vector) -> Expansion:
    """Cut pieces in three, the middle part about the place that the hint tells.

    The one that reaches to infinity is cut in two.
    """
    last = np.isinf(pieces.centre)
    if last.any():
        start = pieces.half[last]
        parts = [
            expand(form, *overlapping(start, 2 * start)),
            expand_far(form, 2 * float(start[0])),
        ]
        if not last.all():
            parts.append(_cut(form, pieces.chosen(~last), hints[~last]))
        return _joined(parts)
    middle = np.clip(hints, -0.7, 0.7)
    part = np.where(np.isfinite(pieces.error), 0.3, 0.1) * (1 - np.abs(middle))
    marks = np.array([-np.ones_like(part), middle - part, middle + part, np.ones_like(part)])
    edges = pieces.centre + pieces.half * marks
    centre, half = overlapping(edges[:-1].ravel(), edges[1:].ravel())
    k = part.size
    centre[k : 2 * k] = pieces.centre + pieces.half * middle
    half[k : 2 * k] = pieces.half * part * (1 + 1e-9) + 4e-16 * np.abs(centre[k : 2 * k])
    return expand(form, centre, half)


def _joined(parts: list[Expansion]) -> Expansion:
    return Expansion(
        np.concatenate([part.centre for part in parts]),
        np.concatenate([part.half for part in parts]),
        np.concatenate([part.terms for part in parts], axis=1),
        np.concatenate([part.error for part in parts]),
    )


def _gains(G: AnyArray) -> Vector:
    """Return the largest singular value of each matrix."""
    if G.shape[-1] == 1:
        return np.linalg.norm(G[..., 0], axis=-1)
    return np.linalg.svd(G, compute_uv=False)[..., 0]


def _improved(form: ModalForm, pieces: Expansion, best: ModalPeak) -> ModalPeak:
    """Climb from the highest middle of all pieces if it is higher than what is known."""
    whole = np.linalg.norm(pieces.terms[0], axis=(1, 2))
    whole[np.isinf(pieces.centre)] = 0.0  # known from the start
    hopeful = np.flatnonzero(whole * math.sqrt(form.D.shape[1]) >= max(whole.max(), best.gain))
    if not hopeful.size:
        return best
    values = _gains(pieces.terms[0, hopeful])
    highest = int(values.argmax())
    if not values[highest] > best.gain * (1 + 1e-14):
        return best
    found = _climbed(form, pieces.chosen(hopeful[highest : highest + 1]), float(values[highest]))
    return found if found.gain > best.gain else best


def _climbed(form: ModalForm, here: Expansion, gain: float) -> ModalPeak:
    """Climb to a top of the gain by Newton's method."""
    at, half = here.centre, here.half
    for _ in range(12):
        trial = at + half * _step(here)
        if abs(trial - at) <= 1e-12 * half:
            break
        here = expand(form, trial, half)
        reached = float(_gains(here.terms[0])[0])
        if not reached > gain:
            break
        at, progress, gain = trial, reached - gain, reached
        if progress <= 1e-13 * gain:
            break
    top = expand(form, at, 0 * half)
    gain = float(_gains(top.terms[0])[0])
    lower = max(0.0, gain * (1 - 1e-14) - float(top.error[0]))
    return ModalPeak(abs(float(at[0])), gain, lower, math.inf)


def _at_infinity(form: ModalForm) -> ModalPeak:
    gain = float(_gains(form.D[None])[0])
    lower = max(0.0, gain * (1 - 1e-14) - 2 * form.D_error)
    return ModalPeak(math.inf, gain, lower, math.inf)


def _step(here: Expansion) -> float:
    """Return t of the top of the gain about a middle, at most 1 away."""
    found = squares(here)
    values, vectors = np.linalg.eigh(found.terms[0, 0])
    turned = vectors.conj().T @ found.terms[1:, 0] @ vectors
    first = float(turned[0, -1, -1].real)
    second = float(turned[1, -1, -1].real)
    apart = values[-1] - values[:-1]
    mixed = np.abs(turned[0, :-1, -1]) ** 2
    second += float(np.sum(mixed[apart > 0] / apart[apart > 0]))
    if second < 0 and abs(first) < -2 * second:
        return -first / (2 * second)
    return float(np.sign(first))
