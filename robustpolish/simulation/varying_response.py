"""The response of a linear system that moves between given ones."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robustpolish.arrays import Array, Matrix
from robustpolish.simulation.linear_response import Response, first_order_hold
from robustpolish.validation import described, invalid, matrix

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
            last, held = (
                middle,
                first_order_hold(
                    np.tensordot(middle, A, axes=1), np.tensordot(middle, B, axes=1), step
                ),
            )
        transition, now, later = held
        states[i + 1] = transition @ states[i] + now @ u[i] + later @ u[i + 1]
    outputs = np.einsum("tv,vij,tj->ti", weights, C, states, optimize=True)
    outputs += np.einsum("tv,vij,tj->ti", weights, D, u, optimize=True)
    return Response(outputs, states)
