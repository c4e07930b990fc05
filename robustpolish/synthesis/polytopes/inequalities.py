r"""Matrix inequalities of a polytope of loops, with a slack in place of products of unknowns.

Along the dual loop x' = A' x + C' w, z = B' x + D' w the rate of x' P x has to stay below
``gamma^2 |w|^2 - |z|^2``. With the equation of motion written as
``[-I, A', C'] (x', x, w) = 0`` any slack X of three rows of blocks may multiply it (Finsler):

    Q(P) + X [-I, A', C'] + [-I, A', C']' X'  - gamma^2 on w + (0, B, D) (0, B, D)'  <  0,

which no longer holds any product of P with A or C. So P may differ from vertex to vertex if X does
not, and the inequality at the vertices is that of all points between (de Oliveira, Bernussou and
Geromel, Systems & Control Letters 37, 1999; in continuous time Shaked, IEEE TAC 46, 2001). With
X = (a V', b V', 0) and L = F V it is linear in V and L: a gain F for all vertices.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.synthesis.lmi.affine import Affine, symmetric_block
from robustpolish.synthesis.lmi.semidefinite import SemidefiniteProgram
from robustpolish.synthesis.polytopes.family import LyapunovFamily, combined

Blocks = list[list[Any]]


class Slack(NamedTuple):
    """The three blocks of X: on the derivative of the state (or its next value), on it, on w."""

    X1: Any
    X2: Any
    X3: Any


def tied_weights(discrete: bool) -> tuple[float, float]:
    """Return a and b with which X = (a P, b P, 0) is the inequality without slack."""
    return (1.0, 0.0) if discrete else (0.0, 1.0)


def with_slack(X: Slack, A: Any, C: Any) -> Blocks:
    """Return X [-I, A', C'], where either X or A and C hold unknowns."""
    return [[-Affine.of(row), Affine.of(row @ A.T), Affine.of(row @ C.T)] for row in X]


def with_gain(V: Affine, AV: Affine, CV: Affine, a: float, b: float) -> Blocks:
    """Return X [-I, A', C'] for X = (a V', b V', 0), from the loop's A V and C V."""
    rows = [[-V.T * f, AV.T * f, CV.T * f] for f in (a, b)]
    nz, n = CV.shape
    return [*rows, [Affine.of(np.zeros((nz, k))) for k in (n, n, nz)]]


def dissipation(
    P: Affine, rate: Affine | None, terms: Terms, square: Affine | None, question: Question
) -> Affine:
    """Return the matrix that has to be negative definite at a vertex.

    Parameters
    ----------
    P, rate : Affine
        The Lyapunov matrix and its derivative; None is none.
    terms : Terms
    square : Affine or None
        The square of gamma; None for the H2 norm, for which w is left out.
    question : Question

    Returns
    -------
    Affine
        Where X is made of P its first row is nought in continuous time, and left out.
    """
    S, B, D, discrete = terms.S, terms.B, terms.D, question.discrete
    none = P * 0.0
    Q = ((P, none), (-P,)) if discrete else ((none, P), (none if rate is None else -rate,))
    first: list[Any] = [Q[0][0] + S[0][0] + S[0][0].T, Q[0][1] + S[0][1] + S[1][0].T]
    second: list[Any] = [Q[1][0] + S[1][1] + S[1][1].T]
    last: list[Any] = [-np.eye(B.shape[1])]
    if square is None:
        rows = [[*first, None], [*second, B], last]
    else:
        level = S[2][2] + S[2][2].T - square.times(np.eye(len(D)))
        rows = [
            [*first, S[0][2] + S[2][0].T, None],
            [*second, S[1][2] + S[2][1].T, B],
            [level, D],
            last,
        ]
    return symmetric_block(rows[1:] if question.tied and not discrete else rows)


