r"""A system in modal coordinates, and bounds of everything that rounding left out of them.

With any invertible matrix V, V^-1 A V = L + F with L diagonal. V and L are taken from the computed
eigensystem; what is left in F follows from the residual A V - V L, which is formed in extended
precision where the machine has it. So the response is enclosed whatever the quality of the
eigensystem, which shows in the size of F only.

Discrete systems are mapped to the imaginary axis by z = (1 + s)/(1 - s), mode by mode:

.. math:: \frac{1}{z - \lambda} = \frac{1}{1 + \lambda}
          \left(\frac{1 - q}{s - q} - 1\right), \qquad q = \frac{\lambda - 1}{\lambda + 1}.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from robustpolish.base.arrays import EPS, AnyArray, Matrix, Vector
from robustpolish.linear.arithmetic.exact import size
from robustpolish.linear.stability import Eigensystem
from robustpolish.linear.systems import Realisation

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
