"""Riccati equations in long arithmetic, with hundreds of digits where doubles have sixteen.

The eigenvalues of the Hamiltonian come from its characteristic polynomial, a first solution from
the factor of its unstable ones, and Newton's method makes it as exact as the arithmetic.
"""

from __future__ import annotations

from typing import Any

import flint
import numpy as np

from robustpolish.base.budget import check_deadline, now
from robustpolish.linear.arithmetic.balls import Ball, ball, block, identity, part, symmetric, zeros
from robustpolish.linear.proofs.bounded_real import hamiltonian

# What decides in long arithmetic; every size is 2^-(bits / share), with these shares.
# By so much the coefficients of the characteristic polynomial are changed, so that equal
# eigenvalues, as twins have them, come apart by its root and can be found.
_APART = 2.0
# Eigenvalues so near to the axis, relative to their size, lie on it: equal ones that were split
# count too, and none of a plant whose zeros lie 1e-8 beside the axis does.
_AXIS = 9.6
# A solution whose equation holds so well, relative to its terms, is exact.
_RESIDUAL = 3.0
# Beside the largest entry of a solution, in balanced units, smaller eigenvalues are rounding.
_NOTHING = 4.0
# Newton steps; each doubles the digits, and the first solution has a tenth of them. A step that
# leaves more of the error than this ends them: rounding has taken over.
_REFINEMENTS, _PROGRESS = 6, 1e-3
# Bits that finding the roots may take, over those of the arithmetic: where two nearly agree they
# come bit by bit. So much longer twice the bits take, at most.
_MOST_BITS, _TWICE_THE_BITS = 64, 4.0


class UndecidedError(ArithmeticError):
    """The digits do not suffice; more of them may."""


def stabilising_solution(A: Ball, R: Ball, Q: Ball) -> Ball | None:
    r"""Return the stabilising solution of A'X + XA + XRX + Q = 0.

    Parameters
    ----------
    A, R, Q : flint.arb_mat, n x n
        R and Q symmetric, of any sign. What encloses zero is zero.

    Returns
    -------
    flint.arb_mat or None
        None where the Hamiltonian has eigenvalues on the axis, so that there is none.

    Raises
    ------
    UndecidedError, ZeroDivisionError
        If the digits do not suffice.
    """
    n = A.nrows()
    if n == 0:
        return zeros(0, 0)
    A, R, Q = (
        flint.arb_mat(n, n, [flint.arb(0) if x.contains(0) else x.mid() for x in M.entries()])
        for M in (A, R, Q)
    )
    H = hamiltonian(A, R, Q)
    unstable = _unstable_factor(H)
    if unstable is None:
        return None
    # Any matrix of full rank will do, as its columns' shares of the unstable part go.
    start = ball(np.random.default_rng(0).standard_normal((2 * n, n)))
    X, before = _graph(_applied(unstable, H, start)), flint.arb("inf")
    for _ in range(_REFINEMENTS):
        closed = (A + R * X).mid()
        if not largest(Q) > 0 and not largest(X * R) > largest(A) * _tiny(_RESIDUAL):
            return zeros(n, n)  # what is left is rounding, however small
        error = (A.transpose() * X + X * A + X * R * X + Q).mid()
        terms = max(largest(X * A), largest(X * R * X), largest(Q))
        share = largest(error) / terms
        if not share > _tiny(_RESIDUAL):
            if is_surely_stable(closed):
                return X
            break
        if share > before * _PROGRESS:
            break
        before = share
        X = (X + _lyapunov(closed, error)).mid()
    raise UndecidedError


def has_eigenvalue_below(M: Ball, level: Any) -> bool:
    """Tell whether a matrix whose eigenvalues are all real surely has one below a level.

    That is so if and only if the coefficients of the characteristic polynomial about the level do
    not alternate in sign.
    """
    n = M.nrows()
    coefficients = (M - identity(n) * level).charpoly().coeffs()
    return any(c * (-1) ** (n - k) < 0 for k, c in enumerate(coefficients))


