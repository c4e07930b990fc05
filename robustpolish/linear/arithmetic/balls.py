"""Ball arithmetic, and what is proven of matrices and systems in it: every entry bounds its error.

python-flint's ``arb_mat`` encloses each number in a ball, so a conclusion drawn from balls
holds for the exact numbers. A 120 x 120 product takes about 10 ms at 200 bits, which is why
the certificates are checked in balls throughout rather than with hand-made error bounds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import flint
import numpy as np

from robustpolish.base.arrays import SOLVED, SUMMED, Vector
from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.budget import check_deadline, now

Ball = Any  # flint.arb_mat or flint.acb_mat; python-flint ships no stubs for them


@contextmanager
def precision(bits: int) -> Iterator[None]:
    """Work with `bits` bits inside the block and restore the precision afterwards."""
    before = flint.ctx.prec
    flint.ctx.prec = bits
    try:
        yield
    finally:
        flint.ctx.prec = before


def ball(matrix: Matrix) -> Ball:
    """Enclose a matrix of doubles, exactly."""
    array = np.atleast_2d(np.asarray(matrix, dtype=float))
    return flint.arb_mat(*array.shape, array.ravel().tolist())  # pyright: ignore[reportCallIssue]


def complex_ball(matrix: Matrix) -> Ball:
    """Enclose a complex matrix of doubles, exactly."""
    array = np.asarray(matrix, dtype=complex)
    return flint.acb_mat(*array.shape, array.ravel().tolist())  # pyright: ignore[reportCallIssue]


def zeros(rows: int, columns: int) -> Ball:
    """Return the zero matrix."""
    return flint.arb_mat(rows, columns)


def identity(n: int) -> Ball:
    """Return the identity matrix."""
    return ball(np.eye(n))


def block(rows: Sequence[Sequence[Any]]) -> Any:
    """Assemble a matrix of blocks: balls, real or complex, or rational numbers."""
    table, columns = joined_rows(rows), sum(part.ncols() for part in rows[0])
    entries = [entry for row in table for entry in row]
    return type(rows[0][0])(len(table), columns, entries)


def part(
    matrix: Ball,
    rows: Sequence[int] | slice = slice(None),
    columns: Sequence[int] | slice = slice(None),
) -> Ball:
    """Return the entries of some rows and columns of a real matrix."""
    i, j = (
        range(size)[chosen] if isinstance(chosen, slice) else chosen
        for size, chosen in ((matrix.nrows(), rows), (matrix.ncols(), columns))
    )
    return flint.arb_mat(len(i), len(j), [matrix[a, b] for a in i for b in j])


def joined_rows(blocks: Sequence[Sequence[Any]]) -> list[list[Any]]:
    """Join rows of blocks, of any kind of number; blocks without columns are passed over."""
    rows: list[list[Any]] = []
    for line in blocks:
        tables = [block.tolist() for block in line if block.ncols()]
        rows += [[entry for table in tables for entry in table[i]] for i in range(line[0].nrows())]
    return rows


def midpoint(matrix: Ball) -> Matrix:
    """Return the centres, real or complex, rounded to doubles."""
    shape = matrix.nrows(), matrix.ncols()
    kind: Any = complex if isinstance(matrix, flint.acb_mat) else float
    return np.array(list(map(kind, matrix.mid().entries())), dtype=kind).reshape(shape)


def magnitude(matrix: Ball) -> Matrix:
    """Return upper bounds of the absolute values of the entries."""
    shape = matrix.nrows(), matrix.ncols()
    return np.array([float(entry.abs_upper()) for entry in matrix.entries()]).reshape(shape)


def symmetric(matrix: Ball) -> Ball:
    """Return the mean of a matrix and its transpose."""
    return (matrix + matrix.transpose()) * flint.arb(0.5)


def scaled(matrix: Ball, rows: Vector, columns: Vector) -> Ball:
    """Multiply rows and columns by powers of two, which rounds nothing.

    A product with a diagonal matrix takes as long as one with any other: of 400 states five times
    as long as this.
    """
    if not (matrix.nrows() and matrix.ncols()):
        return matrix
    left, right = ([flint.arb(float(factor)) for factor in each] for each in (rows, columns))
    table = zip(left, matrix.tolist(), strict=True)
    return flint.arb_mat(
        [[entry * r * c for entry, c in zip(row, right, strict=True)] for r, row in table]
    )


# Systems of four real matrices.


def transfer_matrix(
    A: Ball, B: Ball, C: Ball, D: Ball, s: Any, solve: Callable[[Ball, Ball], Ball] | None = None
) -> Ball:
    """Return D + C (s - A)^-1 B.

    Parameters
    ----------
    A, B, C, D : flint.arb_mat
    s : flint.acb or None
        None is infinity.
    solve : callable, optional
        Solves M X = B; flint by default, which encloses X.

    Returns
    -------
    flint.acb_mat

    Raises
    ------
    ZeroDivisionError
        If s is a pole as far as the balls can tell.
    """
    n, direct = A.nrows(), flint.acb_mat(D)
    if s is None or not n:
        return direct
    resolvent, into = -flint.acb_mat(A), flint.acb_mat(B)
    for i in range(n):
        resolvent[i, i] += s
    states = resolvent.solve(into) if solve is None else solve(resolvent, into)
    return direct + flint.acb_mat(C) * states


def cayley(A: Ball, B: Ball, C: Ball, D: Ball) -> tuple[Ball, Ball, Ball, Ball]:
    """Map a discrete system by z = (1 + s)/(1 - s), which keeps gains, stability and Gramians.

    Raises
    ------
    ZeroDivisionError
        If A + I is singular, in which case the system is not stable.
    """
    one, root = identity(A.nrows()), flint.arb(2).sqrt()
    inverse = (A + one).inv()
    return inverse * (A - one), inverse * B * root, C * inverse * root, D - C * inverse * B


# Which columns of a matrix in ball arithmetic depend on the others, by elimination.


def independent_first(M: Ball) -> tuple[Ball, int]:
    """Combine columns such that the first ones are independent and the others vanish.

    What a ball arithmetic with enough digits cannot tell from zero is zero: numbers that come
    from doubles in a few steps are zero or larger by far than the radius.

    Parameters
    ----------
    M : flint.arb_mat
        Exact, or enclosed with radii from rounding only.

    Returns
    -------
    T : flint.arb_mat
        Invertible; M T has columns that are independent, and then columns that vanish.
    rank : int
        How many are independent.
    """
    n = M.ncols()
    columns: list[list[Any]] = [list(column) for column in M.transpose().tolist()]
    turns = [[flint.arb(int(i == j)) for j in range(n)] for i in range(n)]
    rank = 0
    while rank < n:
        sizes = [
            (entry.abs_lower(), i, j)
            for i in range(rank, n)
            for j, entry in enumerate(columns[i])
            if not entry.contains(0)
        ]
        if not sizes:
            break
        # The largest entry there is: the others are then combined with factors of at most one.
        _, i, j = max(sizes, key=lambda size: float(size[0].mid().log()))
        for table in (columns, turns):
            table[rank], table[i] = table[i], table[rank]
        for k in range(rank + 1, n):
            factor = columns[k][j] / columns[rank][j]
            for table in (columns, turns):
                table[k] = [x - factor * y for x, y in zip(table[k], table[rank], strict=True)]
            columns[k][j] = flint.arb(0)
        rank += 1
    T = flint.arb_mat(n, n, [entry for column in turns for entry in column]).transpose()
    return T, rank


# Proofs in ball arithmetic: bounded-real inequality, definite matrices, Riccati equations.
#
# A symmetric P > 0 proves a stable system's gain to lie below gamma if the storage x'Px falls by
# more than gamma^2 w'w - z'z (Boyd et al., "Linear Matrix Inequalities in System and Control
# Theory", 1994, section 2.7.3). Without inputs and outputs that is Lyapunov's inequality.


@dataclass(frozen=True, eq=False)
class BallSystem:
    """A, B, C and D in real balls: what is proven of them holds for all systems they enclose.

    Attributes
    ----------
    A, B, C, D : flint.arb_mat
    scale : ndarray
        The states of the system as it came are these times its states.
    """

    A: Ball
    B: Ball
    C: Ball
    D: Ball
    scale: Any = 1.0

    @classmethod
    def of(cls, system: Any) -> BallSystem:
        """Enclose the matrices A, B, C and D of a system, as they are."""
        return cls(*(ball(getattr(system, name)) for name in "ABCD"))

    @classmethod
    def closed_loop(cls, plant: Any, controller: Any) -> BallSystem:
        """Connect u = K y without rounding errors.

        Parameters
        ----------
        plant, controller
            Whatever has the nine matrices A, B1, ... D22, and four matrices A, B, C, D.

        Raises
        ------
        ZeroDivisionError
            If I - Dk D22 cannot be shown to be nonsingular.
        """
        names = ("A", "B1", "B2", "C1", "C2", "D11", "D12", "D21", "D22")
        A, B1, B2, C1, C2, D11, D12, D21, D22 = (ball(getattr(plant, n)) for n in names)
        nu, ny, nk = B2.ncols(), C2.nrows(), len(controller.A)
        Ak, Bk, Ck, Dk = (
            ball(np.reshape(getattr(controller, name), shape))
            for name, shape in zip("ABCD", ((nk, nk), (nk, ny), (nu, nk), (nu, ny)), strict=True)
        )
        inverse = (identity(nu) - Dk * D22).inv()
        on_x, on_k, on_w = inverse * Dk * C2, inverse * Ck, inverse * Dk * D21
        rows = [A + B2 * on_x, B2 * on_k], [Bk * (C2 + D22 * on_x), Ak + Bk * D22 * on_k]
        into = block([[B1 + B2 * on_w], [Bk * (D21 + D22 * on_w)]])
        out = block([[C1 + D12 * on_x, D12 * on_k]])
        return cls(block(rows), into, out, D11 + D12 * on_w)

    def __iter__(self) -> Iterator[Ball]:
        return iter((self.A, self.B, self.C, self.D))

    @property
    def doubles(self) -> tuple[Matrix, Matrix, Matrix, Matrix]:
        """The centres as doubles."""
        A, B, C, D = map(midpoint, self)
        return A, B, C, D

    def response(self, frequency: float, solve: Callable[[Ball, Ball], Ball] | None = None) -> Ball:
        """Return the response at a frequency in rad/s, infinity included; see `transfer_matrix`."""
        s = flint.acb(0, frequency) if math.isfinite(frequency) else None
        return transfer_matrix(*self, s, solve)  # pyright: ignore[reportCallIssue]

    def continuous(self) -> BallSystem:
        """Return the continuous system of a discrete one, with the same gains and Gramians."""
        return BallSystem(*cayley(*self), self.scale)

    def transformed(self, into: Ball, back: Ball) -> BallSystem:
        """Return the system in other states, `into` times its own; `back` leads to these."""
        return replace(self, A=into * self.A * back, B=into * self.B, C=self.C * back)

    def over(self, gamma: Any) -> BallSystem:
        """Return the system with its gain over gamma, by its inputs."""
        return replace(self, B=self.B / gamma, D=self.D / gamma)

    def riccati_terms(self) -> tuple[Ball, Ball, Ball]:
        """Return A, R and Q of the bounded-real equation A'P + PA + PRP + Q = 0 at gamma = 1."""
        Ct, Dt = self.C.transpose(), self.D.transpose()
        price = Dt * self.D - identity(self.B.ncols())
        return riccati_terms(self.A, self.B, Ct * self.C, Ct * self.D, price)


