"""`UncertainSystem`: a number, matrix or system of which only bounds are known."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import control
import numpy as np
from numpy.typing import NDArray

from robustpolish.base import checks
from robustpolish.base.arrays import Matrix
from robustpolish.base.results import Card, Displayed, Table
from robustpolish.linear.systems import as_state_space, is_system, named_system
from robustpolish.plants.blocks import matrices_of
from robustpolish.plants.uncertain import lft as algebra
from robustpolish.plants.uncertain.lft import (
    ComplexElement,
    Element,
    Lft,
    RealElement,
    UncertainBlock,
    block_diagonal,
    constant,
    product,
)

# Substitution of values: given, nominal and random ones.


def substitute(system: Lft, values: Mapping[str, Any]) -> Lft:
    """Return the system with values in place of some of its elements."""
    values = algebra.by_element(system.blocks, values)
    known = [block.element.name for block in system.blocks]
    for name in values:
        if name not in known:
            want = f"names among {', '.join(known)}"
            raise checks.invalid("values", name, want, checks.closest_name_remedy(name, known))
    for name, value in values.items():
        index = [block.element.name for block in system.blocks].index(name)
        block = system.blocks[index]
        system = close_block(system, index, normalised(block.element, value, system.dt))
    return system


def normalised(element: Element, value: Any, dt: Any) -> Lft:
    """Return the delta of an element that stands for a value, as a real system."""
    if isinstance(element, RealElement):
        return constant(np.array([[element.delta(value)]]))
    if not isinstance(value, control.LTI) and np.any(np.imag(value)):
        remedy = "A complex number is no real system: pass one that has this value at a frequency."
        raise checks.invalid(element.name, value, "a real number or a stable system", remedy)
    plain = value if isinstance(value, control.LTI) else np.real(value)
    system = as_lft(as_state_space(element.name, plain, dt))
    if system.shape != element.shape:
        shown = checks.described(f"{system.shape[0]} x {system.shape[1]}")
        wanted = f"{element.shape[0]} x {element.shape[1]}"
        raise checks.invalid(element.name, shown, wanted, "Check its inputs and outputs.")
    if isinstance(element, ComplexElement):
        radius, J = element.radius, system.J - element.nominal
        return Lft(system.F, system.G, system.H / radius, J / radius, system.states, (), system.dt)
    return system


def close_block(system: Lft, index: int, delta: Lft) -> Lft:
    """Return the system with a delta in place of a block."""
    block = system.blocks[index]
    opened = algebra.pull_out_block(system, index)
    both = block_diagonal([opened, algebra.repeated(delta, block.copies)])
    z, w = block.columns, block.rows
    ny, nu = system.shape
    loop = np.zeros((w + nu + z, z + ny + w))  # inputs: w, u, delta's z; outputs: z, y, delta's w
    loop[:w, z + ny :] = np.eye(w)
    loop[w + nu :, :z] = np.eye(z)
    enter, leave = np.zeros((w + nu + z, nu)), np.zeros((ny, z + ny + w))
    enter[w : w + nu] = np.eye(nu)
    leave[:, z : z + ny] = np.eye(ny)
    return algebra.interconnect(both, loop, enter, leave).names(system.inputs, system.outputs)


def nominal(system: Lft) -> Lft:
    """Return the system with every delta 0."""
    n = len(system.states)
    return replace(system, F=system.F[:n, :n], G=system.G[:n], H=system.H[:, :n], blocks=())


def as_lft(system: control.StateSpace) -> Lft:
    """Return a certain system as one without blocks."""
    labels = tuple(system.input_labels), tuple(system.output_labels)
    if not system.nstates:
        return Lft(*matrices_of(system), (), (), None, *labels)
    return Lft(*matrices_of(system), tuple(system.state_labels), (), system.dt, *labels)


def random_values(system: Lft, random: np.random.Generator) -> dict[str, Any]:
    """Draw values of all elements: numbers evenly within their bounds, dynamics as all-passes."""
    values: dict[str, Any] = {}
    for members in algebra.groups(system.blocks):
        values |= algebra.drawn(members, random)
    for element in (block.element for block in system.blocks):
        if element.name in values:
            continue
        if isinstance(element, RealElement):
            values[element.name] = float(random.uniform(element.low, element.high))
            continue
        value: Any = _all_pass(element.shape, system, random)
        if isinstance(element, ComplexElement):
            value = element.nominal + element.radius * value
        values[element.name] = value
    return values


def _all_pass(
    shape: tuple[int, int], system: Lft, random: np.random.Generator
) -> control.StateSpace:
    """Draw a stable system whose gain is at most 1, with a lag at a rate of the system."""
    p, q = shape
    gain: Matrix = random.standard_normal((p, q))
    gain *= np.sqrt(random.uniform()) / np.linalg.norm(gain, 2)
    n = len(system.states)
    rates = np.abs(np.linalg.eigvals(system.F[:n, :n])) if n else np.zeros(0)
    sign = random.choice([-1.0, 1.0])
    spread = float(np.exp(random.normal()))
    if system.dt:
        pole = float(random.uniform(-0.9, 0.9))
        a, b = pole, 1 - pole**2
        lag = (np.eye(q) * a, np.eye(q), np.eye(q) * b, np.eye(q) * -pole)
    else:
        rates = rates[rates > 0]
        rate = spread * (float(np.exp(np.mean(np.log(rates)))) if rates.size else 1.0)
        lag = (np.eye(q) * -rate, np.eye(q), np.eye(q) * -2 * rate, np.eye(q))
    A, B, C, D = lag
    return control.StateSpace(A, B, sign * gain @ C, sign * gain @ D, system.dt or 0)


_OPERANDS = "an uncertain object, a system of python-control, a matrix or a number"


@dataclass(frozen=True, eq=False, repr=False)
class UncertainSystem(Displayed):
    """A number, matrix or linear system with numbers and dynamics that are known within bounds.

    It is made by :func:`robustpolish.uncertain.real` and its neighbours, by arithmetic with them,
    and by :func:`robustpolish.uncertain.system`. Sums, products, quotients, whole powers and
    slices are those of python-control's systems, with which they may be mixed, and keep what is
    uncertain. The same name is the same thing wherever it occurs.

    Parameters
    ----------
    matrices : Lft
        Its matrices, around states and uncertain blocks.

    Examples
    --------
    >>> import robustpolish as rp
    >>> k = rp.uncertain.real("k", 10, percent=40)
    >>> k
    Uncertain number
      name  what                          occurs
      k     real number 10, from 6 to 14       1
    >>> plant = rp.uncertain.system([[0, 1], [-k, -1.8]], [[0], [18]], [[1, 0]], 0)
    >>> plant.nominal.poles().round(3)
    array([-0.9+3.032j, -0.9-3.032j])
    >>> plant.at({"k": 14}).dcgain().round(3).item()
    1.286

    Connections and samples keep to the bounds:

    >>> loop = plant.feedback(0.5)
    >>> loop.append(k).shape, plant.lft(-0.5).shape
    ((2, 2), (0, 0))
    >>> [machine.dcgain().round(3).item() for machine in loop.sample(2, seed=1)]
    [0.943, 0.796]
    >>> plant.update_names()
    """

    matrices: Lft

    # What python-control and NumPy ask before they would take the elements apart.
    __array_ufunc__ = None
    __array_priority__ = 100

    # What it is -----------------------------------------------------------------------

    @property
    def blocks(self) -> tuple[UncertainBlock, ...]:
        """What is uncertain, each with the number of times that it occurs."""
        return self.matrices.blocks

    @property
    def elements(self) -> dict[str, Element]:
        """What is uncertain, by name."""
        return {block.element.name: block.element for block in self.blocks}

    @property
    def shape(self) -> tuple[int, int]:
        """Outputs and inputs."""
        return self.matrices.shape

    @property
    def ninputs(self) -> int:
        """Number of inputs."""
        return self.shape[1]

    @property
    def noutputs(self) -> int:
        """Number of outputs."""
        return self.shape[0]

    @property
    def nstates(self) -> int:
        """Number of states of what is certain."""
        return len(self.matrices.states)

    @property
    def dt(self) -> float | bool | None:
        """Sampling time in s; 0 in continuous time, None for numbers and matrices."""
        return self.matrices.dt

    @property
    def is_static(self) -> bool:
        """Whether it is a number or matrix: no states, and no uncertain dynamics."""
        return not self.nstates and all(b.element.kind != "dynamic" for b in self.blocks)

    @property
    def input_labels(self) -> list[str]:
        """Names of the inputs."""
        return list(self.matrices.inputs or (f"u[{i}]" for i in range(self.ninputs)))

    @property
    def output_labels(self) -> list[str]:
        """Names of the outputs."""
        return list(self.matrices.outputs or (f"y[{i}]" for i in range(self.noutputs)))

    @property
    def interconnection(self) -> control.StateSpace:
        """The certain system M from (w, u) to (z, y), closed by w = Delta z.

        The signals w and z are those of `blocks` in their order; Delta has norm at most 1.
        """
        one, n = self.matrices, self.nstates
        nz, nw = one.F.shape[0] - n, one.F.shape[1] - n
        B, C = np.hstack([one.F[:n, n:], one.G[:n]]), np.vstack([one.F[n:, :n], one.H[:, :n]])
        D = np.block([[one.F[n:, n:], one.G[n:]], [one.H[:, n:], one.J]])
        ins = [*(f"w[{i}]" for i in range(nw)), *self.input_labels]
        outs = [*(f"z[{i}]" for i in range(nz)), *self.output_labels]
        return named_system((one.F[:n, :n], B, C, D), one.dt or 0, ins, outs, one.states)

    # Values ---------------------------------------------------------------------------

    @property
    def nominal(self) -> control.StateSpace | NDArray[np.float64] | float:
        """The system at its nominal values; a matrix or a number if it is static."""
        return _certain(nominal(self.matrices))

    def state_space(self) -> control.StateSpace:
        """Return it as a system, if nothing in it is uncertain.

        Raises
        ------
        InvalidInputError
            With the names of what is uncertain.
        """
        if self.blocks:
            shown = f"uncertain {', '.join(b.element.name for b in self.blocks)}"
            remedy = "Take its .nominal, or ask worst_case_gain or robust_stability."
            raise checks.misfit("system", shown, "a system without uncertain blocks", remedy)
        return as_state_space("system", _certain(self.matrices))

    def at(self, values: Mapping[str, Any]) -> Any:
        """Return it with values in place of what is uncertain.

        Parameters
        ----------
        values : mapping of str to float or control.StateSpace
            By name. Numbers in their own units, also outside their range; of uncertain dynamics
            the part of gain at most 1, before its bound. What is not named stays uncertain, but of
            ellipsoids: where a physical number of one is named, the others take the values that
            are nearest to its centre with it.

        Returns
        -------
        control.StateSpace, ndarray, float or UncertainSystem
            The last if something is still uncertain.

        Raises
        ------
        InvalidInputError
            If a name is unknown, or the loop through a value is not well posed.
        """
        if not isinstance(values, Mapping):
            raise checks.invalid(
                "values", values, "a mapping of names to values", 'Write {"k": 11}.'
            )
        return _certain(substitute(self.matrices, values))

    def sample(self, n: int = 1, *, seed: int = 0) -> list[Any]:
        """Draw machines: real numbers evenly, also of ellipsoids, the others as all-passes.

        Parameters
        ----------
        n : int, optional
            How many.
        seed : int, optional
            Of the random numbers: the same seed draws the same machines.

        Returns
        -------
        list of control.StateSpace, ndarray or float
            Each within the bounds.
        """
        checks.whole_number("n", n, 1, remedy="Pass how many to draw.")
        random = np.random.default_rng(seed)
        return [self.at(random_values(self.matrices, random)) for _ in range(n)]

    def numbers(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return values with the physical numbers in place of the directions of ellipsoids.

        Parameters
        ----------
        values : mapping of str to object
            By name, as a witness has them. Directions that are not named are taken as 0.

        Returns
        -------
        dict of str to object
            The numbers of each ellipsoid that a named direction belongs to, in their own units,
            and all other values as they are.

        Examples
        --------
        >>> import robustpolish as rp
        >>> fit = rp.uncertain.ellipsoid({"k": 10.0, "c": 1.0}, [[2.0, 0.0], [0.1, 0.1]])
        >>> ratio = fit["c"] / fit["k"]
        >>> ratio.numbers({"ellipsoid[0]": 0.5, "ellipsoid[1]": -0.5})
        {'k': 11.0, 'c': 1.0}
        """
        return algebra.physical(self.blocks, values)

    # Connections ----------------------------------------------------------------------

    def feedback(self, other: Any = 1, sign: int = -1) -> UncertainSystem:
        """Return the closed loop: this system forward, another one back.

        Parameters
        ----------
        other : UncertainSystem, control.LTI, array_like or float, optional
            From the outputs back to the inputs; 1 by default.
        sign : {-1, 1}, optional
            Of the feedback; negative by default, as in python-control.

        Returns
        -------
        UncertainSystem

        Raises
        ------
        InvalidInputError
            If the sizes do not fit, or the loop is not well posed.
        """
        checks.one_of("sign", sign, (-1, 1))
        ny, nu = self.shape
        back = as_uncertain("other", other).matrices
        if back.shape == (1, 1) != (nu, ny) and nu == ny > 0:
            back = block_diagonal([back] * ny)
        if back.shape != (nu, ny):
            shown = checks.described(f"{back.shape[0]} x {back.shape[1]}")
            raise checks.invalid("other", shown, f"{nu} x {ny}", "Check its inputs and outputs.")
        both = block_diagonal([self.matrices, back])
        loop = np.zeros((nu + ny, ny + nu))
        loop[:nu, ny:], loop[nu:, :ny] = sign * np.eye(nu), np.eye(ny)
        enter, leave = np.eye(nu + ny, nu), np.eye(ny, ny + nu)
        result = algebra.interconnect(both, loop, enter, leave)
        return UncertainSystem(result.names(self.matrices.inputs, self.matrices.outputs))

    def lft(self, other: Any, nu: int = -1, ny: int = -1) -> UncertainSystem:
        """Return the linear fractional transformation: the last signals closed by another system.

        Parameters
        ----------
        other : UncertainSystem, control.LTI, array_like or float
            Its first inputs are this system's last outputs, its first outputs the last inputs.
        nu, ny : int, optional
            Number of inputs and outputs of this system that are joined; all of the other by
            default.

        Returns
        -------
        UncertainSystem
            Positive sign, as in python-control's ``lft``.

        Raises
        ------
        InvalidInputError
            If there are too few signals, or the loop is not well posed.
        """
        lower = as_uncertain("other", other).matrices
        p2, m2 = lower.shape
        nu, ny = (p2 if nu == -1 else nu), (m2 if ny == -1 else ny)
        p1, m1 = self.shape
        if not (0 <= nu <= min(m1, p2) and 0 <= ny <= min(p1, m2)):
            shown = checks.described(f"{nu} inputs and {ny} outputs to join")
            expected = f"at most {min(m1, p2)} and {min(p1, m2)}"
            raise checks.invalid("other", shown, expected, "Check its inputs and outputs.")
        both = block_diagonal([self.matrices, lower])
        loop = np.zeros((m1 + m2, p1 + p2))
        loop[m1 - nu : m1, p1 : p1 + nu] = np.eye(nu)
        loop[m1 : m1 + ny, p1 - ny : p1] = np.eye(ny)
        into = [*range(m1 - nu), *range(m1 + ny, m1 + m2)]
        out = [*range(p1 - ny), *range(p1 + nu, p1 + p2)]
        result = algebra.interconnect(both, loop, np.eye(m1 + m2)[:, into], np.eye(p1 + p2)[out])
        names_in = tuple(both.inputs[i] for i in into) if both.inputs else ()
        names_out = tuple(both.outputs[i] for i in out) if both.outputs else ()
        return UncertainSystem(result.names(names_in, names_out))

    def append(self, *others: Any) -> UncertainSystem:
        """Return this system and others side by side.

        Parameters
        ----------
        *others : UncertainSystem, control.LTI, array_like or float

        Returns
        -------
        UncertainSystem
        """
        parts = [self, *(as_uncertain("other", other) for other in others)]
        return UncertainSystem(block_diagonal([part.matrices for part in parts]))

    def update_names(self) -> None:
        """Keep the names: python-control calls this on what its ``series`` returns."""

    # Arithmetic -----------------------------------------------------------------------

    def __add__(self, other: Any) -> UncertainSystem:
        return self._with(other, algebra.total)

    def __radd__(self, other: Any) -> UncertainSystem:
        return self._with(other, algebra.total, turned=True)

    def __sub__(self, other: Any) -> UncertainSystem:
        return self._with(other, lambda one, two: algebra.total(one, _times(-1.0, two)))

    def __rsub__(self, other: Any) -> UncertainSystem:
        return (-self) + other

    def __neg__(self) -> UncertainSystem:
        return UncertainSystem(_times(-1.0, self.matrices))

    def __pos__(self) -> UncertainSystem:
        return self

    def __mul__(self, other: Any) -> UncertainSystem:
        return self._with(other, product)

    def __rmul__(self, other: Any) -> UncertainSystem:
        return self._with(other, product, turned=True)

    __matmul__, __rmatmul__ = __mul__, __rmul__

    def __truediv__(self, other: Any) -> UncertainSystem:
        return self._with(other, _quotient)

    def __rtruediv__(self, other: Any) -> UncertainSystem:
        return self._with(other, _quotient, turned=True)

    def __pow__(self, power: int) -> UncertainSystem:
        if not checks.is_whole(power):
            raise checks.invalid("power", power, "a whole number", "Other powers are not rational.")
        base = self.matrices if power >= 0 else algebra.inverse(self.matrices)
        result = constant(np.eye(self.ninputs))
        for _ in range(abs(int(power))):
            result = product(result, base)
        return UncertainSystem(result)

    def __getitem__(self, key: Any) -> UncertainSystem:
        if not isinstance(key, tuple) or len(key) != 2:
            raise checks.invalid("key", key, "rows and columns", "Write system[0, :].")
        ny, nu = self.shape
        rows = _chosen(key[0], list(self.output_labels))
        columns = _chosen(key[1], list(self.input_labels))
        enter, leave = np.eye(nu)[:, columns], np.eye(ny)[rows]
        picked = algebra.interconnect(self.matrices, np.zeros((nu, ny)), enter, leave)
        inputs = [self.input_labels[i] for i in columns]
        return UncertainSystem(picked.names(inputs, [self.output_labels[i] for i in rows]))

    def _with(self, other: Any, combine: Any, turned: bool = False) -> Any:
        try:
            given = as_uncertain("operand", other).matrices
        except TypeError:
            return NotImplemented
        pair = (given, self.matrices) if turned else (self.matrices, given)
        return UncertainSystem(combine(*pair))

    def _card(self) -> Card:
        rows = tuple((b.element.name, str(b.element), b.copies) for b in self.blocks)
        return Card(f"Uncertain {self._what()}", (Table("", ("name", "what", "occurs"), rows),))

    def _what(self) -> str:
        ny, nu = self.shape
        if not self.is_static:
            time = "" if not self.dt else ", in discrete time"
            return f"system, {ny} x {nu}, of {self.nstates} states{time}"
        return "number" if (ny, nu) == (1, 1) else f"matrix, {ny} x {nu}"


