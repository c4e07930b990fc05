r"""Power series of the response about the middles of pieces of the axis, with their errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robustpolish.analysis.norms.modal.cover import FAR
from robustpolish.analysis.norms.modal.modal_form import ModalForm
from robustpolish.analysis.norms.modal.wide_product import Wide
from robustpolish.analysis.poles.eigen import EPS
from robustpolish.arrays import AnyArray, Vector

ORDER = 8
"""Number of terms."""
# Half lengths over the distance to the nearest pole; beyond, the series are not used.
_LONGEST = 0.55
# Entries of the largest array that is held at a time.
_CHUNK = 400_000


@dataclass(frozen=True, eq=False)
class Expansion:
    """G(c + h t) = sum of terms[j] t^j + what `error` bounds, for t from -1 to 1.

    Attributes
    ----------
    centre, half : ndarray, shape (k,)
        c and h; the piece that reaches to infinity has the centre inf and x = h/t.
    terms : ndarray of complex, shape (ORDER, k, p, m)
    error : ndarray, shape (k,)
        Bounds of the rest of the series, of the poles' and vectors' errors and of rounding.
        Infinite where the piece is too long for the series.
    """

    centre: Vector
    half: Vector
    terms: AnyArray
    error: Vector

    def chosen(self, which: AnyArray) -> Expansion:
        """Return some of the pieces."""
        return Expansion(
            self.centre[which], self.half[which], self.terms[:, which], self.error[which]
        )


def expand(form: ModalForm, centre: Vector, half: Vector) -> Expansion:
    """Expand the response about the middles of pieces."""
    step = max(1, _CHUNK // (ORDER * max(form.states, 1)))
    found = [
        _expand(form, centre[i : i + step], half[i : i + step]) for i in range(0, centre.size, step)
    ]
    terms = np.concatenate([terms for terms, _ in found], axis=1)
    return Expansion(centre, half, terms, np.concatenate([error for _, error in found]))


def _expand(form: ModalForm, centre: Vector, half: Vector) -> tuple[AnyArray, Vector]:
    k, n = centre.size, form.states
    gap = np.empty((k, n), complex)
    gap.real = -form.real
    gap.imag = centre.astype(Wide)[:, None] - form.imag
    inverse = 1 / gap
    near = np.abs(inverse)
    share = half[:, None] * near
    longest = share.max(axis=1)
    share = np.minimum(share, _LONGEST)
    powers = np.empty((ORDER, k, n), complex)
    powers[0] = inverse
    inverse = inverse * (-1j * half)[:, None]
    for j in range(1, ORDER):
        np.multiply(powers[j - 1], inverse, out=powers[j])
    terms = (powers.reshape(ORDER * k, n) @ form.residues).reshape(ORDER, k, *form.D.shape)
    terms[0] += form.D
    nearest = near / (1 - share)
    rest = (nearest * share**ORDER) @ form.sizes
    error = rest + _errors(form, nearest, form.weight(np.abs(centre), half))
    return terms, np.where(longest <= _LONGEST, error, np.inf)


def expand_far(form: ModalForm, start: float) -> Expansion:
    """Expand the response in start/x from `start` on, at least FAR times the largest pole."""
    poles = form.real + 1j * form.imag.astype(float)
    ratio = poles / (1j * start)
    terms = np.empty((ORDER, 1, *form.D.shape), complex)
    terms[0, 0] = form.D
    power = np.full(form.states, 1 / (1j * start))
    for j in range(1, ORDER):
        terms[j, 0] = (power @ form.residues).reshape(form.D.shape)
        power = power * ratio
    nearest = np.full((1, form.states), FAR / (FAR - 1) / start * (1 + 1e-9))
    # Within the weight of discrete time, |1 - i x| <= 1 + x, x cancels the x of the distance.
    weight = np.array([1 + start]) if form.discrete else np.ones(1)
    rest = nearest @ (form.sizes * np.abs(ratio) ** (ORDER - 1))
    error = rest + _errors(form, nearest, weight)
    return Expansion(np.array([np.inf]), np.array([start]), terms, error)


def _errors(form: ModalForm, nearest: AnyArray, weight: Vector) -> Vector:
    """Bound rounding and what the errors of the modal form do, within each piece.

    With E the diagonal matrix of 1/|z - eigenvalue|, the solution w of (1 - E F) w = E b is at
    most E |b| plus the row sums of E F times the largest entry of w, and what F changes in the
    response is |c| E F w.
    """
    n = form.states
    rounding = EPS * (4 * n + 256) * (nearest @ form.sizes) + EPS * np.linalg.norm(form.D)
    E = nearest * (form.stretch * weight[:, None])
    small = E * form.rows
    share = small.max(axis=1, initial=0.0)
    v = E * form.moved
    largest = v.max(axis=1, initial=0.0) / (1 - np.minimum(share, 0.5))
    w = v + small * largest[:, None]
    u = E * form.shown
    coupled = u * form.coupling if form.coupling.ndim == 1 else u @ form.coupling
    moved = np.sum(coupled * w, axis=1) + E @ form.signal_errors
    error = (rounding + form.D_error + moved) * (1 + 1e-9)
    return np.where(share < 0.5, error, np.inf)