def energy(Z: Affine, CV: Any, V: Any, P: Affine, D: Any) -> Affine:
    """Return the matrix that has to be positive for Z >= C P C' + D D', with V a slack."""
    n = P.shape[0]
    between = V + V.T - P if V is not None else P
    return symmetric_block([[Z, CV, D], [between, np.zeros((n, D.shape[1]))], [np.eye(D.shape[1])]])


@dataclass(frozen=True, eq=False)
class Question:
    """What is asked of all loops of a polytope.

    Attributes
    ----------
    family : LyapunovFamily
    norm : {"hinf", "h2"}
    discrete : bool
    """

    family: LyapunovFamily
    norm: str
    discrete: bool

    @property
    def tied(self) -> bool:
        """Whether the slack is made of the one Lyapunov matrix that there is."""
        return self.family.is_common

    def seen(self, C: Any) -> Any:
        """Return the part of C that the first inequality needs: for the H2 norm none."""
        return C if self.norm == "hinf" else np.zeros((0, C.shape[1]))


@dataclass(frozen=True, eq=False)
class Terms:
    """The unknown loop at a vertex: X [-I, A', C'], C times a slack, that slack, and B and D."""

    S: Blocks
    CV: Any
    V: Any
    B: Matrix
    D: Matrix


def impose(
    program: SemidefiniteProgram,
    question: Question,
    vertex: int,
    matrices: Sequence[Affine],
    terms: Terms,
    square: Affine,
    margin: Affine | None = None,
    rates: Sequence[Affine | None] | None = None,
) -> Affine | None:
    """Require a bound on the norm at a vertex; return the unknown Z of the H2 norm.

    Parameters
    ----------
    program : SemidefiniteProgram
    question : Question
    vertex : int
    matrices : sequence of Affine
        The unknown Lyapunov matrices of the family.
    terms : Terms
    square : Affine
        Of the bound.
    margin : Affine, optional
        By how much every inequality is to be strict, a scalar.
    rates : sequence of Affine or None, optional
        Derivatives of the Lyapunov matrix as of :func:`extreme_rates`; all by default.
    """
    hinf, family = question.norm == "hinf", question.family
    margin = Affine.of(0.0) if margin is None else margin

    def strictly(M: Affine) -> None:
        program.positive(M - margin.times(np.eye(M.shape[0])))

    P = combined(family.shares[vertex], matrices)
    strictly(P)
    level = square if hinf else None
    for rate in _each_rate(family, matrices) if rates is None else rates:
        strictly(-dissipation(P, rate, terms, level, question))
    if hinf:
        return None
    Z = program.symmetric(terms.CV.shape[0])
    strictly(energy(Z, terms.CV, terms.V, P, terms.D))
    program.nonnegative(square - Z.trace)
    return Z


def extreme_rates(
    program: SemidefiniteProgram, family: LyapunovFamily, matrices: Sequence[Affine]
) -> list[Affine | None]:
    """Return derivatives of the Lyapunov matrix that stand for all of them.

    Of up to two slow numbers they are those at the corners of the rates. Corners of more make a
    program of 4-fold size for each: there one unknown N_j above r_j P_j and -r_j P_j for each
    number stands for them, -sum N_j. That asks for a little more; what is proven afterwards is
    proven at the corners themselves.
    """
    if len(family.drifts) <= _CORNERS:
        return _each_rate(family, matrices)
    total = matrices[0] * 0.0
    for rate, matrix in zip(np.abs(family.drifts).max(axis=0), matrices, strict=True):
        if rate > 0:
            N = program.symmetric(matrix.shape[0])
            program.positive(N - matrix * float(rate))
            program.positive(N + matrix * float(rate))
            total = total - N
    return [total]


# Corners of rates that programs hold themselves: those of two slow numbers.
_CORNERS = 4


def _each_rate(family: LyapunovFamily, matrices: Sequence[Affine]) -> list[Affine | None]:
    return [combined(drift, matrices) if drift.any() else None for drift in family.drifts]


def mean(matrices: Sequence[Any]) -> Any:
    """Return the mean of some matrices."""
    return sum(matrices) / len(matrices)
