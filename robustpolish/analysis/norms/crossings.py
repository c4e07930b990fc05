"""The frequencies at which a singular value equals a given gain, in exact arithmetic."""

from __future__ import annotations

from math import isqrt, lcm

from flint import fmpq, fmpq_mat, fmpq_poly, fmpz_mat, fmpz_poly

from robustpolish.analysis.poles.exact_poles import positive_roots
from robustpolish.deadline import look_at_the_clock
from robustpolish.exact.rational import ExactModel, identity, joined


def crossings(model: ExactModel, square: fmpq) -> list[fmpq]:
    """Return the frequencies x >= 0 at which a singular value of G is the root of `square`.

    The Hamiltonian matrix (continuous time) or the symplectic pencil (discrete
    time) has an eigenvalue on the stability boundary at just these
    frequencies. Its characteristic polynomial is even; as a polynomial in x^2
    it is computed without rounding, so an empty list is a proof.

    Parameters
    ----------
    model : ExactModel
        No pole of it may lie on the stability boundary.
    square : fmpq
        Square of the gain, above that of D.

    Returns
    -------
    list of fmpq
        Ascending, each to about 128 bits.
    """
    if model.discrete or any(entry != 0 for entry in model.D.entries()):
        polynomial = _pencil_polynomial(model, square)
    else:
        polynomial = _hamiltonian_polynomial(model, square)
    return sorted(_square_root(root.real.mid().fmpq()) for root, _ in positive_roots(polynomial))


def _square_root(value: fmpq) -> fmpq:
    """Return the root to 100 bits or more."""
    shift = 200
    while value != 0 and (int(value.p) << shift) // int(value.q) < 1 << 220:
        shift += 200
    return fmpq(isqrt((int(value.p) << shift) // int(value.q)), 1 << (shift // 2))


def _hamiltonian_polynomial(model: ExactModel, square: fmpq) -> fmpz_poly:
    A = model.A
    n = model.states
    top = (model.B * model.B.transpose()) / square
    bottom = model.C.transpose() * model.C
    rows = [A.table()[i] + top.table()[i] for i in range(n)]
    rows += [
        [-entry for entry in row] + [-A[j, i] for j in range(n)]
        for i, row in enumerate(bottom.table())
    ]
    coefficients = fmpq_mat(rows).charpoly().numer().coeffs()
    return fmpz_poly([(-1) ** k * int(c) for k, c in enumerate(coefficients[::2])])


def _pencil_polynomial(model: ExactModel, square: fmpq) -> fmpz_poly:
    """Interpolate the determinant of the extended pencil from its values at s = 0, 1, 2, ..."""
    constant, slope = _pencil(model, square)
    n = model.states
    values = []
    for k in range(n + 1):
        look_at_the_clock()
        values.append(fmpq((constant + slope * k).det()))
    nodes = [-k * k for k in range(n + 1)]  # x^2 = -s^2
    for level in range(1, n + 1):  # divided differences
        for i in range(n, level - 1, -1):
            values[i] = (values[i] - values[i - 1]) / (nodes[i] - nodes[i - level])
    polynomial = fmpq_poly([0])
    for value, node in zip(reversed(values), reversed(nodes), strict=True):
        polynomial = polynomial * fmpq_poly([-node, 1]) + value
    return fmpz_poly(polynomial.numer().coeffs())


def _pencil(model: ExactModel, square: fmpq) -> tuple[fmpz_mat, fmpz_mat]:
    """Return integer matrices whose combination `constant + s slope` is singular at crossings.

    The unknowns are state, co-state, input and output; in discrete time the
    rows of the states are multiplied by 1 - s after z = (1 + s)/(1 - s).
    """
    A, B, C, D = model.A, model.B, model.C, model.D
    n, m, p = model.states, B.ncols(), C.nrows()
    one, zero = identity(n), fmpq_mat
    At, Ct, Bt = A.transpose(), C.transpose(), B.transpose()
    if model.discrete:
        states = [[A - one, zero(n, n), B, zero(n, p)], [zero(n, n), one - At, zero(n, m), -Ct]]
        slopes = [[-A - one, zero(n, n), -B, zero(n, p)], [zero(n, n), -one - At, zero(n, m), -Ct]]
    else:
        states = [[A, zero(n, n), B, zero(n, p)], [zero(n, n), -At, zero(n, m), -Ct]]
        slopes = [
            [-one, zero(n, n), zero(n, m), zero(n, p)],
            [zero(n, n), -one, zero(n, m), zero(n, p)],
        ]
    outputs = [
        [C, zero(p, n), D, -identity(p)],
        [zero(m, n), Bt, identity(m) * (-square), D.transpose()],
    ]
    still = [
        [zero(p, n), zero(p, n), zero(p, m), zero(p, p)],
        [zero(m, n), zero(m, n), zero(m, m), zero(m, p)],
    ]
    return _whole_rows(joined(states + outputs).table(), joined(slopes + still).table())


def _whole_rows(first: list[list[fmpq]], second: list[list[fmpq]]) -> tuple[fmpz_mat, fmpz_mat]:
    """Clear the denominators row by row, with the same factor in both matrices."""
    whole: tuple[list, list] = ([], [])
    for one, two in zip(first, second, strict=True):
        common = lcm(*(int(entry.q) for entry in one + two))
        for target, row in zip(whole, (one, two), strict=True):
            target.append([int(entry.p) * (common // int(entry.q)) for entry in row])
    return fmpz_mat(whole[0]), fmpz_mat(whole[1])
