"""The response of a linear system that moves between given ones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import control
import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm, matrix_balance

from robustpolish.base.arrays import Array, Matrix
from robustpolish.base.checks import described, invalid, matrix, misfit
from robustpolish.base.jit import njit
from robustpolish.linear.systems import as_system

# The exact response of a linear system to an input that is linear between its samples.

_BLOCK = 2048
"""Samples after which memory is used again: what stays in the cache of a core is not waited for."""


class Response(NamedTuple):
    """Outputs, shape (samples, p), and states, shape (samples, n), at the sampling times."""

    outputs: Array
    states: Array


def linear_response(
    system: control.StateSpace,
    time: ArrayLike,
    inputs: ArrayLike,
    initial_state: ArrayLike | None = None,
) -> Response:
    """Simulate a linear system on a uniform time grid.

    In continuous time the input is taken as linear between its samples (first-order hold), for
    which the matrix exponential gives the response without a time-stepping error. In discrete
    time the samples are the steps.

    Parameters
    ----------
    system : control.StateSpace
        n states, m inputs, p outputs; it may be unstable.
    time : array_like, shape (samples,)
        Uniform, rising, in s; for a discrete system spaced by its sampling time.
    inputs : array_like, shape (samples, m)
        One column per input.
    initial_state : array_like, shape (n,), optional
        Zero by default.

    Returns
    -------
    Response

    Raises
    ------
    InvalidInputError
        If the grid is not uniform or shapes do not fit.

    Notes
    -----
    The step is that of Franklin, Powell and Workman, Digital Control of Dynamic Systems,
    section 6.3.3, taken from one exponential of the augmented matrix (Van Loan, IEEE Trans.
    Automatic Control 23, 1978). The states are balanced first, so that stiff springs and
    soft dampers do not spoil the exponential.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from robustpolish.simulation import linear_response
    >>> time = np.linspace(0, 1, 11)
    >>> lag = control.ss([[-1.0]], [[1.0]], [[1.0]], 0)
    >>> outputs, _ = linear_response(lag, time, np.ones((11, 1)))
    >>> bool(abs(outputs[-1, 0] - (1 - np.exp(-1))) < 1e-14)
    True
    """
    system = as_system("system", system)
    n, m = system.nstates, system.ninputs
    t = np.array(time, dtype=float).ravel()
    u = matrix("inputs", inputs, (t.size, m))
    step = uniform_step(t)
    x0 = np.zeros(n)
    if initial_state is not None:
        x0 = matrix("initial_state", np.reshape(initial_state, (1, -1)), (1, n))[0]
    A, B, C, D = (np.asarray(M, dtype=float) for M in (system.A, system.B, system.C, system.D))

    if system.dt is not None and system.dt != 0:
        if system.dt is not True and t.size > 1 and not np.isclose(step, system.dt, rtol=1e-6):
            want = f"the system's sampling time, {system.dt:.6g} s"
            raise misfit("time", f"a step of {step:.6g} s", want, "Resample the signals to it.")
        transition, now, later = A, B, None
    else:
        transition, now, later = first_order_hold(A, B, step)
    transition_T, samples = np.ascontiguousarray(transition.T), t.size
    states, outputs = np.empty((samples, n)), np.empty((samples, C.shape[0]))
    states[:1] = x0
    for begin in range(0, samples, _BLOCK):
        end = min(begin + _BLOCK, samples)
        last = min(end, samples - 1)  # no step leads beyond the last sample
        drive = u[begin:last] @ now.T
        if later is not None:
            drive += u[begin + 1 : last + 1] @ later.T
        _recursion(transition_T, drive, states[begin : last + 1])
        outputs[begin:end] = states[begin:end] @ C.T + u[begin:end] @ D.T
    return Response(outputs, states)


def first_order_hold(A: Array, B: Array, step: float) -> tuple[Array, Array, Array]:
    """Discretise dx/dt = A x + B u exactly for an input that is linear within the step.

    Parameters
    ----------
    A, B : ndarray
        Shapes (n, n) and (n, m).
    step : float
        Time step in s.

    Returns
    -------
    transition, now, later : ndarray
        x[k+1] = transition x[k] + now u[k] + later u[k+1].
    """
    n, m = B.shape
    if n == 0:
        return np.zeros((0, 0)), np.zeros((0, m)), np.zeros((0, m))
    _, scaling = matrix_balance(A, permute=False)
    weights = np.asarray(np.diag(scaling), dtype=float)
    augmented = np.zeros((n + 2 * m, n + 2 * m))
    augmented[:n, :n] = A * step * (weights / weights[:, None])
    scaled_B = B * step / weights[:, None]
    # The size of u is free: choose it so that B does not dominate the norm of the exponent.
    size = np.max(np.abs(scaled_B), axis=0, initial=0)
    size[size == 0] = 1.0
    augmented[:n, n : n + m] = scaled_B / size
    augmented[n : n + m, n + m :] = np.eye(m)
    exponential: Array = np.asarray(expm(augmented), dtype=float)
    transition = exponential[:n, :n] * (weights[:, None] / weights)
    constant = exponential[:n, n : n + m] * weights[:, None] * size
    ramp = exponential[:n, n + m :] * weights[:, None] * size
    return transition, constant - ramp, ramp


def uniform_step(t: Array) -> float:
    """Return the step of a uniform, rising grid in s; 0 for a single sample."""
    if t.size < 2:
        return 0.0
    steps = np.diff(t)
    step = float((t[-1] - t[0]) / (t.size - 1))
    # Time stamps are rounded to a few units in the last place of the largest of them.
    rounding = 1e-6 * step + 4 * np.spacing(np.max(np.abs(t)))
    if not np.isfinite(t).all() or step <= 0 or np.max(np.abs(steps - step)) > rounding:
        shown = described(f"steps from {np.min(steps):.6g} to {np.max(steps):.6g} s")
        raise invalid("time", shown, "a uniform, rising grid", "Resample the signals.")
    return step


def linear_recursion(transition: Array, drive: Array, start: Array | None = None) -> Array:
    """Return x[k+1] = transition x[k] + drive[k] from a start, zero by default, one row longer."""
    states = np.zeros((len(drive) + 1, len(transition)))
    if start is not None:
        states[0] = start
    _recursion(np.ascontiguousarray(transition.T), np.ascontiguousarray(drive), states)
    return states


@njit(cache=True, nogil=True)
def _recursion(transition_T: Array, drive: Array, states: Array) -> None:
    """x[k+1] = transition x[k] + drive[k] from the first row of states on.

    The transition is transposed for quick access.
    """
    n = states.shape[1]
    for k in range(drive.shape[0]):
        for i in range(n):
            states[k + 1, i] = drive[k, i]
        for j in range(n):
            x = states[k, j]
            for i in range(n):
                states[k + 1, i] += transition_T[j, i] * x


StateMatrices = tuple[Matrix, Matrix, Matrix, Matrix]


def varying_response(
    vertices: Sequence[StateMatrices], shares: Array, step: float, inputs: Array
) -> Response:
    """Simulate x' = A x + B u, y = C x + D u whose matrices are mixtures that change with time.

    Parameters
    ----------
    vertices : sequence of (ndarray, ndarray, ndarray, ndarray)
        A, B, C and D of each system, continuous.
    shares : ndarray, shape (samples, vertices)
        Of each in the mixture at every sample.
    step : float
        Between samples, in s.
    inputs : ndarray, shape (samples, m)
        Linear between samples.

    Returns
    -------
    Response

    Raises
    ------
    InvalidInputError
        If shapes do not fit.

    Notes
    -----
    Within a step the matrices are held at the mean of both ends, for which the response is exact;
    the error falls with the square of the step. At rest it is that of
    :func:`linear_response`.

    Examples
    --------
    A lag whose rate goes from 1 to 3:

    >>> import numpy as np
    >>> lags = [tuple(np.array([[v]]) for v in (-rate, rate, 1.0, 0.0)) for rate in (1.0, 3.0)]
    >>> t = np.linspace(0, 1, 101)
    >>> response = varying_response(lags, np.stack([1 - t, t], axis=1), 0.01, np.ones((101, 1)))
    >>> bool(abs(response.outputs[-1, 0] - (1 - np.exp(-2))) < 1e-12)
    True
    """
    u = matrix("inputs", inputs, (None, vertices[0][1].shape[1]))
    weights = matrix("shares", shares, (len(u), len(vertices)))
    if not step > 0:
        raise invalid("step", described(f"{step:.6g} s"), "a positive step", "Check the time axis.")

    A, B, C, D = (np.array(each) for each in zip(*vertices, strict=True))
    states = np.zeros((len(u), len(vertices[0][0])))
    last, held = None, None
    for i in range(len(u) - 1):
        middle = (weights[i] + weights[i + 1]) / 2
        if held is None or last is None or not np.array_equal(middle, last):
            mixed, into = (np.tensordot(middle, M, axes=1) for M in (A, B))
            last, held = middle, first_order_hold(mixed, into, step)
        transition, now, later = held
        states[i + 1] = transition @ states[i] + now @ u[i] + later @ u[i + 1]
    outputs = np.einsum("tv,vij,tj->ti", weights, C, states, optimize=True)
    outputs += np.einsum("tv,vij,tj->ti", weights, D, u, optimize=True)
    return Response(outputs, states)
