"""The peak of the gain by branch and bound over the frequency axis, in modal coordinates.

Pieces whose gain is surely below the best one found are done; the others are cut about the place
where their gain seems to be largest, and a larger gain found there is climbed to its top. When none
is left, the bound is proven up to the errors of the modal form.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from robustpolish.base.arrays import EPS, AnyArray, Matrix, Vector
from robustpolish.base.budget import check_deadline
from robustpolish.base.jit import njit
from robustpolish.linear.arithmetic.exact import size
from robustpolish.linear.norms.modal_expansion import (
    FAR,
    ORDER,
    expand,
    expand_far,
    expansion_error,
    first_pieces,
    frobenius,
    overlapping,
)
from robustpolish.linear.stability import Eigensystem
from robustpolish.linear.systems import Realisation

# A system in modal coordinates, and bounds of everything that rounding left out of them.
#
# With any invertible matrix V, V^-1 A V = L + F with L diagonal. V and L are taken from the
# computed eigensystem; what is left in F follows from the residual A V - V L, formed in extended
# precision where the machine has it. So the response is enclosed whatever the quality of the
# eigensystem, which shows in the size of F only.
#
# Discrete systems are mapped to the imaginary axis by z = (1 + s)/(1 - s), mode by mode:
#
# .. math:: \frac{1}{z - \lambda} = \frac{1}{1 + \lambda}
#           \left(\frac{1 - q}{s - q} - 1\right), \qquad q = \frac{\lambda - 1}{\lambda + 1}.


# Products of matrices with more digits than doubles have, and bounds of their errors.

Wide: Any = np.longdouble
WIDE = float(np.finfo(Wide).eps)
"""Rounding unit of extended precision; that of doubles where the machine has no more."""

_SLICES = 3
# From so many columns on, sliced products are quicker than sums in extended precision.
_SLICED = 64


def extended_product(M: Matrix, V: AnyArray) -> tuple[AnyArray, Matrix]:
    """Multiply a real and a complex matrix.

    Large matrices are cut into slices of so few digits that doubles hold the products of these
    exactly, in whatever order they are summed [1]_.

    Returns
    -------
    product : ndarray of complex extended precision
    error : ndarray
        Bounds of the errors' magnitudes.

    References
    ----------
    .. [1] K. Ozaki, T. Ogita, S. Oishi, S. M. Rump, "Error-free transformations of matrix
       multiplication by using fast routines of matrix multiplication and its applications",
       Numerical Algorithms 59 (2012) 95-118.
    """
    inner, columns = V.shape
    if inner < _SLICED or columns < _SLICED:
        rounding = 4 * (inner + 8) * WIDE * (np.abs(M) @ np.abs(V))
        return _summed(M, np.real(V)) + 1j * _summed(M, np.imag(V)), rounding
    both, error = _sliced_product(M, np.hstack([np.real(V), np.imag(V)]))
    bound = error[:, :columns] + error[:, columns:]
    return both[:, :columns] + 1j * both[:, columns:], bound


def _summed(M: Matrix, V: Matrix) -> AnyArray:
    """Sum in extended precision, along memory."""
    rows, columns = np.ascontiguousarray(M, Wide), np.ascontiguousarray(V.T, Wide)
    return np.einsum("ij,kj->ik", rows, columns)


def _sliced_product(M: Matrix, V: Matrix) -> tuple[AnyArray, Matrix]:
    inner, columns = V.shape
    left, left_sizes = _slices(M, inner)
    turned, right_sizes = _slices(V.T, inner)
    right = [part.T for part in turned]
    total = np.zeros((M.shape[0], columns), Wide)
    for i in reversed(range(_SLICES)):  # the small ones first
        exact = left[i] @ np.hstack(right[: _SLICES - i])
        for j in reversed(range(_SLICES - i)):
            total += exact[:, j * columns : (j + 1) * columns]
    # What was left out: pairs of small slices, and what the slices do not hold.
    pairs = [(i, j) for i in range(_SLICES + 1) for j in range(_SLICES + 1) if i + j >= _SLICES]
    error = sum(np.outer(left_sizes[i], right_sizes[j]) for i, j in pairs) * inner
    rounding = 4 * _SLICES**2 * WIDE * inner * np.outer(left_sizes[0], right_sizes[0])
    return total, (error + rounding) * (1 + 1e-9)


def _slices(M: Matrix, inner: int) -> tuple[list[Matrix], list[Matrix]]:
    """Cut off the leading digits of each row in turn; return the largest entries of the rows too.

    The last of these belong to what remains.
    """
    digits = math.ceil((54 + math.log2(inner)) / 2)
    rest, parts, sizes = M, [], []
    for _ in range(_SLICES):
        largest = np.abs(rest).max(axis=1, initial=0.0)
        _, exponent = np.frexp(largest)
        shift = np.ldexp(1.0, exponent + digits)[:, None]
        part = (rest + shift) - shift
        rest = rest - part
        parts.append(part)
        sizes.append(np.maximum(largest, np.abs(part).max(axis=1, initial=0.0)))
    return parts, [*sizes, np.abs(rest).max(axis=1, initial=0.0)]


# Bounds are summed in doubles too; this covers it.
_OUTWARD = 1 + 1e-9


class Peak(NamedTuple):
    """The peak of the gain with bounds.

    Attributes
    ----------
    frequency : float
        In x, s = i x.
    gain, lower, upper : float
        The gain there, and bounds of the true peak.
    proof : str
        How the upper bound was found.
    """

    frequency: float
    gain: float
    lower: float
    upper: float
    proof: str = ""


class ModalForm(NamedTuple):
    """The response D + sum of residues / (s - pole), on the imaginary axis s = i x.

    It has at least as many outputs as inputs: a system with fewer is transposed, which keeps the
    gains. All errors bound magnitudes. The arrays are laid out for compiled functions.

    Attributes
    ----------
    real : ndarray, shape (n,)
        Real parts of the poles.
    high, low : ndarray, shape (n,)
        Imaginary parts as sums of two doubles.
    residues : ndarray of complex, shape (n, p * m)
    sizes : ndarray, shape (n,)
        Bounds of the norms of the residues.
    rows : ndarray, shape (n,)
        Row sums of `coupling`.
    shown, moved : ndarray, shape (n,)
        Norms of the columns of C V and of the rows of V^-1 B, their errors included.
    signal_errors : ndarray, shape (n,)
        What the errors of C V and V^-1 B make of each residue.
    stretch : ndarray, shape (n,)
        1 / |z - eigenvalue| is this times weight / |s - pole|.
    coupling : ndarray, shape (n, n) or (1, n)
        Bounds of the entries of F, in the coordinates of the given system; its diagonal alone
        where they are estimates.
    D : ndarray of complex, shape (p, m)
    D_size, D_error : float
        Norm of D, and its rounding error.
    discrete : bool
        Whether the weight is |1 - s|; otherwise it is one.
    stable : bool
        Whether discs around the computed eigenvalues that hold all true ones lie within the
        boundary of stability.
    """

    real: Vector
    high: Vector
    low: Vector
    residues: AnyArray
    sizes: Vector
    rows: Vector
    shown: Vector
    moved: Vector
    signal_errors: Vector
    stretch: Vector
    coupling: Vector
    D: AnyArray
    D_size: float
    D_error: float
    discrete: bool
    stable: bool


def modal_form(model: Realisation, spectrum: Eigensystem, proven: bool) -> ModalForm | None:
    """Bring a system to modal form; None if its eigenvectors do not span the space.

    Parameters
    ----------
    model : Realisation
        Rescaled.
    spectrum : Eigensystem
        Of its A.
    proven : bool
        False takes the estimated errors of the eigenvalues for `coupling`, which is quicker.
    """
    # Imports Numba, which takes as long as all the rest together.
    from robustpolish.linear.norms.modal_expansion import inverse, signals

    if model.D.shape[0] < model.D.shape[1]:
        A, B, C, D = model.A.T, model.C.T, model.B.T, model.D.T
        right, left = spectrum.left.conj(), spectrum.right.conj()
    else:
        A, B, C, D = model.A, model.B, model.C, model.D
        right, left = spectrum.right, spectrum.left
    rows = np.ascontiguousarray(right.T)
    X, gap, least = inverse(np.ascontiguousarray(left.T), rows)
    if not least > 1e-8:
        return None
    if not gap < 0.1 and spectrum.values.size > 1:  # multiple eigenvalues
        try:
            X, gap, _ = inverse(np.linalg.inv(right).conj(), rows)
        except np.linalg.LinAlgError:
            return None
    if not gap < 0.1:
        return None
    gap *= _OUTWARD
    if not proven:
        b, c, *errors = signals(X, rows, *(np.array(M, complex, order="C") for M in (B, C)))
        values, coupling = spectrum.values, spectrum.errors
        sums, reached, seen = coupling, (b, errors[0]), (c, errors[1])
    else:
        values, coupling = _remainder(A, right, X, spectrum.values.astype(np.clongdouble), gap)
        sums = coupling.sum(axis=1) * _OUTWARD
        reached, seen = _reached(B, right, X, gap), _seen(C, right)
    return _on_the_axis(model.discrete, values, coupling, sums, reached, seen, D)


def _remainder(
    A: AnyArray, V: AnyArray, X: AnyArray, values: AnyArray, gap: float
) -> tuple[AnyArray, Vector]:
    """Return better eigenvalues, and bounds of the entries of V^-1 A V - diag(eigenvalues)."""
    n = A.shape[0]
    product, rounding = extended_product(A, V)
    rounding = rounding + (8 * WIDE * np.abs(V) * np.abs(values)).astype(float)
    residual = (product - V * values).astype(complex)
    rounding = rounding + 2 * EPS * np.abs(residual)
    found, sizes = X @ residual, np.abs(X)
    error = sizes @ rounding + 4 * (n + 4) * EPS * (sizes @ np.abs(residual))
    # V^-1 is (1 - S)^-1 X with S = 1 - X V, so it adds at most this to every entry of a column.
    error = error + (np.abs(found) + error).max(axis=0) * (gap / (1 - gap))
    diagonal = np.arange(n)
    better = values + found[diagonal, diagonal]
    coupling = np.abs(found) + error
    coupling[diagonal, diagonal] = error[diagonal, diagonal]
    coupling[diagonal, diagonal] += (16 * WIDE * (1 + np.abs(values))).astype(float)
    return better, coupling * _OUTWARD


def _reached(B: AnyArray, V: AnyArray, X: AnyArray, gap: float) -> tuple[AnyArray, Vector]:
    """Return V^-1 B and bounds of the errors of its rows' norms."""
    b = X @ B.astype(complex)
    b = b + X @ _missing(B, V, b)[0]
    missing, rounding = _missing(B, V, b)
    error = np.abs(X) @ ((1 + 2 * EPS) * np.abs(missing) + rounding)
    error = error + error.max(axis=0, initial=0.0) * (gap / (1 - gap))
    return b, np.linalg.norm(error, axis=1) * _OUTWARD


