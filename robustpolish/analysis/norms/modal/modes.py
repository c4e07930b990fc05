"""A modal form as compiled code reads it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robustpolish.analysis.norms.modal.modal_form import ModalForm
from robustpolish.arrays import AnyArray, Vector
from robustpolish.exact.realisation import size


class Modes(NamedTuple):
    """The arrays of a :class:`ModalForm` in the layout that compiled functions expect.

    Attributes
    ----------
    real : ndarray, shape (n,)
    high, low : ndarray, shape (n,)
        Imaginary parts as sums of two doubles.
    residues : ndarray of complex, shape (n, p * m)
    sizes, rows, shown, moved, signal_errors, stretch : ndarray, shape (n,)
    coupling : ndarray, shape (n, n) or (1, n)
        With one row: the diagonal alone.
    D : ndarray of complex, shape (p, m)
    D_size, D_error : float
        Norm of D, and its rounding error.
    discrete : bool
    """

    real: Vector
    high: Vector
    low: Vector
    residues: AnyArray
    sizes: Vector
    rows: Vector
    shown: Vector
    moved: Vector
    signal_errors: Vector
    stretch: Vector
    coupling: Vector
    D: AnyArray
    D_size: float
    D_error: float
    discrete: bool


def modes_of(form: ModalForm) -> Modes:
    """Lay the arrays of a modal form out."""
    high = form.imag.astype(float)
    return Modes(
        form.real,
        high,
        (form.imag - high).astype(float),
        np.ascontiguousarray(form.residues),
        form.sizes,
        form.rows,
        form.shown,
        form.moved,
        form.signal_errors,
        form.stretch,
        np.ascontiguousarray(form.coupling.reshape(-1, form.states)),
        np.ascontiguousarray(form.D),
        size(form.D),
        form.D_error,
        form.discrete,
    )