def bounded_real(P: Any, A: Any, B: Any, C: Any, D: Any, square: Any) -> Any:
    r"""Return the matrix that is positive definite where P > 0 proves a bound of the gain.

    .. math:: -\begin{bmatrix} A^T P + P A + C^T C & P B + C^T D \\
              B^T P + D^T C & D^T D - \gamma^2 I \end{bmatrix}

    Parameters
    ----------
    P, A, B, C, D : flint.arb_mat or flint.fmpq_mat
        P symmetric.
    square : flint.arb, flint.fmpq or number
        Square of gamma.

    Returns
    -------
    flint.arb_mat or flint.fmpq_mat
    """
    PA, Ct = P * A, C.transpose()
    corner, below = P * B + Ct * D, D.transpose() * D
    for i in range(below.nrows()):
        below[i, i] -= square
    return -block([[PA + PA.transpose() + Ct * C, corner], [corner.transpose(), below]])


def riccati_terms(A: Ball, B: Ball, Q: Ball, S: Ball, R: Ball) -> tuple[Ball, Ball, Ball]:
    """Return the terms A, R and Q of A*X + XA + XRX + Q = 0 for a quadratic supply of x and w.

    Parameters
    ----------
    A, B, Q, S, R : flint.arb_mat or flint.acb_mat
        x' = A x + B w, and the supply x*Qx + 2 x*Sw + w*Rw.

    Raises
    ------
    ZeroDivisionError
        If R is singular as far as the balls can tell.
    """
    by_x, by_p = R.solve(adjoint(S)), R.solve(adjoint(B))
    return A - B * by_x, -(B * by_p), Q - S * by_x