def _missing(B: AnyArray, V: AnyArray, b: AnyArray) -> tuple[AnyArray, Vector]:
    """Return B - V b and a bound of its error."""
    (real, first), (imag, second) = extended_product(np.real(V), b), extended_product(np.imag(V), b)
    missing = (B - (real + 1j * imag)).astype(complex)
    return missing, 2 * (first + second) + 4 * WIDE * np.abs(B)


def _seen(C: AnyArray, V: AnyArray) -> tuple[AnyArray, Vector]:
    """Return C V and bounds of the errors of its columns' norms."""
    exact, grain = extended_product(C, V)
    c = exact.astype(complex)
    return c, np.linalg.norm(grain + EPS * np.abs(c), axis=0) * _OUTWARD


def _on_the_axis(
    discrete: bool,
    values: AnyArray,
    coupling: Vector,
    rows: Vector,
    reached: tuple[AnyArray, Vector],
    seen: tuple[AnyArray, Vector],
    D: AnyArray,
) -> ModalForm | None:
    from robustpolish.linear.norms.modal_expansion import products

    (b, b_error), (c, c_error) = reached, seen
    n = values.size
    residues, shown, moved, bounds = products(
        np.ascontiguousarray(b), np.ascontiguousarray(c), b_error, c_error, _OUTWARD
    )
    direct, D_error = D.astype(complex), 0.0
    if discrete:
        sizes = np.abs(values)
        stable = bool((sizes + rows < 1).all())
        with np.errstate(divide="ignore", invalid="ignore"):
            factor = 1 / (1 + values)
            poles = (values - 1) * factor
            # |z|^2 - 1 without the cancellation of its square
            real = (sizes - 1) * (sizes + 1) * np.abs(factor) ** 2
        if not np.isfinite(poles).all():
            return None
        stretch = np.abs(factor).astype(float)
        direct = direct - (factor.astype(complex) @ residues).reshape(D.shape)
        D_error = 8 * (n + 8) * EPS * float((shown * moved * stretch).sum() + np.linalg.norm(D))
        residues = residues * (2 * factor**2).astype(complex)[:, None]
        sizes = 2 * shown * moved * stretch**2
        imag = poles.imag
    else:
        stable = bool((np.real(values) + rows < 0).all())
        stretch, real, imag, sizes = np.ones(n), np.real(values), np.imag(values), shown * moved
    high = imag.astype(float)
    return ModalForm(
        real.astype(float),
        high,
        (imag - high).astype(float),
        np.ascontiguousarray(residues),
        sizes * _OUTWARD,
        rows,
        bounds[0],
        bounds[1],
        bounds[2],
        stretch * _OUTWARD,
        np.ascontiguousarray(coupling.reshape(-1, n)),
        np.ascontiguousarray(direct),
        size(direct),
        D_error,
        discrete,
        stable,
    )


