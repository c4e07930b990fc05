r"""The square of the H2 norm in modal coordinates.

.. math:: \|G\|_2^2 = -\sum_{j,k} \frac{\langle R_j, R_k \rangle}{\lambda_j + \bar\lambda_k}

with the residues R of a continuous system without D.
"""

from __future__ import annotations

import math

import numpy as np

from robustpolish.analysis.norms.gramian import Energy
from robustpolish.analysis.norms.modal.modal_form import ModalForm
from robustpolish.analysis.poles.eigen import EPS


def modal_energy(form: ModalForm) -> Energy | None:
    """Enclose it; None where the modal form does not prove that the system is stable.

    With E the diagonal matrix of the inverse decay rates, the L2 norms w of the states' impulse
    responses are at most those of the modes alone plus E F w, and what F changes in the response
    is at most |c| E F w.
    """
    if form.discrete or not form.stable:
        return None
    rates = -form.real
    products = form.residues @ form.residues.conj().T
    n = form.states
    apart = np.empty((n, n), complex)
    apart.real = np.add.outer(rates, rates)
    apart.imag = -np.subtract.outer(form.imag, form.imag)
    square = float(np.sum((products / apart).real))
    sizes = np.outer(form.sizes, form.sizes) / np.abs(apart)
    rounding = EPS * (8 * n + 64) * float(sizes.sum())
    small = form.rows / rates
    if not small.max() < 0.5:
        return None
    alone = form.moved / np.sqrt(2 * rates)
    w = alone + small * alone.max() / (1 - small.max())
    moved = float((form.shown / rates) @ form.coupling @ w)
    moved += float(np.sum(form.signal_errors / np.sqrt(2 * rates)))
    moved *= 1 + 1e-9
    if not (math.isfinite(rounding + moved) and square > rounding):
        return None
    low, high = math.sqrt(square - rounding), math.sqrt(square + rounding)
    lower = max(0.0, low - moved) ** 2 * (1 - 8 * EPS)
    return Energy(square, lower, (high + moved) ** 2 * (1 + 8 * EPS))