def hamiltonian(A: Ball, R: Ball, Q: Ball) -> Ball:
    """Return the matrix [[A, R], [-Q, -A*]], whose invariant subspaces solve A*X + XA + XRX + Q."""
    return block([[A, R], [-Q, -adjoint(A)]])


def adjoint(matrix: Ball) -> Ball:
    """Return the conjugate transpose."""
    flipped = matrix.transpose()
    return flipped.conjugate() if isinstance(matrix, flint.acb_mat) else flipped


# Intervals of frequency on which a Hamiltonian matrix has no eigenvalue on the imaginary axis.
#
# What holds at one frequency and is singular at eigenvalues on the axis alone holds up to the
# nearest of these. Gershgorin discs in a basis of eigenvectors, in balls, enclose all of them.

# Relative length of an interval that is worth eigenvectors of more digits.
_SHORT = 0.1


def interval_without_eigenvalues(H: Ball, omega: float) -> tuple[float, float] | None:
    """Return the ends of an interval around a frequency where no eigenvalue is on the axis.

    Parameters
    ----------
    H : flint.acb_mat
        A Hamiltonian matrix.
    omega : float
        In rad/s; infinity is allowed.

    Returns
    -------
    (float, float) or None
        From 0 to infinity; None where a disc holds the frequency itself.

    Raises
    ------
    ZeroDivisionError, ValueError, numpy.linalg.LinAlgError
        If there are no eigenvectors that can be inverted.
    """
    # Eigenvectors in doubles are quick, and good enough for most, in units of the states and
    # co-states that make the halves of H alike.
    middle, n = midpoint(H), H.nrows() // 2
    up, down = np.linalg.norm(middle[:n, n:]), np.linalg.norm(middle[n:, :n])
    ratio = math.sqrt(up / down) if up > 0 and down > 0 else 1.0
    units = np.concatenate([np.full(n, 1.0), np.full(n, 1 / ratio)])
    vectors = np.linalg.eig(middle * units / units[:, None])[1] * units[:, None]
    basis = complex_ball(vectors / np.linalg.norm(vectors, axis=0))
    found = _clear(*gershgorin_discs(H, basis), omega)
    if found is None or found[1] - found[0] < _SHORT * found[0]:
        found = _clear(*gershgorin_discs(H, H.eig(right=True, algorithm="approx")[1]), omega)
    return found