# Eigenvalues of small Hermitian matrices, compiled: calls of LAPACK would cost more than these.

_SWEEPS = 30


@njit(cache=True, error_model="numpy")
def eigen(H, V):  # type: ignore[no-untyped-def]  # compiled
    """Turn a Hermitian matrix to diagonal form by Jacobi's rotations.

    Parameters
    ----------
    H : ndarray of complex, shape (m, m)
        Overwritten: it becomes V* H V, with eigenvalues that rise along its diagonal.
    V : ndarray of complex, shape (m, m)
        Overwritten by the eigenvectors.
    """
    m = H.shape[0]
    for i in range(m):
        for j in range(m):
            V[i, j] = 1.0 if i == j else 0.0
    for _ in range(_SWEEPS):
        turned = False
        for i in range(m - 1):
            for j in range(i + 1, m):
                turned |= _rotate(H, V, i, j)
        if not turned:
            break
    for i in range(m - 1):  # the smallest that is left comes next
        least = i
        for j in range(i + 1, m):
            if H[j, j].real < H[least, least].real:
                least = j
        if least != i:
            for k in range(m):
                H[k, i], H[k, least] = H[k, least], H[k, i]
                V[k, i], V[k, least] = V[k, least], V[k, i]
            for k in range(m):
                H[i, k], H[least, k] = H[least, k], H[i, k]