def as_uncertain(argument: str, value: Any) -> UncertainSystem:
    """Return anything that takes part in arithmetic as an uncertain object."""
    if isinstance(value, UncertainSystem):
        return value
    if (isinstance(value, np.ndarray) and value.dtype == object) or _nested(value):
        return UncertainSystem(block_matrix(argument, value))
    if is_system(value):
        return UncertainSystem(as_lft(as_state_space(argument, value)))
    plain: Any = value
    if isinstance(value, list | tuple | np.ndarray):
        with suppress(ValueError):  # rows of different lengths are refused below
            plain = np.atleast_2d(value)
    if isinstance(plain, complex | np.ndarray) and np.iscomplexobj(plain):
        raise checks.invalid(
            argument, value, _OPERANDS, "Matrices are real: use uncertain_complex."
        )
    return UncertainSystem(constant(checks.matrix(argument, plain)))


def block_matrix(argument: str, value: Any) -> Lft:
    """Return a table of uncertain and certain entries as one matrix."""
    table = np.array(value, dtype=object)
    if table.ndim == 0:
        return as_uncertain(argument, table.item()).matrices
    if table.ndim == 1 and not any(isinstance(row, list | tuple | np.ndarray) for row in table):
        table = table.reshape(1, -1)
    if table.ndim != 2 or 0 in table.shape:
        shown = checks.described(f"shape {table.shape}")
        raise checks.invalid(argument, shown, "rows of equal length", "Check its rows and columns.")
    ny, nu = table.shape
    certain = np.array([[_number(entry) for entry in row] for row in table], dtype=object)
    result = constant(checks.matrix(argument, certain.tolist()))
    for i, j in np.ndindex(ny, nu):
        entry = table[i, j]
        if _number(entry) == 0.0 and isinstance(entry, UncertainSystem | control.LTI):
            one = as_uncertain(argument, entry)
            if one.shape != (1, 1):
                shown = checks.described(f"an entry of shape {one.shape}")
                raise checks.invalid(argument, shown, "single entries", "Join blocks with append.")
            column, row = constant(np.eye(ny)[:, [i]]), constant(np.eye(nu)[[j]])
            result = algebra.total(result, product(product(column, one.matrices), row))
    return result