def _clear(centres: Matrix, radii: Vector, omega: float) -> tuple[float, float] | None:
    """Return the frequencies around one that no disc touches."""
    near = np.abs(np.real(centres)) <= radii
    # What the ends of discs are moved outwards, relative, for their rounding to doubles.
    reach = radii[near] + SUMMED * np.abs(centres[near])
    heights = np.imag(centres)[near]
    low, high = heights - reach, heights + reach
    if not np.isfinite(low).all() or ((low <= omega) & (omega <= high)).any():
        return None
    below, above = high[high < omega], low[low > omega]
    return (
        max(0.0, math.nextafter(float(below.max(initial=-1.0)), math.inf)),
        math.nextafter(float(above.min()), 0.0) if above.size else math.inf,
    )


def gershgorin_discs(H: Ball, basis: Ball) -> tuple[Matrix, Vector]:
    """Return discs that hold all eigenvalues of a matrix, by Gershgorin in a basis."""
    turned = basis.solve(H * basis)
    n = turned.nrows()
    centres = np.diagonal(midpoint(turned)).copy()
    radii = np.zeros(n)
    for i in range(n):
        rest = sum((abs(turned[i, j]) for j in range(n) if j != i), flint.arb(0))
        rest += abs(turned[i, i] - turned[i, i].mid())
        radii[i] = float(rest.abs_upper()) * (1 + SUMMED)
    return centres, radii + SUMMED * np.abs(centres)