@njit(cache=True, error_model="numpy")
def _rotate(H, V, i, j):  # type: ignore[no-untyped-def]  # compiled
    """Make an entry beside the diagonal zero; say whether there was something to do."""
    size = np.hypot(H[i, j].real, H[i, j].imag)
    low, high = H[i, i].real, H[j, j].real
    if not size > 1e-17 * (abs(low) + abs(high)):
        return False
    phase = H[i, j] / size
    half = 0.5 * (high - low) / size
    tangent = 1.0 / (abs(half) + np.sqrt(half * half + 1.0))
    if half < 0.0:
        tangent = -tangent
    cosine = 1.0 / np.sqrt(tangent * tangent + 1.0)
    sine = tangent * cosine
    back = np.conj(phase)
    for k in range(H.shape[0]):
        one, other = H[k, i], H[k, j] * back
        H[k, i] = cosine * one - sine * other
        H[k, j] = sine * one + cosine * other
        one, other = V[k, i], V[k, j] * back
        V[k, i] = cosine * one - sine * other
        V[k, j] = sine * one + cosine * other
    for k in range(H.shape[0]):
        one, other = H[i, k], H[j, k] * phase
        H[i, k] = cosine * one - sine * other
        H[j, k] = sine * one + cosine * other
    H[i, j] = 0.0
    H[j, i] = 0.0
    H[i, i] = H[i, i].real
    H[j, j] = H[j, j].real
    return True


