"""Linear fractional transformations around states and uncertain blocks, and their algebra.

A number, matrix or system with uncertainty is a matrix closed over what is inside: the integrators
of the states, and the blocks. ::

    [ x' ]   [      |   ] [ x ]
    [ z  ] = [  F   | G ] [ w ]      w = Delta z
    [ y  ]   [  H   | J ] [ u ]

States and blocks are alike for sums, products and inverses, which are those of state spaces.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from scipy.linalg import block_diag

from robustpolish.base.arrays import SAME, SOLVED, SUMMED, Matrix
from robustpolish.base.checks import described, invalid

# Uncertain elements: real numbers, complex numbers, and dynamics of bounded gain.
#
# Each is normalised to a delta of size at most 1, and 0 where it is nominal.

Kind = Literal["real", "complex", "dynamic"]


@dataclass(frozen=True)
class Directions:
    """What the directions of an ellipsoid do: numbers p = p0 + L d.

    Attributes
    ----------
    names : tuple of str
        Of the directions.
    numbers : tuple of str
        Names of the physical numbers.
    centre : tuple of float
        p0.
    slopes : tuple of tuple of float
        Rows of L.
    """

    names: tuple[str, ...]
    numbers: tuple[str, ...]
    centre: tuple[float, ...]
    slopes: tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class RealElement:
    """A real number between two others.

    Attributes
    ----------
    name : str
    nominal : float
        Within the range, not at its ends.
    low, high : float
    group : str
        Of the ellipsoid that it is a direction of, empty for a number of its own: real elements of
        one group have deltas whose sum of squares is at most 1, in all. Their nominal value is in
        the middle.
    directions : Directions or None
        What all directions of its group do to physical numbers, if that is known.

    Notes
    -----
    Where the nominal value is not in the middle, value and delta are related by a fraction,
    ``value = nominal + slope delta / (1 - skew delta)``, so that the ends are at -1 and 1.
    """

    name: str
    nominal: float
    low: float
    high: float
    group: str = ""
    directions: Directions | None = None

    kind = "real"
    shape = (1, 1)

    @property
    def skew(self) -> float:
        """How far the nominal value is from the middle: 0 there, below 1 in size."""
        up, down = self.high - self.nominal, self.nominal - self.low
        share = (up - down) / (up + down)
        return share if abs(share) > 1e-12 else 0.0  # the middle but for a percentage's rounding

    @property
    def slope(self) -> float:
        """Change of the value per delta at the nominal value."""
        up, down = self.high - self.nominal, self.nominal - self.low
        return 2 * up * (down / (up + down))

    def value(self, delta: float) -> float:
        """Return the number at a delta.

        Parameters
        ----------
        delta : float

        Returns
        -------
        float
            Infinite at the pole of the map, which lies outside the range.
        """
        step, left = self.slope * delta, 1 - self.skew * delta
        return self.nominal + step / left if left else math.copysign(math.inf, step)

    def delta(self, value: Any) -> float:
        """Return the delta of a number, which may lie outside the range.

        Parameters
        ----------
        value : float

        Returns
        -------
        float
        """
        number = real_number(self.name, value)
        change = number - self.nominal
        below = self.slope + self.skew * change
        if below <= 0:
            want = f"a number on the same side of {self.nominal - self.slope / self.skew:.6g}"
            remedy = "The range is not symmetrical, and has no meaning so far outside."
            raise invalid(self.name, value, want, remedy)
        return change / below

    def __str__(self) -> str:
        if self.group:
            return f"direction of the ellipsoid {self.group!r}"
        return f"real number {self.nominal:.6g}, from {self.low:.6g} to {self.high:.6g}"


@dataclass(frozen=True)
class ComplexElement:
    """A complex number in a disc.

    Attributes
    ----------
    name : str
    nominal : float
        Centre of the disc; real, as the matrices of a nominal system are.
    radius : float
    """

    name: str
    nominal: float
    radius: float

    kind = "complex"
    shape = (1, 1)

    def value(self, delta: complex) -> complex:
        """Return the number at a delta.

        Parameters
        ----------
        delta : complex

        Returns
        -------
        complex
        """
        return self.nominal + self.radius * delta

    def __str__(self) -> str:
        return f"complex number {self.nominal:.6g}, within {self.radius:.6g}"


@dataclass(frozen=True)
class DynamicElement:
    """Any stable system whose largest gain is at most 1.

    Attributes
    ----------
    name : str
    shape : (int, int)
        Outputs and inputs.
    """

    name: str
    shape: tuple[int, int] = (1, 1)

    kind = "dynamic"

    def __str__(self) -> str:
        return f"dynamics {self.shape[0]} x {self.shape[1]} of gain at most 1"


Element = RealElement | ComplexElement | DynamicElement


@dataclass(frozen=True)
class UncertainBlock:
    """An element and how often it occurs: the diagonal block of so many equal deltas.

    Attributes
    ----------
    element : RealElement, ComplexElement or DynamicElement
    copies : int
    """

    element: Element
    copies: int

    @property
    def rows(self) -> int:
        """Number of signals w that come out of it."""
        return self.copies * self.element.shape[0]

    @property
    def columns(self) -> int:
        """Number of signals z that go into it."""
        return self.copies * self.element.shape[1]


def checked_name(name: Any) -> str:
    """Return the name of an element if it is one."""
    if not isinstance(name, str) or not name.strip():
        raise invalid("name", name, "a name as text", 'Name it, such as "k".')
    return name


def real_element(
    name: str,
    nominal: float,
    *,
    percent: float | tuple[float, float] | None = None,
    plus_minus: float | tuple[float, float] | None = None,
    low_high: tuple[float, float] | None = None,
) -> RealElement:
    """Return a real element from any of the ways in which a range is told."""
    name, nominal = checked_name(name), real_number("nominal", nominal)
    given = {"percent": percent, "plus_minus": plus_minus, "range": low_high}
    told = [key for key, value in given.items() if value is not None]
    if len(told) != 1:
        shown = described(" and ".join(told) if told else "none of them")
        expected = "one of percent, plus_minus and range"
        raise invalid("range", shown, expected, "Say how far it may be off, once.")
    if low_high is not None:
        low, high = _pair("range", low_high)
    else:
        size = abs(nominal) / 100 if percent is not None else 1.0
        if size == 0:
            remedy = "Give plus_minus or range instead."
            raise invalid("percent", percent, "a nominal value other than 0", remedy)
        spread: Any = percent if percent is not None else plus_minus
        down, up = _pair(told[0], spread) if _is_pair(spread) else (-spread, spread)
        down, up = real_number(told[0], down), real_number(told[0], up)
        low, high = nominal + size * down, nominal + size * up
    if not low < nominal < high:
        shown = described(f"{low:.6g} to {high:.6g}")
        expected = f"a range around the nominal value {nominal:.6g}"
        raise invalid(told[0], shown, expected, "Put the smaller end first, and both apart of it.")
    return RealElement(name, nominal, low, high)


def _is_pair(value: Any) -> bool:
    return not isinstance(value, str) and hasattr(value, "__len__")


def _pair(argument: str, value: Any) -> tuple[float, float]:
    if not _is_pair(value) or len(value) != 2:
        raise invalid(argument, value, "two numbers, the smaller first", "Write (low, high).")
    return real_number(argument, value[0]), real_number(argument, value[1])


def real_number(argument: str, value: Any) -> float:
    """Return a finite real number."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise invalid(argument, value, "a real number", "Pass a number.") from None
    if isinstance(value, str | bool) or not math.isfinite(number):
        raise invalid(argument, value, "a finite real number", "Pass a number.")
    return number


