"""A loop around real numbers as polynomials in them and in the frequency, in ball arithmetic.

P is the characteristic polynomial of a loop with numbers in it, all denominators multiplied out,
and N / P the system that the one other block sees: the loop has a pole at j w just if P(j w) = 0,
and a block of size k that puts one there just if |P| <= k ||N||.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from math import prod
from typing import Any

import flint
import numpy as np

from robustpolish.exact.balls import identity, part
from robustpolish.robust.branching.bernstein import Balls, along, from_values, nodes
from robustpolish.robust.loop_model import LoopModel
from robustpolish.robust.structure import positions


@dataclass(frozen=True, eq=False)
class Family:
    """Polynomials of a loop over a box of its real numbers.

    Attributes
    ----------
    real : tuple of int
        Positions of the blocks that are real numbers, one axis each.
    rest : (int, int)
        Rows and columns of N; 0 if there is no other block.
    degrees : tuple of int
        In each number, of P and N.
    size : float
        The box is between -/+ size.
    parts : ndarray of arb, shape (polynomials, degree 1 + 1, ..., states + 1)
        P, then the entries of N: Bernstein coefficients over the box, of powers of s.
    """

    real: tuple[int, ...]
    rest: tuple[int, int]
    degrees: tuple[int, ...]
    size: float
    parts: Balls

    @property
    def states(self) -> int:
        """Degree in s."""
        return self.parts.shape[-1] - 1


def is_small(loop: LoopModel, most: int) -> bool:
    """Say whether a loop has polynomials, and not too many coefficients.

    Parameters
    ----------
    loop : LoopModel
    most : int
        Coefficients of all numbers together.
    """
    blocks, n = loop.structure.blocks, loop.model.states
    real = [block for block in blocks if block.kind == "real"]
    others = [block for block in blocks if block.kind != "real"]
    if not real or not n or len(others) > 1:
        return False
    if others and others[0].copies != 1:
        return False
    entries = 1 + sum(block.rows * block.columns for block in others)
    return prod(block.copies + 1 for block in real) * (n + 1) * entries <= most


def family(loop: LoopModel, size: float) -> Family:
    """Return the polynomials of a loop over the box of real numbers up to a size.

    Parameters
    ----------
    loop : LoopModel
        With real numbers, and at most one other block that occurs once.
    size : float
        Of the largest number.

    Returns
    -------
    Family

    Raises
    ------
    ZeroDivisionError
        If the loop is not well posed at one of the numbers that are tried.
    """
    blocks = loop.structure.blocks
    real = tuple(k for k, block in enumerate(blocks) if block.kind == "real")
    others = [k for k in range(len(blocks)) if k not in real]
    degrees = tuple(blocks[k].copies for k in real)
    closed = _Closed(loop, real, others)
    shape = tuple(degree + 1 for degree in degrees)
    parts: Any = None
    for place in product(*(range(count) for count in shape)):
        numbers = [
            flint.arb(size) * flint.arb(2 * nodes(degree)[j] - 1)
            for j, degree in zip(place, degrees, strict=True)
        ]
        values = closed.polynomials(numbers)
        if parts is None:
            parts = np.empty((len(values), *shape, loop.model.states + 1), dtype=object)
        for i, coefficients in enumerate(values):
            parts[(i, *place)] = coefficients
    for axis, degree in enumerate(degrees):
        parts = along(from_values(degree), parts, axis + 1)
    return Family(real, closed.shape, degrees, size, parts)


class _Closed:
    """The loop with numbers in place of its real blocks."""

    def __init__(self, loop: LoopModel, real: tuple[int, ...], others: list[int]) -> None:
        structure = loop.structure
        z, out = (positions(structure.inputs, blocks) for blocks in (real, others))
        w, into = (positions(structure.outputs, blocks) for blocks in (real, others))
        self.copies = [structure.blocks[k].copies for k in real]
        A, B, C, D = loop.balls
        states = range(loop.model.states)
        self.A, self.B, self.C = A, part(B, states, w), part(C, z, states)
        self.D = part(D, z, w)
        self.shape = len(out), len(into)
        if out:
            self.B2, self.C2 = part(B, states, into), part(C, out, states)
            self.D12, self.D21 = part(D, z, into), part(D, out, w)
            self.D22 = part(D, out, into)

    def polynomials(self, numbers: list[Any]) -> list[list[Any]]:
        """Return P and the entries of N: their coefficients, the constant one first."""
        r = sum(self.copies)
        spread = [value for value, c in zip(numbers, self.copies, strict=True) for _ in range(c)]
        gains = flint.arb_mat(r, r)
        for i, value in enumerate(spread):
            gains[i, i] = value
        back = identity(r) - self.D * gains
        scale = back.det()
        onto = gains * back.inv()
        A = self.A + self.B * onto * self.C
        P = A.charpoly()
        found = [P * scale]
        if self.shape[0]:
            B2 = self.B2 + self.B * onto * self.D12
            C2 = self.C2 + self.D21 * onto * self.C
            D2 = self.D22 + self.D21 * onto * self.D12
            for i, j in product(range(self.shape[0]), range(self.shape[1])):
                row = flint.arb_mat([C2.tolist()[i]])
                column = flint.arb_mat([[line[j]] for line in B2.tolist()])
                # det(s - A + b c) = det(s - A) (1 + c (s - A)^-1 b)
                shifted = (A - column * row).charpoly()
                found.append((shifted - P + P * D2[i, j]) * scale)
        n = A.nrows()
        return [[one[power] for power in range(n + 1)] for one in found]