@njit(cache=True, error_model="numpy")
def largest_gain(G):  # type: ignore[no-untyped-def]  # compiled
    """Return the largest singular value of a matrix with at most as many columns as rows."""
    m = G.shape[1]
    if m == 1:
        return frobenius(G)
    H, V = np.zeros((m, m), np.complex128), np.empty((m, m), np.complex128)
    add_adjoint_product(G, G, H)
    eigen(H, V)
    return np.sqrt(max(H[m - 1, m - 1].real, 0.0))


@njit(cache=True, error_model="numpy")
def add_adjoint_product(left, right, total):  # type: ignore[no-untyped-def]  # compiled
    """Add left* right to a matrix."""
    for i in range(left.shape[1]):
        for j in range(right.shape[1]):
            entry = complex(0.0, 0.0)
            for k in range(left.shape[0]):
                entry += np.conj(left[k, i]) * right[k, j]
            total[i, j] += entry


@njit(cache=True, error_model="numpy")
def _term_of_square(terms, order, product):  # type: ignore[no-untyped-def]  # compiled
    """Overwrite a matrix by the term of G* G of an order, for a series G."""
    product[:] = 0.0
    for a in range(order + 1):
        add_adjoint_product(terms[a], terms[order - a], product)


# Which pieces of the axis surely have no gain above a level.
#
# With G = sum of N_j t^j on a piece, the gain is below gamma just if the Hermitian matrix
# gamma^2 - G* G is positive definite for all t from -1 to 1. Its terms up to t^2, taken as
#
# .. math:: F_0 + t F_1 + t^2 F_2 = \begin{bmatrix} 1 \\ t \end{bmatrix}^*
#           \begin{bmatrix} F_0 - S & L \\ L^* & F_2 + S \end{bmatrix}
#           \begin{bmatrix} 1 \\ t \end{bmatrix} + (1 - t^2) S, \qquad L + L^* = F_1,
#
# are positive if for some S >= 0 and L the matrix in the middle is. In coordinates in which F_0 is
# diagonal and rises, S is diagonal and L lower triangular, so that no entry couples to a direction
# in which F_0 is nearly zero. Higher terms are at most their norms times t^2, which are taken from
# F_2. So a piece whose middle is a peak is settled in one step however near gamma is to it.


@njit(cache=True, error_model="numpy")
def sizes(terms, norms):  # type: ignore[no-untyped-def]  # compiled
    """Write down bounds of the terms' norms; return their sum."""
    total = 0.0
    for j in range(ORDER):
        norms[j] = frobenius(terms[j]) * (1.0 + 1e-12)
        total += norms[j]
    return total


@njit(cache=True, error_model="numpy")
def squares(terms, norms, total, error, found):  # type: ignore[no-untyped-def]  # compiled
    """Multiply a series by its adjoint.

    Parameters
    ----------
    terms : ndarray of complex, shape (ORDER, p, m)
    norms : ndarray, shape (ORDER,)
    total, error : float
        The sum of the norms, and the bound of what the series leaves out.
    found : ndarray of complex, shape (4, m, m)
        Overwritten by the terms of G* G up to t^2; the last one is room to work.

    Returns
    -------
    late : float
        Bound of the sum of the terms from t^3 on.
    error : float
        What the error of G makes, rounding included.
    """
    _, p, m = terms.shape
    late = 0.0
    for order in range(ORDER):
        product = found[min(order, 3)]
        _term_of_square(terms, order, product)
        if order > 2:
            late += frobenius(product) * (1.0 + 1e-12)
    for a in range(1, ORDER):
        for b in range(ORDER - a, ORDER):
            late += norms[a] * norms[b]
    rounding = EPS * (8 * p + 4 * m + 64) * total * total
    return late, (error * (2.0 * total + error) + rounding) * (1.0 + 1e-9)


