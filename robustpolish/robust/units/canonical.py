"""A loop in units that are its own: doubles for searches, and balls that hold what they round."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import flint
import numpy as np

from robustpolish.arrays import Matrix, Vector
from robustpolish.exact.balls import ball, identity, midpoint, precision
from robustpolish.exact.realisation import Realisation, power_of_two, size, typical_rate
from robustpolish.robust.units.evened import evened

BITS = 320

Matrices = tuple[Matrix, Matrix, Matrix, Matrix]
Balls = tuple[Any, Any, Any, Any]
"""A, B, C and D as flint.arb_mat; python-flint ships no stubs for them."""


@dataclass(frozen=True, eq=False)
class Canonical:
    """A continuous model in units that follow from itself.

    Attributes
    ----------
    model : Realisation
        The nearest doubles.
    balls : tuple of arb_mat
        A, B, C and D, enclosed: what is proven of them holds for the loop as it was given.
    time : float
        Frequencies of `model` times this are those of the given one.
    gain : float
        Gains of `model` times this are those of the given one: a power of two.
    """

    model: Realisation
    balls: Balls
    time: float
    gain: float


def canonical(matrices: Matrices, discrete: bool, w: Sequence[int], z: Sequence[int]) -> Canonical:
    """Return a model in units of states, signals and time that do not depend on those given.

    Parameters
    ----------
    matrices : tuple of ndarray
        A, B, C and D.
    discrete : bool
        Whether it is a discrete model, which is mapped by z = (1 + s)/(1 - s).
    w, z : sequence of int
        Of each input and output the number of the copy of a block that it belongs to: these share
        a unit, which Delta does not see.

    Returns
    -------
    Canonical
    """
    with precision(BITS):
        given = tuple(ball(M) if M.size else flint.arb_mat(*M.shape) for M in matrices)
        A, B, C, D = _cayley(given) if discrete and len(matrices[0]) else given
        rough = tuple(map(midpoint, (A, B, C, D)))
        time = _rate(rough[0])
        states, copies, b, c = _units(rough, time, w, z)
        into, out = copies[list(w)] / b, 1 / (copies[list(z)] * c)
        left, right = _diagonal(1 / (states * time)), _diagonal(states)
        balls = (
            left * A * right,
            left * B * _diagonal(into),
            _diagonal(out) * C * right,
            _diagonal(out) * D * _diagonal(into),
        )
        return Canonical(rounded(balls), balls, time, b * c)


def rounded(balls: Balls) -> Realisation:
    """Return the continuous model of the nearest doubles."""
    A, B, C, D = map(midpoint, balls)
    return Realisation(A, B, C, D, False)


def _cayley(given: tuple[Any, ...]) -> Balls:
    """Return the continuous model with the same gains."""
    A, B, C, D = given
    one, root = identity(A.nrows()), flint.arb(2).sqrt()
    inverse = (A + one).inv()
    return inverse * (A - one), inverse * B * root, C * inverse * root, D - C * inverse * B


def _diagonal(scales: Vector) -> Any:
    matrix = flint.arb_mat(len(scales), len(scales))
    for i, scale in enumerate(scales):
        matrix[i, i] = float(scale)
    return matrix


def _rate(A: Matrix) -> float:
    """Return a typical frequency, which does not depend on units of states."""
    if not len(A):
        return 1.0
    states = evened(np.abs(A))
    return typical_rate(A / states[:, None] * states)


def _units(
    matrices: tuple[Matrix, ...], time: float, w: Sequence[int], z: Sequence[int]
) -> tuple[Vector, Vector, float, float]:
    """Return units of states and copies, and powers of two that bring B and C near one."""
    A, B, C, D = matrices
    n, count = len(A), max([*w, *z, -1]) + 1
    nodes_w, nodes_z = [*range(n), *(n + i for i in w)], [*range(n), *(n + i for i in z)]
    units, b, c = np.ones(n + count), 1.0, 1.0
    for _ in range(2):  # how large B and C are beside A decides on the units, and they on B and C
        whole = np.block([[A / time, B / (time * b)], [C / c, D / (b * c)]])
        sizes = np.zeros((n + count, n + count))
        np.hypot.at(sizes, np.ix_(nodes_z, nodes_w), np.abs(whole))
        units = evened(sizes)
        states, copies = units[:n], units[n:]
        b *= power_of_two(size(B / (states[:, None] * time * b) * copies[list(w)]))
        c *= power_of_two(size(C * states / (copies[list(z)][:, None] * c)))
    return units[:n], units[n:], b, c
