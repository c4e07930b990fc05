"""The matrices of a step of a linear system with nonlinear port forces.

The linear part is integrated exactly (the inputs are linear between samples), the port
forces by the exponential Runge-Kutta method ETDRK4 of Cox and Matthews (2002), J. Comput.
Phys. 176, 430-455, their internal states by the matching classical stages. Stiff linear modes
therefore cost no small steps; only stiff or sharp effects do.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm, matrix_balance

from robustpolish.arrays import Array


class StepMatrices(NamedTuple):
    """Transition matrices of one substep, see :func:`step_matrices`."""

    half: Array
    full: Array
    half_now: Array
    half_later: Array
    full_now: Array
    full_later: Array
    half_force: Array
    first: Array
    middle: Array
    last: Array


class Ahead(NamedTuple):
    """What a substep needs, put together once: products and sums are the kernel's whole cost.

    Motions at the ports, first all displacements and then all velocities, are linear in the state,
    the signals at both ends and the forces at the stages before, like the next state. All matrices
    are transposed: rows are what is known, columns what follows.

    Attributes
    ----------
    linear : ndarray, shape (n + 2 signals, n + 6 ports)
        State and signals to the next state without forces, and to the motions at the start, the
        middle and the end.
    by_force : ndarray, shape (ports, 2 ports)
        The force of the stage before to the motions in the middle.
    by_first, by_last : ndarray, shape (ports, 2 ports)
        The force at the start, and the second one in the middle, to the motions at the end.
    first, middle, last : ndarray, shape (ports, n)
        Forces at the start, in the middle (the sum of both) and at the end to the next state.
    """

    linear: Array
    by_force: Array
    by_first: Array
    by_last: Array
    first: Array
    middle: Array
    last: Array


def ahead(m: StepMatrices, motion: Sequence[Array]) -> Ahead:
    """Return the matrices of a substep as the kernel takes them.

    Parameters
    ----------
    m : StepMatrices
    motion : sequence of ndarray
        (Qs, Qw, Vs, Vw): displacements ``Qs s + Qw w`` and velocities ``Vs s + Vw w`` at the ports.
    """
    of_state, of_signals = np.vstack(motion[::2]), np.vstack(motion[1::2])
    none = np.zeros_like(of_signals)
    # the signal in the middle is the mean of those at both ends
    middle = np.hstack([m.half, m.half_now + m.half_later / 2, m.half_later / 2])
    end = m.half @ middle
    end[:, len(m.half) :] += np.hstack([m.half_now / 2, m.half_now / 2 + m.half_later])
    rows = (
        np.hstack([m.full, m.full_now, m.full_later]),
        np.hstack([of_state, of_signals, none]),
        of_state @ middle + np.hstack([0 * of_state, of_signals / 2, of_signals / 2]),
        of_state @ end + np.hstack([0 * of_state, none, of_signals]),
    )
    parts = (
        np.vstack(rows),
        of_state @ m.half_force,
        of_state @ (m.half @ m.half_force - m.half_force),
        2 * of_state @ m.half_force,
        m.first, m.middle, m.last,
    )  # fmt: skip
    return Ahead(*(np.ascontiguousarray(part.T) for part in parts))


def step_matrices(A: Array, B: Array, G: Array, step: float) -> StepMatrices:
    """Return the matrices of a substep of ``dx/dt = A x + B w + G f(x)``.

    Parameters
    ----------
    A, B, G : ndarray, shapes (n, n), (n, signals), (n, ports)
    step : float
        Length of the substep in s.
    """
    m = B.shape[1]
    columns = np.hstack([B, G])
    weights = _balanced(A)
    E, p1, p2, p3 = _phi(A, columns, step, weights)
    E2, h1, h2, _ = _phi(A, columns, step / 2, weights)
    b, g = slice(0, m), slice(m, None)
    parts = (
        E2, E,
        h1[:, b] - h2[:, b], h2[:, b],
        p1[:, b] - p2[:, b], p2[:, b],
        h1[:, g],
        (p1 - 3 * p2 + 4 * p3)[:, g], (2 * p2 - 4 * p3)[:, g], (4 * p3 - p2)[:, g],
    )  # fmt: skip
    return StepMatrices(*(np.ascontiguousarray(part) for part in parts))


def _balanced(A: Array) -> Array:
    """Return the sizes of states with which the norm of A is smallest."""
    if not A.size:
        return np.ones(0)
    return np.asarray(np.diag(matrix_balance(A, permute=False)[1]), dtype=np.float64)


def _phi(A: Array, B: Array, h: float, weights: Array) -> tuple[Array, Array, Array, Array]:
    """Return exp(A h) and h phi_k(A h) B for k = 1, 2, 3, states being of these sizes."""
    n, m = B.shape
    if n == 0:
        empty = np.zeros((0, m))
        return np.zeros((0, 0)), empty, empty, empty
    scaled = B * h / weights[:, None]
    size = np.max(np.abs(scaled), axis=0, initial=0.0)
    size[size == 0] = 1.0
    big = np.zeros((n + 3 * m, n + 3 * m))
    big[:n, :n] = A * h * (weights / weights[:, None])
    big[:n, n : n + m] = scaled / size
    big[n : n + m, n + m : n + 2 * m] = np.eye(m)
    big[n + m : n + 2 * m, n + 2 * m :] = np.eye(m)
    exponential: Array = np.array(expm(big)[:n], dtype=float)
    E = exponential[:, :n] * (weights[:, None] / weights)
    phis = [exponential[:, n + k * m : n + (k + 1) * m] * weights[:, None] * size for k in range(3)]
    return E, phis[0], phis[1], phis[2]