@njit(cache=True, error_model="numpy")
def below(found, late, error, level):  # type: ignore[no-untyped-def]  # compiled
    """Say whether the gain is surely below `level` on a piece, and where it seems to be largest.

    Parameters
    ----------
    found, late, error
        What :func:`squares` gave.
    level : float

    Returns
    -------
    proven : bool
    peak : float
        An estimate of t, from -1 to 1; 0 where the gain has no peak.
    """
    m = found.shape[1]
    F0 = _level_remainder(found, 0, level)
    F1, F2 = _level_remainder(found, 1, 0.0), _level_remainder(found, 2, 0.0)
    V, room = np.empty((m, m), np.complex128), np.empty((m, m), np.complex128)
    # Coordinates in which F_0 is diagonal up to rounding; these need not be exact.
    eigen(F0, V)
    F0 = _level_remainder(found, 0, level)
    _turn(F0, V, room)
    _turn(F1, V, room)
    _turn(F2, V, room)
    trace = m * (late + error)
    for i in range(m):
        trace += abs(F0[i, i].real) + abs(F2[i, i].real)
    margin = 64 * (2 * m + 8) * EPS * trace
    slack, added = np.empty(m), 0.0
    for i in range(m):
        bend = F2[i, i].real - late
        for k in range(i + 1, m):  # what the later directions take from the bend
            held = max(F0[k, k].real, EPS * level * level)
            bend -= (F1[k, i].real ** 2 + F1[k, i].imag ** 2) / held
        slack[i] = max(_slack(max(F0[i, i].real, 0.0), F1[i, i].real, bend), 4.0 * margin)
        added += slack[i]  # at least the margin, for short pieces, whose other terms vanish
    margin += 64 * (2 * m + 8) * EPS * added
    M = np.empty((2 * m, 2 * m), np.complex128)
    for i in range(m):
        for j in range(m):
            M[m + j, i] = 0.0
        for j in range(i + 1):
            M[i, j], M[m + i, m + j] = F0[i, j], F2[i, j]
            M[m + j, i] = np.conj(F1[i, j]) * (0.5 if i == j else 1.0)
        M[i, i] -= slack[i] + error + margin
        M[m + i, m + i] += slack[i] - late - margin
    return _definite(M) and np.isfinite(trace), _peak(F0, F1, F2)


@njit(cache=True, error_model="numpy")
def _level_remainder(found, order, level):  # type: ignore[no-untyped-def]  # compiled
    """Return what a term leaves of the square of a level."""
    F = -found[order]
    for i in range(found.shape[1]):
        F[i, i] += level * level
    return F


@njit(cache=True, error_model="numpy")
def _turn(F, V, room):  # type: ignore[no-untyped-def]  # compiled
    """Overwrite a Hermitian F by V* F V."""
    room[:] = 0.0
    add_adjoint_product(F, V, room)  # F* = F
    F[:] = 0.0
    add_adjoint_product(V, room, F)


@njit(cache=True, error_model="numpy")
def _slack(value, slope, bend):  # type: ignore[no-untyped-def]  # compiled
    """Return an entry of S: it lifts the bend well above zero and takes little elsewhere."""
    lifted = np.sqrt(max(value * abs(bend), 0.25 * slope * slope)) - bend
    return min(max(lifted, 0.0), max(0.5 * (value - bend), 0.0))


@njit(cache=True, error_model="numpy")
def _definite(M):  # type: ignore[no-untyped-def]  # compiled
    """Say whether a Hermitian matrix has pivots above zero only; its lower triangle is overwritten.

    The margin that was taken from it covers the rounding of the elimination [1]_.

    References
    ----------
    .. [1] S. M. Rump, "Verification of positive definiteness", BIT Numerical Mathematics 46
       (2006) 433-452.
    """
    size = M.shape[0]
    for i in range(size):
        pivot = M[i, i].real
        if not pivot > 0.0:
            return False
        for j in range(i + 1, size):
            share = np.conj(M[j, i]) / pivot
            for k in range(j, size):
                M[k, j] -= M[k, i] * share
    return True


