"""Systems in ball arithmetic and their bounded-real inequality, Riccati equation and Hamiltonian.

A symmetric P > 0 proves a stable system's gain to lie below gamma if the storage x'Px falls by more
than gamma^2 w'w - z'z (Boyd et al., "Linear Matrix Inequalities in System and Control Theory",
1994, section 2.7.3). Without inputs and outputs that is Lyapunov's inequality.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import flint
import numpy as np

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.arrays import Vector
from robustpolish.linear.arithmetic import balls
from robustpolish.linear.arithmetic.balls import Ball


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
        return cls(*(balls.ball(getattr(system, name)) for name in "ABCD"))

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
        A, B1, B2, C1, C2, D11, D12, D21, D22 = (balls.ball(getattr(plant, n)) for n in names)
        nu, ny, nk = B2.ncols(), C2.nrows(), len(controller.A)
        Ak, Bk, Ck, Dk = (
            balls.ball(np.reshape(getattr(controller, name), shape))
            for name, shape in zip("ABCD", ((nk, nk), (nk, ny), (nu, nk), (nu, ny)), strict=True)
        )
        inverse = (balls.identity(nu) - Dk * D22).inv()
        on_x, on_k, on_w = inverse * Dk * C2, inverse * Ck, inverse * Dk * D21
        rows = [A + B2 * on_x, B2 * on_k], [Bk * (C2 + D22 * on_x), Ak + Bk * D22 * on_k]
        into = balls.block([[B1 + B2 * on_w], [Bk * (D21 + D22 * on_w)]])
        out = balls.block([[C1 + D12 * on_x, D12 * on_k]])
        return cls(balls.block(rows), into, out, D11 + D12 * on_w)

    def __iter__(self) -> Iterator[Ball]:
        return iter((self.A, self.B, self.C, self.D))

    @property
    def doubles(self) -> tuple[Matrix, Matrix, Matrix, Matrix]:
        """The centres as doubles."""
        A, B, C, D = map(balls.midpoint, self)
        return A, B, C, D

    def response(self, frequency: float, solve: Callable[[Ball, Ball], Ball] | None = None) -> Ball:
        """Return the response at a frequency in rad/s, infinity included; see `transfer_matrix`."""
        s = flint.acb(0, frequency) if math.isfinite(frequency) else None
        return balls.transfer_matrix(*self, s, solve)  # pyright: ignore[reportCallIssue]

    def continuous(self) -> BallSystem:
        """Return the continuous system of a discrete one, with the same gains and Gramians."""
        return BallSystem(*balls.cayley(*self), self.scale)

    def transformed(self, into: Ball, back: Ball) -> BallSystem:
        """Return the system in other states, `into` times its own; `back` leads to these."""
        return replace(self, A=into * self.A * back, B=into * self.B, C=self.C * back)

    def over(self, gamma: Any) -> BallSystem:
        """Return the system with its gain over gamma, by its inputs."""
        return replace(self, B=self.B / gamma, D=self.D / gamma)

    def riccati_terms(self) -> tuple[Ball, Ball, Ball]:
        """Return A, R and Q of the bounded-real equation A'P + PA + PRP + Q = 0 at gamma = 1."""
        Ct, Dt = self.C.transpose(), self.D.transpose()
        price = Dt * self.D - balls.identity(self.B.ncols())
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
    return -balls.block([[PA + PA.transpose() + Ct * C, corner], [corner.transpose(), below]])


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
    return balls.block([[A, R], [-Q, -adjoint(A)]])


def adjoint(matrix: Ball) -> Ball:
    """Return the conjugate transpose."""
    flipped = matrix.transpose()
    return flipped.conjugate() if isinstance(matrix, flint.acb_mat) else flipped


# Intervals of frequency on which a Hamiltonian matrix has no eigenvalue on the imaginary axis.
#
# What holds at one frequency and is singular at eigenvalues on the axis alone holds up to the
# nearest of these. Gershgorin discs in a basis of eigenvectors, in balls, enclose all of them.

# What the ends of discs are moved outwards, relative, for their rounding to doubles.
_ROUNDING = 1e-14
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
    middle, n = balls.midpoint(H), H.nrows() // 2
    up, down = np.linalg.norm(middle[:n, n:]), np.linalg.norm(middle[n:, :n])
    ratio = math.sqrt(up / down) if up > 0 and down > 0 else 1.0
    units = np.concatenate([np.full(n, 1.0), np.full(n, 1 / ratio)])
    vectors = np.linalg.eig(middle * units / units[:, None])[1] * units[:, None]
    basis = balls.complex_ball(vectors / np.linalg.norm(vectors, axis=0))
    found = _clear(*gershgorin_discs(H, basis), omega)
    if found is None or found[1] - found[0] < _SHORT * found[0]:
        found = _clear(*gershgorin_discs(H, H.eig(right=True, algorithm="approx")[1]), omega)
    return found


def _clear(centres: Matrix, radii: Vector, omega: float) -> tuple[float, float] | None:
    """Return the frequencies around one that no disc touches."""
    near = np.abs(np.real(centres)) <= radii
    reach = radii[near] + _ROUNDING * np.abs(centres[near])
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
    centres = np.diagonal(balls.midpoint(turned)).copy()
    radii = np.zeros(n)
    for i in range(n):
        rest = sum((abs(turned[i, j]) for j in range(n) if j != i), flint.arb(0))
        rest += abs(turned[i, i] - turned[i, i].mid())
        radii[i] = float(rest.abs_upper()) * (1 + _ROUNDING)
    return centres, radii + _ROUNDING * np.abs(centres)
