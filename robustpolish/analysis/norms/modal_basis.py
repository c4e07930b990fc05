"""A basis in which an inequality's matrix is near diagonal and of order one, for the solver."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.exact.realisation import Realisation


@dataclass(frozen=True, eq=False)
class ModalModel:
    """A system in modal coordinates, x = basis * (modal x).

    Attributes
    ----------
    A, B, C, D : ndarray
        Matrices in these coordinates.
    basis : ndarray, shape (n, n)
    weights : ndarray, shape (n,)
        Inverse roots of twice each mode's decay rate: multiplied from both sides they
        make A^T K + K A of the size of K.
    """

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix
    basis: Matrix
    weights: Matrix

    def back(self, K: Matrix) -> Matrix:
        """Map the matrix of a quadratic form in modal coordinates back, exactly symmetric."""
        inverse = np.linalg.inv(self.basis)
        K = inverse.T @ K @ inverse
        return (K + K.T) / 2


def modal_model(model: Realisation) -> ModalModel:
    """Choose the real modal basis, or the unit basis where that is ill conditioned."""
    basis, rates, pairs = _modal_basis(model.A)
    weights = 1 / np.sqrt(2 * rates)
    basis = basis * _even(np.linalg.solve(basis, model.B), model.C @ basis, weights, pairs)
    A = np.linalg.solve(basis, model.A @ basis)
    B, C = np.linalg.solve(basis, model.B), model.C @ basis
    return ModalModel(A, B, C, model.D, basis, weights)


def rebased(model: ModalModel, K: Matrix) -> ModalModel:
    """Change to the coordinates in which K is the identity, after a first solution."""
    try:
        basis = np.linalg.inv(np.linalg.cholesky(K)).T
    except np.linalg.LinAlgError:
        return model
    step = np.linalg.solve(model.basis, basis)
    A = np.linalg.solve(step, model.A @ step)
    rates = np.maximum(-np.diag(A), 1e-12 * np.abs(A).max())
    B, C = np.linalg.solve(step, model.B), model.C @ step
    return ModalModel(A, B, C, model.D, basis, 1 / np.sqrt(2 * rates))


def _even(B: Matrix, C: Matrix, weights: Matrix, pairs: list[int]) -> Matrix:
    """Return factors of the basis that make inputs and outputs act alike on each mode."""
    reach, show = np.linalg.norm(B, axis=1) * weights, np.linalg.norm(C, axis=0) * weights
    for i in pairs:  # both vectors of a pair share their factor
        reach[i : i + 2] = np.linalg.norm(reach[i : i + 2])
        show[i : i + 2] = np.linalg.norm(show[i : i + 2])
    return np.sqrt(np.maximum(reach, 1e-3) / np.maximum(show, 1e-3))


def _modal_basis(A: Matrix) -> tuple[Matrix, Matrix, list[int]]:
    n = A.shape[0]
    plain = np.eye(n), np.ones(n), []
    values, vectors = np.linalg.eig(A)
    columns, rates, pairs = [], [], []
    for value, vector in zip(values, vectors.T, strict=True):
        if value.imag == 0:
            columns.append(vector.real)
            rates.append(abs(value.real))
        elif value.imag > 0:
            pairs.append(len(columns))
            columns += [vector.real, vector.imag]
            rates += [abs(value.real)] * 2
    basis = np.array(columns).T if n else np.zeros((0, 0))
    if n == 0 or not np.linalg.cond(basis) < 1e8 or min(rates) <= 0:
        return plain
    return basis, np.array(rates), pairs
