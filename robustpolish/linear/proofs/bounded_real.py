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
        return cls(
            balls.block(
                [
                    [A + B2 * on_x, B2 * on_k],
                    [Bk * (C2 + D22 * on_x), Ak + Bk * D22 * on_k],
                ]
            ),
            balls.block([[B1 + B2 * on_w], [Bk * (D21 + D22 * on_w)]]),
            balls.block([[C1 + D12 * on_x, D12 * on_k]]),
            D11 + D12 * on_w,
        )

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