# Positive definite matrices: decided for rational numbers, proven for balls, real or complex.


_BITS_PER_PASS = 40


def is_definite(matrix: Any) -> bool:
    """Prove that a symmetric or Hermitian matrix is positive definite.

    Parameters
    ----------
    matrix : flint.fmpq_mat, flint.arb_mat or flint.acb_mat
        Rational numbers decide it. Balls hold many matrices, of which all are meant.

    Returns
    -------
    bool
        True is a proof. False says of balls only that no proof was found.

    Notes
    -----
    Balls: M > 0 follows from G M G' > 0 for any square G, whatever it is. G is made of the
    eigenvectors of M in doubles and turns M into a matrix near the identity, up to directions that
    are too weak beside the others for doubles; in these it is repeated. A matrix whose distance
    from the identity has a row-sum norm below one is positive definite.
    """
    n = matrix.nrows()
    if isinstance(matrix, flint.fmpq_mat):
        coefficients = matrix.charpoly().coeffs() if n else []
        return all(c * (-1) ** (n - k) > 0 for k, c in enumerate(coefficients))
    if isinstance(matrix, flint.acb_mat):  # H > 0 just if [[Re H, -Im H], [Im H, Re H]] > 0
        table = matrix.tolist()
        real, imag = (
            flint.arb_mat(n, n, [getattr(entry, part) for row in table for entry in row])
            for part in ("real", "imag")
        )
        matrix, n = symmetric(block([[real, -imag], [imag, real]])), 2 * n
    diagonal = np.array([float(matrix[i, i].lower()) for i in range(n)])
    if not (np.isfinite(diagonal).all() and (diagonal > 0).all()):
        return False
    # Powers of two bring the diagonal to about one without rounding.
    scale = np.exp2(-np.round(np.log2(diagonal) / 2))
    turned = scaled(matrix, scale, scale)
    for _ in range(flint.ctx.prec // _BITS_PER_PASS + 1 if n else 0):
        check_deadline()
        centre = midpoint(turned)
        if not np.isfinite(centre).all():
            return False
        values, vectors = np.linalg.eigh((centre + centre.T) / 2)
        # Beside the strongest direction, doubles see those above this; a pass of the proof of
        # definiteness brings up the weaker ones by its inverse, about so many bits.
        if values[0] < -100 * SOLVED * values[-1]:
            return False
        G = ball((vectors / np.sqrt(np.maximum(values, SOLVED * values[-1]))).T)
        turned = G * turned * G.transpose()
        rest = magnitude(identity(n) - turned)
        # The factor covers the rounding errors of the sums, which are taken in doubles.
        if np.isfinite(rest).all() and (rest.sum(axis=1) * (1 + 1e-12)).max() < 1:
            return True
    return n == 0


# Riccati equations in long arithmetic, with hundreds of digits where doubles have sixteen.
#
# The eigenvalues of the Hamiltonian come from its characteristic polynomial, a first solution from
# the factor of its unstable ones, and Newton's method makes it as exact as the arithmetic.


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