def is_surely_stable(A: Ball) -> bool:
    """Tell whether all eigenvalues have negative real parts, by Routh's array."""
    coefficients = A.charpoly().coeffs()[::-1]
    above, row = coefficients[::2], coefficients[1::2]
    while row:
        if not (above[0] > 0 and row[0] > 0):
            return False
        ratio, padded = above[0] / row[0], [*row[1:], flint.arb(0)]
        below = [a - ratio * b for a, b in zip(above[1:], padded, strict=False)]
        above, row = row, below
    return True


def is_surely_not_semidefinite(X: Ball) -> bool:
    """Tell whether a solution has a negative eigenvalue that is more than rounding."""
    if not X.nrows():
        return False
    some = any(float(abs(X[i, i]).upper()) for i in range(X.nrows()))
    return some and has_eigenvalue_below(X, -largest(X) * _tiny(_NOTHING))


def largest(M: Ball) -> Any:
    """Return the largest absolute value of a matrix's entries."""
    return max((abs(entry).mid() for entry in M.entries()), default=flint.arb(0))


def _tiny(share: float) -> Any:
    return flint.arb(2) ** -int(flint.ctx.prec / share)


def _unstable_factor(H: Ball) -> list[Any] | None:
    """Return the polynomial of a Hamiltonian's unstable eigenvalues; None if some lie on the axis.

    The characteristic polynomial is one of squares, whose roots come in half the number. Those of
    eigenvalues on the axis are real and negative.
    """
    draw = np.random.default_rng(0)
    enclosed_squares = flint.arb_poly(H.charpoly().coeffs()[::2])
    changed = [1 + _tiny(_APART) * int(draw.integers(1, 1000)) for _ in enclosed_squares.coeffs()]
    coefficients = zip(enclosed_squares.coeffs(), changed, strict=True)
    squares = flint.acb_poly([flint.acb(c.mid() * change) for c, change in coefficients])
    slope = squares.derivative()
    factor = flint.acb_poly([1])
    for enclosed in _roots(squares):
        root = enclosed.mid()
        for _ in range(2 * int(np.log2(flint.ctx.prec))):
            root = (root - squares(root) / slope(root)).mid()
        value = root.sqrt().mid()
        if not abs(value.real) > abs(value) * _tiny(_AXIS):
            # A real root is proven by a change of sign.
            beside = abs(root.real) * _tiny(_AXIS)
            below, above = (enclosed_squares(root.real + d) for d in (-beside, beside))
            changes = (below < 0 and above > 0) or (below > 0 and above < 0)
            if root.real + beside < 0 and changes:
                return None
            raise UndecidedError
        factor *= flint.acb_poly([-value if value.real > 0 else value, 1])
    return [c.real.mid() for c in factor.coeffs()]


def _roots(polynomial: Any) -> list[Any]:
    """Enclose the roots with twice the bits again and again, as long as there is time for it."""
    bits, spent = flint.ctx.prec, 0.0
    while bits <= _MOST_BITS * flint.ctx.prec:
        check_deadline(_TWICE_THE_BITS * spent)
        begins = now()
        try:
            return polynomial.roots(maxprec=bits)
        except ValueError:  # some are not told apart
            bits, spent = 2 * bits, now() - begins
    raise UndecidedError


def _applied(polynomial: list[Any], H: Ball, start: Ball) -> Ball:
    """Return a polynomial of H times `start`."""
    value = start * polynomial[-1]
    for coefficient in polynomial[-2::-1]:
        value = (H * value + start * coefficient).mid()
    return value


def _graph(basis: Ball) -> Ball:
    """Return the symmetric X of the subspace [I; X]."""
    n = basis.ncols()
    upper, lower = part(basis, slice(0, n)), part(basis, slice(n, None))
    return symmetric(upper.transpose().solve(lower.transpose(), algorithm="approx")).mid()


def _lyapunov(A: Ball, Q: Ball) -> Ball:
    """Return X of A'X + XA + Q = 0, from the eigenvalues of -A' without finding them."""
    n = A.nrows()
    H = hamiltonian(A, zeros(n, n), Q)
    start = block([[identity(n)], [zeros(n, n)]])
    unstable = (-1 * A).charpoly().coeffs()
    return _graph(_applied([c.mid() for c in unstable], H, start))
