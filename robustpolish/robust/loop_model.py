"""The loop M around the uncertain blocks Delta, in units that follow from the loop itself."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, Literal

import flint
import numpy as np

from robustpolish.base.arrays import ROUNDING, SOLVED, AnyArray, AnyMatrix, Matrix, Vector
from robustpolish.base.checks import described, invalid
from robustpolish.linear.arithmetic.balls import ball, cayley, midpoint, precision, scaled
from robustpolish.linear.arithmetic.exact import power_of_two, size, typical_rate
from robustpolish.linear.systems import Realisation
from robustpolish.plants.uncertain.lft import RealElement, UncertainBlock
from robustpolish.plants.uncertain.system import UncertainSystem

# The structure of an uncertain matrix Delta: which blocks lie on its diagonal.

Kind = Literal["real", "complex", "full"]

_FORMS = '"real", "complex", ("real", copies), ("complex", copies), ("full", (rows, columns))'


@dataclass(frozen=True)
class DeltaBlock:
    """A block of Delta: so many equal copies of a number or of a full matrix.

    Attributes
    ----------
    kind : {"real", "complex", "full"}
        A real number, a complex number, or a full complex matrix.
    copies : int
    rows, columns : int
        Of one copy.
    name : str
    group : str
        Real numbers of one group, if it is not empty, have squares whose sum is at most 1; each
        counts once, however often it is repeated.
    """

    kind: Kind
    copies: int = 1
    rows: int = 1
    columns: int = 1
    name: str = ""
    group: str = ""

    @property
    def is_scalar(self) -> bool:
        """Whether one copy is a number."""
        return self.rows == self.columns == 1


@dataclass(frozen=True)
class DeltaStructure:
    """The blocks of Delta in their order, and the signals of each.

    Attributes
    ----------
    blocks : tuple of DeltaBlock
    """

    blocks: tuple[DeltaBlock, ...]

    @cached_property
    def outputs(self) -> tuple[slice, ...]:
        """Of each block, where its outputs w are: rows of Delta, columns of M."""
        return _slices([block.copies * block.rows for block in self.blocks])

    @cached_property
    def inputs(self) -> tuple[slice, ...]:
        """Of each block, where its inputs z are: columns of Delta, rows of M."""
        return _slices([block.copies * block.columns for block in self.blocks])

    @property
    def shape(self) -> tuple[int, int]:
        """Shape of M: inputs z by outputs w."""
        return (
            sum(block.copies * block.columns for block in self.blocks),
            sum(block.copies * block.rows for block in self.blocks),
        )

    @cached_property
    def together(self) -> tuple[tuple[int, ...], ...]:
        """Positions of the blocks whose sizes count as one, the root of the sum of squares."""
        groups = [block.group for block in self.blocks]
        names = dict.fromkeys(filter(None, groups))
        return tuple(tuple(k for k, own in enumerate(groups) if own == name) for name in names)

    def sizes(self, norms: Sequence[float]) -> list[float]:
        """Return the norms of the blocks, with that of its group for each that has one."""
        found = list(norms)
        for group in self.together:
            size = math.hypot(*(norms[k] for k in group))
            for k in group:
                found[k] = size
        return found

    def only(self, keep: Sequence[int]) -> DeltaStructure:
        """Return the structure of some of the blocks."""
        return DeltaStructure(tuple(self.blocks[i] for i in keep))


def structure_of(blocks: Iterable[UncertainBlock]) -> DeltaStructure:
    """Return the structure of an uncertain system: dynamics are full blocks, or complex numbers."""
    found = []
    for block in blocks:
        element = block.element
        rows, columns = element.shape
        kind: Kind = "real" if element.kind == "real" else "complex"
        if element.kind == "dynamic" and (rows, columns) != (1, 1):
            kind = "full"
        group = element.group if isinstance(element, RealElement) else ""
        found.append(DeltaBlock(kind, block.copies, rows, columns, element.name, group))
    return DeltaStructure(tuple(found))


def read_structure(blocks: Any) -> DeltaStructure:
    """Return the structure that a user wrote.

    Parameters
    ----------
    blocks : sequence
        Of ``"real"``, ``("complex", copies)``, ``("full", (rows, columns))``, of pairs of numbers
        as MATLAB's ``mussv`` takes them, or of an uncertain system's blocks.

    Returns
    -------
    DeltaStructure
    """
    if isinstance(blocks, str) or not hasattr(blocks, "__iter__"):
        raise invalid("blocks", blocks, "a list of blocks", f"Write a list of {_FORMS}.")
    items = list(blocks)
    if not items:
        raise invalid("blocks", items, "at least one block", f"Write a list of {_FORMS}.")
    if all(isinstance(item, UncertainBlock) for item in items):
        return structure_of(items)
    return DeltaStructure(tuple(_block(i, item) for i, item in enumerate(items)))


def _block(i: int, item: Any) -> DeltaBlock:
    where = ("blocks", i)
    if isinstance(item, DeltaBlock):
        return item
    if isinstance(item, str):
        item = (item, 1)
    if not hasattr(item, "__len__") or len(item) != 2:
        raise invalid(where, item, f"one of {_FORMS}", "Write the block in one of these forms.")
    first, second = item[0], item[1]
    if first in ("real", "complex") and isinstance(first, str):
        return DeltaBlock(first, _whole(where, second), name=f"{first}_{i}")  # type: ignore
    if isinstance(first, str) and first == "full":
        sizes = (second, second) if isinstance(second, int | np.integer) else second
        if not hasattr(sizes, "__len__") or len(sizes) != 2:
            raise invalid(where, item, '("full", (rows, columns))', "Give both sizes.")
        rows, columns = (_whole(where, size) for size in sizes)
    elif isinstance(first, str):
        raise invalid(where, first, '"real", "complex" or "full"', "Choose one of these.")
    else:
        rows, columns = _whole(where, first, -math.inf), _whole(where, second, -math.inf)
        if rows < 0 and columns in (0, 1):
            return DeltaBlock("real", -rows, name=f"real_{i}")
        if rows > 0 and columns == 0:
            return DeltaBlock("complex", rows, name=f"complex_{i}")
        if not (rows > 0 and columns > 0):
            remedy = "Write [-r, 0] for r copies of a real, [r, 0] of a complex number, "
            raise invalid(where, item, f"one of {_FORMS}", f"{remedy}[r, c] for a full.")
    kind: Kind = "complex" if rows == columns == 1 else "full"
    return DeltaBlock(kind, 1, rows, columns, f"{kind}_{i}")


def _whole(where: tuple[str, int], value: Any, least: float = 1) -> int:
    number = isinstance(value, int | np.integer | float) and not isinstance(value, bool)
    if not number or value != int(value):
        raise invalid(where, value, "a whole number", f"Write {_FORMS}.")
    if value < least:
        raise invalid(where, value, "a whole number above 0", "Give its number of copies or size.")
    return int(value)


def signal_positions(places: Sequence[slice], blocks: Iterable[int]) -> list[int]:
    """Return the signals of some blocks one by one, of `outputs` or `inputs` of a structure."""
    return [i for k in blocks for i in range(places[k].start, places[k].stop)]


def _slices(sizes: Sequence[int]) -> tuple[slice, ...]:
    ends = np.cumsum([0, *sizes]).tolist()
    return tuple(slice(a, b) for a, b in pairwise(ends))


def check_shape(M_shape: tuple[int, int], structure: DeltaStructure) -> None:
    """Refuse a matrix of another shape than the blocks need."""
    if M_shape != structure.shape:
        shown = described(f"blocks for M of shape {structure.shape}, and M of {M_shape}")
        remedy = "A block of r rows and c columns takes c rows and r columns of M."
        raise invalid("blocks", shown, "blocks that fit M", remedy)


# Equilibration: units of the nodes of a network that make row and column norms equal.
#
# They follow from the network: whatever units its nodes came in, the numbers are the same in the
# end, but for rounding. Powers of two would not be: a thousand is none.

# A node that acts one way only would get smaller for ever: by a factor of e in each two steps.
_STEPS = 28


def equilibrate(sizes: Matrix) -> Vector:
    """Return units d that make rows and columns of ``sizes_ij d_j / d_i`` equal in norm.

    Parameters
    ----------
    sizes : ndarray, shape (n, n)
        How much node j does to node i, at least 0. What is on the diagonal does not matter.

    Returns
    -------
    ndarray, shape (n,)
        With a geometric mean of 1.

    Notes
    -----
    Osborne's units [1]_ make the sum of squares off the diagonal least, which is a convex problem
    in their logarithms: Newton's method solves it, from units that make logarithms of the entries
    small [2]_.

    References
    ----------
    .. [1] E. E. Osborne, "On pre-conditioning of matrices", Journal of the ACM 7 (1960) 338-345.
    .. [2] A. R. Curtis, J. K. Reid, "On the automatic scaling of matrices for Gaussian
       elimination", IMA Journal of Applied Mathematics 10 (1972) 118-124.
    """
    n = len(sizes)
    used = (sizes > 0) & ~np.eye(n, dtype=bool)
    if not used.any():
        return np.ones(n)
    logs = np.log(np.where(used, sizes, 1.0))
    links = used.astype(float) + used.T
    pull = logs.sum(axis=1) - logs.sum(axis=0)
    y = _solved(np.diag(links.sum(axis=1)) - links, pull)
    value, squares = _squares(logs, used, y)
    for _ in range(_STEPS):
        out, into = squares.sum(axis=0), squares.sum(axis=1)
        curvature = 2 * (np.diag(out + into) - squares - squares.T)
        step = _solved(curvature, into - out)
        length, moved = 1.0 / max(1.0, float(np.abs(step).max())), False
        while length > 1e-6 and not moved:
            after, trial = _squares(logs, used, y + length * step)
            moved = after <= value
            if moved:
                y, value, squares = y + length * step, after, trial
            length /= 2
        if not moved or np.abs(step).max() < SOLVED:
            break
    return np.exp(y - y.mean())


def _squares(logs: Matrix, used: AnyArray, y: Vector) -> tuple[float, Matrix]:
    """Return the logarithm of the sum of squares, and all of them as shares of it."""
    exponents = np.where(used, 2 * (logs + y - y[:, None]), -np.inf)
    largest = exponents.max()
    squares = np.exp(exponents - largest)
    total = float(squares.sum())
    return float(largest + np.log(total)), squares / total


def _solved(matrix: Matrix, right: Vector) -> Vector:
    # Directions that matter less than this, relative, are left as the first guess has them.
    return np.linalg.lstsq(matrix, right, rcond=ROUNDING)[0].astype(float)


# Canonical units of a loop: doubles for searches, and balls that enclose their rounding.

BITS = 320

Balls = tuple[Any, Any, Any, Any]
"""A, B, C and D as flint.arb_mat; python-flint ships no stubs for them."""


def rounded(balls: Balls) -> Realisation:
    """Return the continuous model of the nearest doubles."""
    A, B, C, D = map(midpoint, balls)
    return Realisation(A, B, C, D, False)


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
        units = equilibrate(sizes)
        states, copies = units[:n], units[n:]
        b *= power_of_two(size(B / (states[:, None] * time * b) * copies[list(w)]))
        c *= power_of_two(size(C * states / (copies[list(z)][:, None] * c)))
    return units[:n], units[n:], b, c


# Frequencies of this share of the typical rate are rest, but for rounding.
_AT_REST = 1e-7


@dataclass(frozen=True, eq=False)
class LoopModel:
    """M from w to z in scaled units, continuous, with the structure of Delta.

    Attributes
    ----------
    structure : DeltaStructure
    model : Realisation
        Continuous: a discrete loop is mapped by z = (1 + s)/(1 - s). In units of states, signals
        and time that follow from the loop, whatever those were that it came in; rounded.
    balls : tuple of arb_mat
        A, B, C and D of `model` as they are without rounding, enclosed.
    gain : float
        Gains of `model` times this are those of the loop.
    time : float
        Frequencies of `model` times this are in rad/s, of a continuous loop; those of the map of a
        discrete one.
    step : float
        Sampling time in s, 0 for a continuous loop.
    """

    structure: DeltaStructure
    model: Realisation
    balls: Balls
    gain: float
    time: float
    step: float

    @classmethod
    def of(cls, system: UncertainSystem, performance: DeltaBlock | None = None) -> LoopModel:
        """Return the loop around the blocks, with the performance as one more block if asked."""
        structure = structure_of(system.blocks)
        one, n = system.matrices, system.nstates
        A, B, C, D = one.F[:n, :n], one.F[:n, n:], one.F[n:, :n], one.F[n:, n:]
        if performance is not None:
            structure = DeltaStructure((*structure.blocks, performance))
            B, C = np.hstack([B, one.G[:n]]), np.vstack([C, one.H[:, :n]])
            D = np.block([[D, one.G[n:]], [one.H[:, n:], one.J]])
        return cls.around((A, B, C, D), system.dt, structure)

    @classmethod
    def around(
        cls, matrices: tuple[Matrix, Matrix, Matrix, Matrix], dt: Any, structure: DeltaStructure
    ) -> LoopModel:
        """Return the loop of the matrices A, B, C and D of M around the blocks."""
        A, B, C, D = matrices
        # The states that something moves and that something sees, by the pattern of zeros.
        moved, seen = B.any(axis=1), C.any(axis=0)
        for _ in range(len(A)):
            moved = moved | (A[:, moved] != 0).any(axis=1)
            seen = seen | (A[seen] != 0).any(axis=0)
        used = np.flatnonzero(moved & seen).tolist()
        A, B, C = A[used][:, used], B[used], C[:, used]
        step = 0.0 if not dt else 1.0 if dt is True else float(dt)
        # Of each signal the number of the copy that it belongs to: these share a unit, which Delta
        # does not see.
        copies = [block for block in structure.blocks for _ in range(block.copies)]
        w = [i for i, block in enumerate(copies) for _ in range(block.rows)]
        z = [i for i, block in enumerate(copies) for _ in range(block.columns)]
        with precision(BITS):
            A, B, C, D = map(ball, (A, B, C, D))
            if dt and used:
                A, B, C, D = cayley(A, B, C, D)
            rough = tuple(map(midpoint, (A, B, C, D)))
            # A typical frequency, which does not depend on units of states.
            even = equilibrate(np.abs(rough[0]))
            time = typical_rate(rough[0] / even[:, None] * even)
            states, units, b, c = _units(rough, time, w, z)
            into, out = units[w] / b, 1 / (units[z] * c)
            left = 1 / (states * time)
            balls = (scaled(A, left, states), scaled(B, left, into),
                     scaled(C, out, states), scaled(D, out, into))  # fmt: skip
            return cls(structure, rounded(balls), balls, b * c, time, step)

    def in_unit_of_gain(self, unit: float) -> LoopModel:
        """Return the loop with deltas of size 1, and the signals of the last block in a unit."""
        model, (A, B, C, D) = self.model, self.balls
        rows = np.full(model.C.shape[0], self.gain)
        last = np.arange(len(rows))[self.structure.inputs[-1]]
        rows[last] /= unit
        with precision(BITS):
            exact = ball(np.eye(len(rows))) * flint.arb(self.gain)
            for i in last.tolist():
                exact[i, i] /= unit
            balls = A, B, exact * C, exact * D
        model = replace(model, C=model.C * rows[:, None], D=model.D * rows[:, None])
        return replace(self, model=model, balls=balls, gain=1.0)

    @cached_property
    def rate(self) -> float:
        """A typical frequency of the model, in its own units."""
        return typical_rate(self.model.A)

    def response(self, angle: float) -> tuple[AnyMatrix, AnyMatrix]:
        """Return M and its slope at the frequency ``rate * tan(angle)``.

        Raises
        ------
        numpy.linalg.LinAlgError
            If rounding sees a pole there.
        """
        A, B, C, D = (getattr(self.model, name).astype(complex) for name in "ABCD")
        if not self.model.states:
            return D, np.zeros_like(D)
        s, c, one = math.sin(angle), math.cos(angle), np.eye(len(A))
        inner = 1j * self.rate * s * one - c * A
        slope = 1j * self.rate * c * one + s * A
        states = np.linalg.solve(inner, B)
        turned = np.linalg.solve(inner, slope @ states)
        return D + c * C @ states, -s * C @ states - c * C @ turned

    def angle(self, x: float) -> float:
        """Return the angle of a frequency of the model."""
        return math.pi / 2 if math.isinf(x) else math.atan(x / self.rate)

    def start(self, x: float) -> tuple[float, bool]:
        """Return the angle where a search near a frequency begins, and whether it may move.

        What is at rest but for rounding stays there.
        """
        moves = x > _AT_REST * self.rate
        return (self.angle(x) if moves else 0.0), moves

    def frequency(self, angle: float) -> float:
        """Return the frequency of the model at an angle, positive."""
        turned = abs((angle + math.pi / 2) % math.pi - math.pi / 2)
        return math.inf if turned >= math.pi / 2 else self.rate * math.tan(turned)

    def at_positive(self, delta: AnyMatrix, angle: float) -> AnyMatrix:
        """Return what a Delta of an angle is at the positive frequency of the same mode."""
        turned = (angle + math.pi / 2) % math.pi - math.pi / 2 < 0
        return np.conj(delta) if turned else delta

    def omega(self, x: float) -> float:
        """Return a frequency of the model in rad/s."""
        if self.step:
            return 2 * math.atan(x * self.time) / self.step
        return x * self.time

    def in_rad_per_s(
        self, intervals: tuple[tuple[float, float], ...]
    ) -> tuple[tuple[float, float], ...]:
        """Return intervals of the model's frequency in rad/s."""
        return tuple((self.omega(low), self.omega(high)) for low, high in intervals)

    @property
    def acts_back(self) -> bool:
        """Whether any delta is in a loop with itself or others, by the pattern of zeros."""
        model, n, count = self.model, self.model.states, len(self.structure.blocks)
        z, w = (
            [*range(n), *np.repeat(np.arange(n, n + count), [p.stop - p.start for p in places])]
            for places in (self.structure.inputs, self.structure.outputs)
        )
        acts = np.zeros((n + count, n + count), dtype=bool)
        whole = np.block([[model.A, model.B], [model.C, model.D]]) != 0
        np.logical_or.at(acts, np.ix_(z, w), whole)
        for _ in range(len(acts).bit_length()):  # each doubles the length of paths that are seen
            acts |= acts @ acts
        return bool(acts.diagonal()[n:].any())

    def seeds(self) -> list[float]:
        """Return frequencies that are likely to matter: those of the poles."""
        if not self.model.states:
            return []
        poles: Any = np.linalg.eigvals(self.model.A)
        return sorted({float(f"{abs(pole):.6g}") for pole in poles if abs(pole) > 0})
