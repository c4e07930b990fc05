"""The square of the H2 norm with bounds, in double precision or in ball arithmetic."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg as sla
from flint import arb, arb_mat
from numpy.typing import NDArray

from robustpolish.base.arrays import Matrix
from robustpolish.base.budget import check_deadline
from robustpolish.linear.arithmetic.balls import precision
from robustpolish.linear.arithmetic.rational import ExactModel, identity
from robustpolish.linear.arithmetic.realisation import Realisation
from robustpolish.linear.eigen import EPS


@dataclass(frozen=True)
class EnergyBounds:
    """Square of an H2 norm with bounds; the upper one is infinite where nothing is known."""

    square: float
    lower: float
    upper: float

    @property
    def width(self) -> float:
        """Half the width of the bounds, relative to the upper one."""
        if math.isinf(self.upper):
            return math.inf
        return (self.upper - self.lower) / (2 * self.upper) if self.upper > 0 else 0.0


ExtendedArray = NDArray[Any]
_WIDE: Any = np.finfo(np.longdouble).eps


def h2_energy(model: Realisation, tolerance: float) -> EnergyBounds:
    r"""Bound trace(C X C') + trace(D D') for a stable system, X its controllability Gramian.

    The residual R, formed in extended precision where the machine has it, refines X until
    the bounds are close or refining helps no more. It bounds the error too: the solution
    operator of a stable Lyapunov equation is positive, so -E <= R <= E, with E the diagonal
    matrix of the row sums of \|R\|, gives -W <= error <= W, with W the Gramian of E.
    """
    X = np.zeros(model.A.shape, dtype=np.longdouble)
    B = model.B.astype(np.longdouble)
    residual = B @ B.T
    best = EnergyBounds(0.0, 0.0, math.inf)
    for step in range(6):
        X = X + _gramian(model.A, residual.astype(float), model.discrete)
        residual, rounding = _residual(model, X)
        found = _bounds(model, X, np.abs(residual) + rounding)
        if step and not found.width < 0.5 * best.width:
            break
        best = found
        if best.width <= tolerance:
            break
    return best


def _bounds(model: Realisation, X: ExtendedArray, residual: ExtendedArray) -> EnergyBounds:
    """Bound the energy that X shows; `residual` bounds the entries of its residual."""
    C = model.C.astype(np.longdouble)
    rows = np.sum(residual, axis=1).astype(float)
    W = _gramian(model.A, np.diag(rows), model.discrete)
    error = 2 * float(np.sum((model.C @ W) * model.C))  # twice, for the rounding of W itself
    error += float(4 * _WIDE * X.shape[0] * np.sum((np.abs(C) @ np.abs(X)) * np.abs(C)))
    square = float(np.sum((C @ X) * C))
    if model.discrete:
        square += float(np.sum(model.D**2))
    if not (math.isfinite(square) and error >= 0 and np.all(np.diag(W) >= 0)):
        return EnergyBounds(0.0, 0.0, math.inf)
    error += 4 * EPS * abs(square)
    return EnergyBounds(square, max(square - error, 0.0), square + error)


def _residual(model: Realisation, X: ExtendedArray) -> tuple[ExtendedArray, Matrix]:
    """Return the residual of the Lyapunov equation at a symmetric X, and a bound of its rounding.

    Products in extended precision take most of the time of a large system, so that there is one
    and its transpose; the bound, for which doubles do, has room for their own rounding.
    """
    A, B = model.A.astype(np.longdouble), model.B.astype(np.longdouble)
    a, b, x = np.abs(model.A), np.abs(model.B), np.abs(X).astype(float)
    source, grain = B @ B.T, b @ b.T
    if model.discrete:
        residual = A @ X @ A.T - X + source
        grain = grain + a @ x @ a.T + x
    else:
        moved, size = A @ X, a @ x
        residual = moved + moved.T + source
        grain = grain + size + size.T
    return residual, grain * float(2 * (2 * A.shape[0] + B.shape[1]) * _WIDE)


def _gramian(A: Matrix, Q: Matrix, discrete: bool) -> Matrix:
    with warnings.catch_warnings():  # bad conditioning shows in the residual
        warnings.simplefilter("ignore")
        solve = sla.solve_discrete_lyapunov if discrete else sla.solve_continuous_lyapunov
        X = solve(A, Q if discrete else -Q)
    return (X + X.T) / 2


def exact_h2_energy(model: ExactModel) -> EnergyBounds:
    """Enclose the same number to double precision, whatever the damping."""
    bits = 192 if model.states <= 40 else 448
    while True:
        with precision(bits):
            try:
                ball = _energy_ball(model)
            except ZeroDivisionError:  # too few bits to invert
                ball = arb(0, math.inf)
            if ball.is_finite() and ball > 0 and ball.rel_accuracy_bits() >= 60:
                return _outward(ball)
        if bits >= 768 and model.is_zero():
            return EnergyBounds(0.0, 0.0, 0.0)
        bits *= 2


def _outward(ball: arb) -> EnergyBounds:
    with precision(53):
        middle = float(ball)
    return EnergyBounds(middle, middle * (1 - 2 * EPS), middle * (1 + 2 * EPS))


def _energy_ball(model: ExactModel) -> arb:
    """Sum the Gramian's series by doubling: X <- X + M X M', M <- M M."""
    M, source, direct = _discrete_source(model)
    X, C = source, arb_mat(model.C)
    seen = (C * X * C.transpose()).trace() + direct
    for _ in range(20_000):
        check_deadline()
        gain = _square_size(M)
        if gain < 0.5:
            rest = _square_size(C) * gain * X.trace() / (1 - gain)
            if rest < seen * arb(2) ** -70 or (not seen > 0 and gain < arb(2) ** -4000):
                return seen + arb(rest.mid() / 2, rest.mid() / 2 + rest.rad())
        elif not gain.is_finite() or gain.rel_accuracy_bits() < 16:
            break  # more bits are needed
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