@njit(cache=True, error_model="numpy")
def _peak(F0, F1, F2):  # type: ignore[no-untyped-def]  # compiled
    """Return where the least eigenvalue is smallest, by perturbation to second order."""
    second = F2[0, 0].real
    for i in range(1, F0.shape[0]):
        apart = F0[i, i].real - F0[0, 0].real
        if apart > 0.0:
            second -= (F1[i, 0].real ** 2 + F1[i, 0].imag ** 2) / apart
    if not second > 0.0:
        return 0.0
    t = -0.5 * F1[0, 0].real / second
    return t if abs(t) <= 1.0 else 0.0


def modal_peak(modes: ModalForm, tolerance: float, widest: float) -> Peak | None:
    """Find the peak.

    Parameters
    ----------
    modes : ModalForm
    tolerance, widest : float
        Relative widths of the bracket: wanted, and accepted where the errors of the form are
        larger.

    Returns
    -------
    Peak or None
        None if these errors, or too much work, leave it open.
    """
    by_height = np.argsort(modes.high)
    centre, half, count = first_pieces(modes.real[by_height], modes.high[by_height])
    search: Any = _search  # compiled, so that no types are known
    check_deadline()
    pieces = centre[:count], half[:count]
    settled, *found = search(modes, *pieces, float(tolerance), float(widest))
    return Peak(*found) if settled else None


@njit(cache=True, error_model="numpy")
def _search(modes, centre, half, tolerance, widest):  # type: ignore[no-untyped-def]  # compiled
    """Return whether the peak is settled, where it is, its gain, and both bounds."""
    p, m = modes.D.shape
    terms, norms = np.empty((ORDER, p, m), np.complex128), np.empty(ORDER)
    found = np.empty((4, m, m), np.complex128)
    end = 0.0
    for i in range(modes.real.size):
        bounds = modes.sizes[i] + modes.shown[i] + modes.moved[i] + modes.signal_errors[i]
        if not np.isfinite(bounds + modes.rows[i] + modes.stretch[i]):
            return False, np.nan, 0.0, 0.0, np.inf
        end = max(end, FAR * np.hypot(modes.real[i], modes.high[i]))
    gain = largest_gain(modes.D)
    rounding = EPS * (8 * p + 8 * m + 32)
    best = (np.inf, gain, max(0.0, gain * (1.0 - rounding) - 2.0 * modes.D_error))
    best = _highest_middle(modes, centre, half, best, terms, found)
    done, most, level = 0, 100 + 60 * modes.real.size, 0.0
    open_pieces = np.empty((centre.size + 8 + 2 * most, 2))
    open_pieces[0, 0], open_pieces[0, 1], left = np.inf, end, 1
    for k in range(centre.size):
        open_pieces[left, 0], open_pieces[left, 1] = centre[k], half[k]
        left += 1
        if abs(centre[k] - best[0]) <= half[k]:
            left = _cut(open_pieces, left - 1, (best[0] - centre[k]) / half[k], 0.3)
    while left > 0:
        left -= 1
        middle, reach = open_pieces[left, 0], open_pieces[left, 1]
        far = np.isinf(middle)
        if far:
            error = expand_far(modes, reach, terms)
        else:
            error, most_gain = expansion_error(modes, middle, reach, best[1])
            if most_gain < level:
                continue
            expand(modes, middle, reach, terms)
            best = _climbed(modes, middle, reach, best, terms, found)
        # Errors of the form keep the bracket from being narrower; what is done stays so.
        width = max(tolerance, 4.0 * (best[1] - best[2]) / best[1]) if best[2] > 0.0 else np.inf
        if not width <= widest or done > most or (far and reach > 1e6 * end):
            return False, best[0], best[1], best[2], np.inf
        level = max(level, best[1] * (1.0 + width))
        hint = 0.0
        if error < np.inf:
            total = sizes(terms, norms)
            if total + error < level:
                continue
            late, lost = squares(terms, norms, total, error, found)
            proven, hint = below(found, late, lost, level)
            if proven:
                continue
        done += 1
        if far:
            open_pieces[left, 1] = 2.0 * reach
            open_pieces[left + 1, 0], open_pieces[left + 1, 1] = overlapping(reach, 2.0 * reach)
            left += 2
        else:
            left = _cut(open_pieces, left, hint, 0.3 if error < np.inf else 0.1)
    return True, best[0], best[1], best[2], level