# Ellipsoids of real elements: physical numbers, and points drawn from them.


def groups(blocks: Iterable[UncertainBlock]) -> list[list[RealElement]]:
    """Return the elements of each group."""
    found: dict[str, list[RealElement]] = {}
    for block in blocks:
        if isinstance(block.element, RealElement) and block.element.group:
            found.setdefault(block.element.group, []).append(block.element)
    return list(found.values())


def physical(blocks: Iterable[UncertainBlock], values: Mapping[str, Any]) -> dict[str, Any]:
    """Return values with physical numbers in place of the directions of ellipsoids."""
    found: dict[str, Any] = {}
    rest = dict(values)
    for members in groups(blocks):
        known = members[0].directions
        if known and any(name in rest for name in known.names):
            found |= numbers_at(known, rest)
            rest = {name: value for name, value in rest.items() if name not in known.names}
    return found | rest


def by_element(blocks: Sequence[UncertainBlock], values: Mapping[str, Any]) -> dict[str, Any]:
    """Return values with the directions of ellipsoids in place of physical numbers.

    Directions that the system does not depend on are left out.
    """
    rest, elements = dict(values), {block.element.name for block in blocks}
    for members in groups(blocks):
        known = members[0].directions
        if known is None:
            continue
        named = {n: rest.pop(n) for n in known.numbers if n in rest and n not in elements}
        twice = [name for name in known.names if name in rest]
        if named and twice:
            shown = described(f"{', '.join(named)} and {', '.join(twice)}")
            remedy = "Give the physical numbers of an ellipsoid, or its directions."
            raise invalid("values", shown, "one way to name a point", remedy)
        rest |= point_of(known, named) if named else {}
        idle = {name for name in known.names if name not in elements}
        rest = {name: value for name, value in rest.items() if name not in idle}
    return rest


