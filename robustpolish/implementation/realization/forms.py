"""Coordinates in which a controller is computed: balanced, modal, or sections of second order."""

from __future__ import annotations

from typing import Any

import control
import numpy as np
from scipy import linalg
from scipy.sparse.csgraph import connected_components

from robustpolish.arrays import Matrix
from robustpolish.implementation.sampled.matrices import named_like
from robustpolish.implementation.sampled.scaled_map import border_scale
from robustpolish.models.plant.blocks import matrices_of
from robustpolish.validation import one_of

FORMS = ("balanced", "modal", "sections")

_TOGETHER = 1e8
"""Condition of eigenvectors beyond which modes are not split: their sum would cancel."""


def realized(controller: control.StateSpace, form: str) -> control.StateSpace:
    """Return the same controller in other coordinates.

    Parameters
    ----------
    controller : control.StateSpace
        Discrete.
    form : {"balanced", "modal", "sections"}
        "balanced": the states are as easy to reach as to see; what is unstable is left apart.
        "modal": a block of one or two states per mode, as large at its input as at its output.
        "sections": the same blocks side by side, sections of first and second order
        with A = [[a, b], [-b, a]], scaled to inputs of one unit, as fixed scales need it.
        Modes that are almost multiple stay together in a block.

    Returns
    -------
    control.StateSpace

    Raises
    ------
    InvalidInputError
        If the form is unknown.
    """
    one_of("form", form, FORMS)
    A, B, C, D = matrices_of(controller)
    if not A.size:
        return controller
    even = border_scale(A, np.abs(B).max(axis=1), np.abs(C).max(axis=0))
    A, B, C = A * even / even[:, None], B / even[:, None], C * even
    T = _balancing(A, B, C) if form == "balanced" else _modes(A)
    A, B, C = _solved(T, A @ T), _solved(T, B), C @ T
    if form != "balanced":
        A = _blocks_only(A)
        A, B, C = _scaled(A, B, C, to_input=form == "sections")
    return named_like(controller, (A, B, C, D), controller.dt)


def _balancing(A: Matrix, B: Matrix, C: Matrix) -> Matrix:
    """Return the coordinates in which both Gramians are equal and diagonal.

    An unstable controller is slowed down to a circle that holds its poles, which gives its states
    comparable sizes all the same.
    """
    size = max(float(np.abs(np.linalg.eigvals(A)).max()) / 0.999, 1.0)
    slow = A / size
    n = len(A)
    floor = 1e-14
    P = np.asarray(linalg.solve_discrete_lyapunov(slow, B @ B.T), dtype=float)
    Q = np.asarray(linalg.solve_discrete_lyapunov(slow.T, C.T @ C), dtype=float)
    P = (P + P.T) / 2 + floor * max(np.linalg.norm(P, 2), 1e-300) * np.eye(n)
    Q = (Q + Q.T) / 2 + floor * max(np.linalg.norm(Q, 2), 1e-300) * np.eye(n)
    reach, see = _root(P), _root(Q)
    U, hankel, Vt = np.linalg.svd(see.T @ reach)
    del U
    return reach @ Vt.T / np.sqrt(hankel)


def _root(M: Matrix) -> Matrix:
    values, vectors = np.linalg.eigh(M)
    return vectors * np.sqrt(np.maximum(values, values[-1] * 1e-16))


def _modes(A: Matrix) -> Matrix:
    """Return real coordinates that split A into its modes, as far as they can be told apart."""
    values, vectors = np.linalg.eig(A)
    columns = []
    for value, vector in zip(values, vectors.T, strict=True):
        if value.imag > 0:
            columns += [vector.real, vector.imag]
        elif value.imag == 0:
            columns.append(vector.real)
    T = np.array(columns).T
    if T.shape == A.shape and np.linalg.cond(T) < _TOGETHER:
        return T
    return _groups(A)


def _groups(A: Matrix) -> Matrix:
    """Split A by its ordered Schur form only where the parts are far enough from each other."""
    n = len(A)
    found: Any = linalg.schur(A, output="real")
    form, basis = found[:2]
    T = basis.copy()
    start = 0
    cuts = [i for i in range(1, n) if form[i, i - 1] == 0]
    for cut in cuts:
        X = linalg.solve_sylvester(
            form[start:cut, start:cut], -form[cut:, cut:], -form[start:cut, cut:]
        )
        if np.isfinite(X).all() and np.linalg.norm(X) < _TOGETHER**0.5:
            step = np.eye(n)
            step[start:cut, cut:] = X
            form = _solved(step, form @ step)
            T = T @ step
            start = cut
    return T


def _blocks_only(A: Matrix) -> Matrix:
    """Clear what rounding left outside of the blocks."""
    level = 1e-12 * max(float(np.abs(A).max()), 1e-300)
    return np.where(np.abs(A) > level, A, 0.0)


def _scaled(A: Matrix, B: Matrix, C: Matrix, to_input: bool) -> tuple[Matrix, Matrix, Matrix]:
    """Scale states by powers of two: those of a block alike, so that its form is kept."""
    links = (np.abs(A) + np.abs(A.T)) > 0
    label = connected_components(links, directed=False)[1]
    T = np.ones(len(A))
    for block in np.unique(label):
        own = label == block
        size = float(np.abs(B[own]).max(initial=0.0))
        seen = float(np.abs(C[:, own]).max(initial=0.0))
        if to_input and size > 0:
            T[own] = size
        elif size > 0 and seen > 0:
            T[own] = np.sqrt(size / seen)
    T = np.exp2(np.round(np.log2(T)))
    return A * T / T[:, None], B / T[:, None], C * T


def _solved(left: Matrix, right: Matrix) -> Matrix:
    return np.asarray(np.linalg.solve(left, right), dtype=float)