@njit(cache=True, error_model="numpy")
def _cut(pieces, k, hint, share):  # type: ignore[no-untyped-def]  # compiled
    """Put three pieces in the place of the last one, k; return how many there are then.

    The one about the place that the hint tells comes last.
    """
    centre, half = pieces[k, 0], pieces[k, 1]
    middle = min(max(hint, -0.7), 0.7)
    part = share * (1.0 - abs(middle))
    left, right = centre + half * (middle - part), centre + half * (middle + part)
    pieces[k, 0], pieces[k, 1] = overlapping(centre - half, left)
    pieces[k + 1, 0], pieces[k + 1, 1] = overlapping(right, centre + half)
    pieces[k + 2, 0] = centre + half * middle
    pieces[k + 2, 1] = half * part * (1.0 + 1e-9) + 4e-16 * abs(pieces[k + 2, 0])
    return k + 3


@njit(cache=True, error_model="numpy")
def _highest_middle(modes, centre, half, best, terms, found):  # type: ignore[no-untyped-def]  # compiled
    """Climb from the highest of all middles."""
    highest, which = -1.0, 0
    G = np.empty(modes.D.shape, np.complex128)
    flat = G.reshape(G.size)
    for k in range(centre.size):
        G[:] = modes.D
        for q in range(modes.real.size):
            factor = 1.0 / complex(-modes.real[q], (centre[k] - modes.high[q]) - modes.low[q])
            for i in range(flat.size):
                flat[i] += factor * modes.residues[q, i]
        if frobenius(G) >= highest:  # no singular value is larger than that
            gain = largest_gain(G)
            if gain > highest:
                highest, which = gain, k
    expand(modes, centre[which], half[which], terms)
    return _climbed(modes, centre[which], half[which], best, terms, found)


@njit(cache=True, error_model="numpy")
def _climbed(modes, at, half, best, terms, found):  # type: ignore[no-untyped-def]  # compiled
    """Climb by Newton's method from a middle whose gain is above the best one; keep `terms`."""
    gain = largest_gain(terms[0])
    if not gain > best[1] * (1.0 + 1e-14):
        return best
    p, m = modes.D.shape
    here = np.empty((ORDER, p, m), np.complex128)
    expand(modes, at, half, here)
    for _ in range(12):
        trial = at + half * _step(here, found)
        if abs(trial - at) <= 1e-12 * half:
            break
        expand(modes, trial, half, here)
        reached = largest_gain(here[0])
        if not reached > gain:
            break
        at, progress, gain = trial, reached - gain, reached
        if progress <= 1e-13 * gain:
            break
    error, _ = expansion_error(modes, at, 0.0, 0.0)
    lower = max(0.0, gain * (1.0 - EPS * (8 * p + 8 * m + 32)) - error)
    return abs(at), gain, lower


@njit(cache=True, error_model="numpy")
def _step(here, found):  # type: ignore[no-untyped-def]  # compiled
    """Return t of the top of the gain about a middle, at most 1 away."""
    m = here.shape[2]
    for order in range(3):
        _term_of_square(here, order, found[order])
    V = np.empty((m, m), np.complex128)
    eigen(found[0], V)
    first, second = 0.0, 0.0
    for i in range(m - 1, -1, -1):  # the last vector is that of the largest gain
        slope, bend = complex(0.0, 0.0), complex(0.0, 0.0)
        for j in range(m):
            for k in range(m):
                pair = np.conj(V[j, i]) * V[k, m - 1]
                slope += pair * found[1, j, k]
                bend += pair * found[2, j, k]
        if i == m - 1:
            first, second = slope.real, bend.real
        else:
            apart = found[0, m - 1, m - 1].real - found[0, i, i].real
            if apart > 0.0:
                second += (slope.real**2 + slope.imag**2) / apart
    if second < 0.0 and abs(first) < -2.0 * second:
        return -0.5 * first / second
    return 1.0 if first > 0.0 else -1.0