def numbers_at(known: Directions, values: Mapping[str, Any]) -> dict[str, float]:
    """Return the physical numbers at a point of an ellipsoid; directions not named are 0."""
    deltas = [real_number(name, values.get(name, 0.0)) for name in known.names]
    numbers = np.array(known.centre) + np.array(known.slopes) @ deltas
    return dict(zip(known.numbers, numbers.tolist(), strict=True))


def point_of(known: Directions, values: Mapping[str, Any]) -> dict[str, float]:
    """Return the directions of the point nearest to the centre that has some physical numbers."""
    rows = [known.numbers.index(name) for name in values]
    slopes = np.array(known.slopes)[rows]
    changes = np.array([real_number(n, v) for n, v in values.items()])
    changes = changes - np.array(known.centre)[rows]
    # Rows in units of their own largest change: numbers of any unit are alike.
    units = np.linalg.norm(slopes, axis=1)
    units[units == 0] = 1.0
    slopes, changes = slopes / units[:, None], changes / units
    deltas = np.linalg.pinv(slopes, rcond=1e-12) @ changes
    left = np.abs(slopes @ deltas - changes).max(initial=0.0)
    # Relative size of what is left of numbers that no point of the ellipsoid's space has.
    if left > SAME * np.abs(changes).max(initial=1.0):
        shown = described(", ".join(values))
        remedy = "What is certain cannot be changed: leave it out, or give fewer numbers."
        raise invalid("values", shown, "numbers that the ellipsoid can have together", remedy)
    return dict(zip(known.names, deltas.tolist(), strict=True))


def drawn(members: Sequence[RealElement], random: np.random.Generator) -> dict[str, float]:
    """Draw a point of an ellipsoid, evenly."""
    direction = random.standard_normal(len(members))
    direction *= random.uniform() ** (1 / len(members)) / np.linalg.norm(direction)
    return {m.name: m.value(float(d)) for m, d in zip(members, direction, strict=True)}


# Reduction of repeated blocks.
#
# Copies of a block are to its delta what states are to an integrator [1]_. Those outside the span
# that other signals reach are nothing but zero, and those that no other signal sees do not matter.
#
# References
# ----------
# .. [1] C. L. Beck, J. Doyle, K. Glover, "Model reduction of multidimensional and uncertain
#    systems", IEEE Transactions on Automatic Control 41 (1996) 1466-1477.

# What is left of a direction, relative to its size, below which it is one that was there already:
# far above the rounding of a few products, far below any coupling that somebody meant.
_NEW = 1e-10
# Relative size of a direction that is nothing but rounding of the largest.
_ROUNDING = 1e-15


def _invariant_subspace(start: Matrix, steps: Matrix) -> Matrix:
    """Return an orthonormal basis of the least space with `start` that all `steps` map into it."""
    basis = np.zeros((start.shape[0], 0))
    fresh = _beyond(start, basis)
    while fresh.shape[1]:
        basis = np.hstack([basis, fresh])
        fresh = _beyond(np.hstack(list(steps @ fresh)), basis)
    return basis


def _beyond(candidates: Matrix, basis: Matrix) -> Matrix:
    """Return orthonormal directions of the candidates outside a space, each in its own size."""
    sizes = np.linalg.norm(candidates, axis=0)
    used = sizes > _ROUNDING * sizes.max(initial=0.0)
    left = candidates[:, used] / sizes[used]
    for _ in range(2):  # the second projection removes the rounding of the first
        left = left - basis @ (basis.T @ left)
    fresh = np.zeros((len(basis), 0))
    while left.shape[1]:
        sizes = np.linalg.norm(left, axis=0)
        best = int(np.argmax(sizes))
        if sizes[best] <= _NEW:
            break
        direction = left[:, best] / sizes[best]
        direction -= basis @ (basis.T @ direction) + fresh @ (fresh.T @ direction)
        direction /= np.linalg.norm(direction)
        fresh = np.column_stack([fresh, direction])
        left = left - np.outer(direction, direction @ left)
    return fresh