def _number(entry: Any) -> Any:
    return 0.0 if isinstance(entry, UncertainSystem | control.LTI) else entry


def _nested(value: Any) -> bool:
    """Say whether a list holds uncertain entries, which NumPy cannot make numbers of."""
    if not isinstance(value, list | tuple):
        return False
    return any(isinstance(item, UncertainSystem) or _nested(item) for item in value)


def _times(factor: float, one: Lft) -> Lft:
    return product(constant(np.array([[factor]])), one).names(one.inputs, one.outputs)


def _quotient(one: Lft, two: Lft) -> Lft:
    """Divide; of numbers the divisor comes last, so that the rows of inv(M) K share its copies."""
    numbers = one.shape == two.shape == (1, 1) and not one.states and not two.states
    return product(algebra.inverse(two), one) if numbers else product(one, algebra.inverse(two))


def _chosen(key: Any, labels: list[str]) -> list[int]:
    """Return the positions that a name, an index, a slice or a list of these stands for."""
    if isinstance(key, str | list | tuple):
        each = [key] if isinstance(key, str) else key
        key = [labels.index(k) if k in labels else k for k in each]
    try:
        return np.atleast_1d(np.arange(len(labels))[key]).tolist()
    except IndexError:
        known = f"positions below {len(labels)} or names among {', '.join(labels)}"
        raise checks.invalid("key", key, known, "Correct the index.") from None


def _certain(one: Lft) -> Any:
    """Return an object without blocks as what python-control and NumPy have for it."""
    if one.blocks:
        return UncertainSystem(one)
    if one.states or one.dt is not None:
        labels = UncertainSystem(one).input_labels, UncertainSystem(one).output_labels
        return named_system((one.F, one.G, one.H, one.J), one.dt or 0, *labels, one.states)
    return float(one.J[0, 0]) if one.shape == (1, 1) else one.J.copy()
