"""The square of the H2 norm with bounds, in double precision or in ball arithmetic."""

from __future__ import annotations

import math
import warnings

import numpy as np
import scipy.linalg as sla
from flint import arb, arb_mat

from robustpolish.analysis._eigen import EPS
from robustpolish.analysis._exact import ExactModel, identity, precision
from robustpolish.analysis._realisation import Realisation

Bounds = tuple[float, float]


def energy(model: Realisation) -> Bounds:
    """Bound trace(C X C') + trace(D D') for a stable system, X its controllability Gramian.

    The residual R of the computed X bounds its error: the solution operator
    of a stable Lyapunov equation is positive, so -r I <= R <= r I gives
    |error| <= r W, with W the Gramian of a unit disturbance on every state.
    """
    A, C, n = model.A, model.C, model.states
    source = model.B @ model.B.T
    X, W = (_gramian(A, Q, model.discrete) for Q in (source, np.eye(n)))
    size = np.linalg.norm
    if model.discrete:
        residual = A @ X @ A.T - X + source
        rounding = size(A) ** 2 * size(X) + size(X) + size(source)
    else:
        residual = A @ X + X @ A.T + source
        rounding = 2 * size(A) * size(X) + size(source)
    r = float(size(residual, 2) + 4 * EPS * n * rounding)
    square = float(np.sum((C @ X) * C))
    error = 2 * r * float(np.sum((C @ W) * C))
    error += 4 * EPS * n * float(np.sum((np.abs(C) @ np.abs(X)) * np.abs(C)))
    if model.discrete:
        square += float(np.sum(model.D**2))
    if not (math.isfinite(square) and math.isfinite(error) and np.all(np.diag(W) > 0)):
        return 0.0, math.inf
    return square - error, square + error


def _gramian(A: np.ndarray, Q: np.ndarray, discrete: bool) -> np.ndarray:
    with warnings.catch_warnings():  # bad conditioning shows in the residual
        warnings.simplefilter("ignore")
        solve = sla.solve_discrete_lyapunov if discrete else sla.solve_continuous_lyapunov
        X = solve(A, Q if discrete else -Q)
    return (X + X.T) / 2


def exact_energy(model: ExactModel) -> Bounds:
    """Enclose the same number to double precision, whatever the damping."""
    if model.is_zero():
        return 0.0, 0.0
    bits = 192
    while True:
        with precision(bits):
            ball = _energy_ball(model)
            if ball.is_finite() and ball > 0 and ball.rel_accuracy_bits() >= 60:
                return _outward(ball)
        bits *= 2


def _outward(ball: arb) -> Bounds:
    with precision(53):
        middle = float(ball)
    return middle * (1 - 2 * EPS), middle * (1 + 2 * EPS)


def _energy_ball(model: ExactModel) -> arb:
    """Sum the Gramian's series by doubling: X <- X + M X M', M <- M M."""
    M, source, direct = _discrete_source(model)
    X, C = source, arb_mat(model.C)
    seen = (C * X * C.transpose()).trace() + direct
    for _ in range(20_000):
        gain = _square_size(M)
        if not gain.is_finite():
            return gain
        if gain < 0.5:
            rest = _square_size(C) * gain * X.trace() / (1 - gain)
            if rest < seen * arb(2) ** -70 or (not seen > 0 and gain < arb(2) ** -4000):
                return seen + arb(rest.mid() / 2, rest.mid() / 2 + rest.rad())
        X = X + M * X * M.transpose()
        M = M * M
        seen = (C * X * C.transpose()).trace() + direct
    return arb(0, math.inf)


def _discrete_source(model: ExactModel) -> tuple[arb_mat, arb_mat, arb]:
    """Return M and Q with X = M X M' + Q, and the energy that D passes directly."""
    one = identity(model.states)
    if model.discrete:
        D = arb_mat(model.D)
        B = arb_mat(model.B)
        return arb_mat(model.A), B * B.transpose(), _square_size(D)
    shifted = arb_mat(model.A - one)
    M = shifted.solve(arb_mat(model.A + one))
    B = shifted.solve(arb_mat(model.B))
    return M, B * B.transpose() * 2, arb(0)


def _square_size(M: arb_mat) -> arb:
    return sum((entry * entry for entry in M.entries()), arb(0))