@dataclass(frozen=True, eq=False)
class Lft:
    """Matrices of a system around its states and uncertain blocks.

    Attributes
    ----------
    F, G, H, J : ndarray
        From what is inside (states, then the blocks in their order) and the inputs, to what is
        inside and the outputs.
    states : tuple of str
        Names of the states.
    blocks : tuple of Block
        Each element once.
    dt : float, True or None
        Sampling time; 0 in continuous time, None for what has no time.
    inputs, outputs : tuple of str
        Names, or empty.
    """

    F: Matrix
    G: Matrix
    H: Matrix
    J: Matrix
    states: tuple[str, ...] = ()
    blocks: tuple[UncertainBlock, ...] = ()
    dt: float | bool | None = None
    inputs: tuple[str, ...] = field(default=())
    outputs: tuple[str, ...] = field(default=())

    @property
    def shape(self) -> tuple[int, int]:
        """Outputs and inputs."""
        return self.J.shape

    @property
    def whole(self) -> Matrix:
        """All matrices as one."""
        return np.block([[self.F, self.G], [self.H, self.J]])

    def names(self, inputs: Sequence[str], outputs: Sequence[str]) -> Lft:
        """Return it with other names of inputs and outputs; dropped if they do not fit."""
        ny, nu = self.shape
        ins = tuple(inputs) if len(inputs) == nu else ()
        return replace(self, inputs=ins, outputs=tuple(outputs) if len(outputs) == ny else ())


def constant(matrix: Matrix) -> Lft:
    """Return a matrix that is certain."""
    ny, nu = matrix.shape
    return Lft(np.zeros((0, 0)), np.zeros((0, nu)), np.zeros((ny, 0)), matrix)


def total(one: Lft, two: Lft) -> Lft:
    """Return the sum; one entry is added to every entry."""
    one, two = _as_large(one, two), _as_large(two, one)
    if one.shape != two.shape:
        raise _mismatch("added to", one, two)
    H = np.hstack([one.H, two.H])
    F, G = _diagonal(one.F, two.F), np.vstack([one.G, two.G])
    return _merged(F, G, H, one.J + two.J, one, two).names(one.inputs, one.outputs)


def product(one: Lft, two: Lft) -> Lft:
    """Return `one` after `two`; one entry multiplies every entry."""
    if one.shape == (1, 1) != two.shape and two.shape[0] != 1:
        one = repeated(one, two.shape[0])
    elif two.shape == (1, 1) != one.shape and one.shape[1] != 1:
        two = repeated(two, one.shape[1])
    if one.shape[1] != two.shape[0]:
        raise _mismatch("multiplied with", one, two)
    below = np.zeros((two.F.shape[0], one.F.shape[1]))
    F = np.block([[one.F, one.G @ two.H], [below, two.F]])
    G = np.vstack([one.G @ two.J, two.G])
    H = np.hstack([one.H, one.J @ two.H])
    return _merged(F, G, H, one.J @ two.J, one, two).names(two.inputs, one.outputs)


def inverse(one: Lft) -> Lft:
    """Return the inverse of a square system."""
    if one.shape[0] != one.shape[1]:
        shown = described(f"shape {one.shape}")
        raise invalid("system", shown, "as many inputs as outputs", "Only these have an inverse.")
    J = _inverted(one.J, "the inverse", "an invertible feedthrough at the nominal values")
    JH = J @ one.H
    return replace(one, F=one.F - one.G @ JH, G=one.G @ J, H=-JH, J=J).names(
        one.outputs, one.inputs
    )


def block_diagonal(parts: Sequence[Lft]) -> Lft:
    """Return systems side by side."""
    result = parts[0]
    for part in parts[1:]:
        F, G, H, J = (_diagonal(getattr(result, n), getattr(part, n)) for n in "FGHJ")
        inputs, outputs = (*result.inputs, *part.inputs), (*result.outputs, *part.outputs)
        result = _merged(F, G, H, J, result, part).names(inputs, outputs)
    return result


def repeated(one: Lft, times: int) -> Lft:
    """Return the same system for each of several signals: one with each of them."""
    return block_diagonal([one] * times)


def interconnect(one: Lft, loop: Matrix, enter: Matrix, leave: Matrix) -> Lft:
    """Return the system from r to ``leave y`` with ``u = loop y + enter r``."""
    back = np.eye(one.shape[0]) - one.J @ loop
    back = _inverted(back, "the loop", "a loop that is well posed")
    onto = loop @ back
    J = (one.J + one.J @ onto @ one.J) @ enter
    G = (one.G + one.G @ onto @ one.J) @ enter
    H = leave @ (one.H + one.J @ onto @ one.H)
    F, J = one.F + one.G @ onto @ one.H, leave @ J
    return replace(one, F=F, G=G, H=H, J=J, inputs=(), outputs=())


def pull_out_block(one: Lft, index: int) -> Lft:
    """Return the system with the signals of a block as its first inputs and outputs."""
    z, w = block_slices(one)[index]
    rest_z = np.delete(np.arange(one.F.shape[0]), z)
    rest_w = np.delete(np.arange(one.F.shape[1]), w)
    F, blocks = one.F, one.blocks[:index] + one.blocks[index + 1 :]
    G = np.hstack([F[rest_z][:, w], one.G[rest_z]])
    H = np.vstack([F[z][:, rest_w], one.H[:, rest_w]])
    J = np.block([[F[z][:, w], one.G[z]], [one.H[:, w], one.J]])
    inside = F[rest_z][:, rest_w]
    return replace(one, F=inside, G=G, H=H, J=J, blocks=blocks, inputs=(), outputs=())


def block_slices(one: Lft) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return for each block its rows (z) and columns (w) of F."""
    row = column = len(one.states)
    found = []
    for block in one.blocks:
        found.append((np.arange(row, row + block.columns), np.arange(column, column + block.rows)))
        row, column = row + block.columns, column + block.rows
    return found


def common_time(one: Lft, two: Lft) -> float | bool | None:
    """Return the sampling time of two systems together."""
    times = [part.dt for part in (one, two) if part.dt is not None]
    if not times:
        return None
    first, last = times[0], times[-1]
    if (first == 0) != (last == 0) or not (first is True or last is True or first == last):
        shown = described(f"sampling times {first} and {last}")
        raise invalid("system", shown, "systems of one sampling time", "Convert one of them.")
    return last if first is True else first


def _as_large(one: Lft, other: Lft) -> Lft:
    """Return a single entry as often as another system has entries."""
    if one.shape != (1, 1) or other.shape == (1, 1):
        return one
    ny, nu = other.shape
    return product(product(constant(np.ones((ny, 1))), one), constant(np.ones((1, nu))))


def _merged(F: Matrix, G: Matrix, H: Matrix, J: Matrix, one: Lft, two: Lft) -> Lft:
    """Sort what is inside two systems: states first, then each element once."""
    known: dict[str, Element] = {}
    for block in (*one.blocks, *two.blocks):
        name = block.element.name
        if known.setdefault(name, block.element) != block.element:
            shown = described(f"{known[name]}, and {block.element}")
            remedy = "Give different things different names."
            raise invalid(name, shown, "one meaning of a name", remedy)
    n1, n2 = len(one.states), len(two.states)
    rows = [*range(n1), *(one.F.shape[0] + i for i in range(n2))]
    columns = [*range(n1), *(one.F.shape[1] + i for i in range(n2))]
    blocks = []
    for name, element in known.items():
        copies = 0
        for part, row0, column0 in ((one, 0, 0), (two, *one.F.shape)):
            for block, (z, w) in zip(part.blocks, block_slices(part), strict=True):
                if block.element.name == name:
                    rows += (z + row0).tolist()
                    columns += (w + column0).tolist()
                    copies += block.copies
        blocks.append(UncertainBlock(element, copies))
    states = _distinct((*one.states, *two.states))
    inside, time = (F[rows][:, columns], G[rows], H[:, columns], J), common_time(one, two)
    return reduce_copies(Lft(*inside, states, tuple(blocks), time))


def reduce_copies(one: Lft) -> Lft:
    """Return the system with as few copies of each block as one-dimensional reductions leave.

    A block's copies are to its delta what states are to an integrator: those that nothing else
    moves, or that nothing else sees, are taken out.
    """
    whole = one.whole
    used = all(
        np.delete(whole[z], w, axis=1).any() and np.delete(whole[:, w], z, axis=0).any()
        for z, w in block_slices(one)
    )
    if used and not any(block.copies > 1 for block in one.blocks):
        return one
    before = None
    while before != [block.copies for block in one.blocks]:
        before = [block.copies for block in one.blocks]
        for index in range(len(one.blocks)):
            one = _block_reduced(one, index)
        one = replace(one, blocks=tuple(block for block in one.blocks if block.copies))
    return one


def _block_reduced(one: Lft, index: int) -> Lft:
    block, whole = one.blocks[index], one.whole
    (z, w), copies, (p, q) = block_slices(one)[index], block.copies, block.element.shape
    # From everything else to the inputs of each copy, and from its outputs to everything else.
    enter = np.delete(whole[z], w, axis=1).reshape(copies, -1)
    leave = np.delete(whole[:, w], z, axis=0)
    leave = leave.reshape(len(leave), copies, p).transpose(0, 2, 1).reshape(-1, copies)
    # Powers of two make each copy as easily moved as seen: units have no say. One that is only
    # seen by rounding must not be made as visible as the others.
    into, out, scale = np.linalg.norm(enter, axis=1), np.linalg.norm(leave, axis=0), np.ones(copies)
    # Relative size of a coupling that may be rounding of others.
    used = (into > SOLVED * into.max(initial=0.0)) & (out > SOLVED * out.max(initial=0.0))
    scale[used] = np.exp2(np.round(np.log2(into[used] / out[used]) / 2))
    own = whole[z][:, w].reshape(copies, q, copies, p).transpose(1, 3, 0, 2)
    steps = own.reshape(-1, copies, copies) * scale[None, None, :] / scale[None, :, None]
    reached = _invariant_subspace(enter / scale[:, None], steps)
    inner = np.einsum("ai,kab,bj->kij", reached, steps, reached)
    visible = _invariant_subspace((leave * scale @ reached).T, inner.transpose(0, 2, 1))
    basis = reached @ visible
    if basis.shape[1] == copies:
        return one
    # Copies are `scale basis` times the fewer ones, and these `basis' / scale` times the copies.
    turned = np.kron(basis.T / scale, np.eye(q)), np.kron(scale[:, None] * basis, np.eye(p))
    left, right = (
        _diagonal(np.eye(places[0]), middle, np.eye(count - places[-1] - 1))
        for places, middle, count in zip((z, w), turned, whole.shape, strict=True)
    )
    size = np.abs(left) @ np.abs(whole) @ np.abs(right)
    whole = left @ whole @ right
    # What cancels is zero: its rounding would look like a coupling to the next reduction.
    whole[np.abs(whole) <= SUMMED * size] = 0.0
    fewer = UncertainBlock(block.element, basis.shape[1])
    n = one.F.shape[0] - block.columns + fewer.columns
    m = one.F.shape[1] - block.rows + fewer.rows
    F, G, H, J = whole[:n, :m], whole[:n, m:], whole[n:, :m], whole[n:, m:]
    blocks = (*one.blocks[:index], fewer, *one.blocks[index + 1 :])
    return replace(one, F=F, G=G, H=H, J=J, blocks=blocks)


def _diagonal(*parts: Any) -> Matrix:
    result: Any = block_diag(*parts)
    return result


def _inverted(M: Matrix, what: str, want: str) -> Any:
    """Return the inverse; whether there is one does not depend on the units of the signals."""
    try:
        inverse: Any = np.linalg.inv(M)
        # Row scales cancel in |M^-1| |M|, column scales in its eigenvalues.
        if np.abs(np.linalg.eigvals(np.abs(inverse) @ np.abs(M))).max(initial=0) < 1 / SOLVED:
            return inverse
    except np.linalg.LinAlgError:
        pass
    shown = described(f"a singular matrix for {what}")
    raise invalid("system", shown, want, "Check its direct feedthrough.")


def _mismatch(verb: str, one: Lft, two: Lft) -> Exception:
    shown = described(f"{one.shape[0]} x {one.shape[1]} {verb} {two.shape[0]} x {two.shape[1]}")
    return invalid("system", shown, "sizes that fit", "Check numbers of inputs and outputs.")


def _distinct(names: tuple[str, ...]) -> tuple[str, ...]:
    return names if len(set(names)) == len(names) else tuple(f"x[{i}]" for i in range(len(names)))
