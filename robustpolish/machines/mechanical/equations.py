"""Equations of motion that somebody wrote, as formulas or as a function that Numba compiles.

::

    M(q) q'' = f(t, q, q', z, u) + forces of masses, springs, dampers, inputs and effects
          z' = dz(t, q, q', z, u)

About the point where a machine starts they have a linear part, which joins the matrices of the
model. What is left is the law of one more effect: it sees all coordinates, the inputs, and, as it
is called last, the forces of all others, which an inertia that changes with the motion turns into
other accelerations.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from types import FunctionType
from typing import Any, NamedTuple

import numba
import numpy as np

from robustpolish.base.arrays import AnyArray, Array
from robustpolish.base.checks import described, instance_of, invalid, misfit
from robustpolish.base.jit import njit
from robustpolish.errors import InvalidInputError
from robustpolish.linear.arithmetic.dual_numbers import Dual, dual, larger
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.effects.evaluate import machine_code
from robustpolish.machines.effects.formula_language import (
    Grade,
    PostfixProgram,
    Powers,
    check_name,
    dimension_text,
    graded,
    multiplied,
    read_formula,
    read_unit,
)
from robustpolish.machines.effects.kind import EffectKind, Parameter, Steepness, Values
from robustpolish.machines.effects.user_defined import function_of, operation_node

# Equations as they are given: names with units, formulas or a function, numbers.

_Part = tuple[dict[int, ast.expr], ast.expr]
_carray: Any = numba.carray  # type: ignore
_BASE = {
    "N": "kg m/s^2", "Hz": "1/s", "rad": "1", "V": "kg m^2/(s^3 A)", "ohm": "kg m^2/(s^3 A^2)",
    "H": "kg m^2/(s^2 A^2)", "Wb": "kg m^2/(s^2 A)", "F": "A^2 s^4/(kg m^2)", "C": "A s",
    "Pa": "kg/(m s^2)", "J": "kg m^2/s^2", "W": "kg m^2/s^3",
}  # fmt: skip
_WORDS = (*_BASE, "A", "K")
_SECOND: Powers = {"s": 1.0}
_NEWTON: Powers = {"kg": 1.0, "m": 1.0, "s": -2.0}
_ALIKE = 1e-9
"""Share by which a mass matrix may be off symmetry: rounding."""


def _powers(unit: Any, key: tuple[str, ...]) -> Powers:
    """Return the powers of kg, m, s, A and K in a unit."""
    found: Powers = {}
    for word, power in read_unit(unit, key, _WORDS).items():
        base = read_unit(_BASE[word], key, _WORDS) if word in _BASE else {word: 1.0}
        found = multiplied(found, base, power)
    return found


class Slopes(NamedTuple):
    """The equations about a point: values, and derivatives by (q, q', z, u).

    Attributes
    ----------
    M : ndarray, shape (n, n)
    f : ndarray, shape (n,)
    dz : ndarray, shape (nz,)
    by, dz_by : ndarray, shapes (n, 2 n + nz + nu) and (nz, 2 n + nz + nu)
    z : ndarray, shape (nz,)
        The states.
    """

    M: AnyArray
    f: AnyArray
    dz: AnyArray
    by: AnyArray
    dz_by: AnyArray
    z: Array


@dataclass(frozen=True)
class Equations:
    r"""Equations of motion of your own, for geometry, motors, magnets and air that no part is.

    ``M(q) q'' = f``, with the equation of each coordinate a balance of the forces on it, and
    first-order states such as currents and pressures beside it. Masses, springs, dampers, inputs
    and effects at the coordinates are added.

    Parameters
    ----------
    law : mapping of str to str, or callable
        By coordinate the balance of forces (torques) on it, such as
        ``"m*l**2*phi_ddot = -m*g*l*sin(phi) - d*phi_dot + T"``, and by state its equation, such as
        ``"L*i_dot = u - R*i"``; see :func:`effect` for what a formula may hold. Or a function
        ``law(t, q, v, z, u, p, M, f, dz)`` in the Python that Numba compiles, with functions of
        numpy, which writes M, f and dz (all zero before) from time, coordinates, velocities,
        states, inputs and parameters, each in the order given here.
    coordinates : mapping of str to str
        Names with their units, ``"m"`` or ``"rad"``. In formulas ``x_dot`` and ``x_ddot`` are the
        derivatives of x.
    parameters : mapping of str to (float, str), optional
        Numbers in SI units by name, with their units.
    states, inputs : mapping of str to str, optional
        First-order states, and data columns that the equations read, with their units.
    start : mapping of str to float, optional
        Where the machine rests at first, about which the linear part is taken: coordinates, inputs
        and states; 0 by default, states as they settle.
    known : sequence of str, optional
        Parameters that are not fitted, such as g.

    Raises
    ------
    InvalidInputError
        If a name is unknown or used twice, a unit is missing or does not fit, accelerations do not
        enter linearly, or the mass matrix is singular or not symmetric at the start.

    Examples
    --------
    >>> import robustpolish as rp
    >>> swing = rp.Equations(
    ...     {"phi": "m*l**2*phi_ddot = T - m*g*l*sin(phi) - d*phi_dot"},
    ...     coordinates={"phi": "rad"},
    ...     inputs={"T": "N m"},
    ...     parameters={"m": (0.5, "kg"), "l": (0.4, "m"), "g": (9.81, "m/s^2"),
    ...                 "d": (0.01, "N m s/rad")},
    ...     known=["g"],
    ... )
    >>> model = rp.MechanicalModel(equations=[swing], outputs=[rp.Output("phi", "phi")])
    >>> model.parameters["parameter.l"], model.state_space().A.round(3)[1].tolist()
    (0.4, [-24.525, -0.125])
    """

    law: Any
    coordinates: Any
    parameters: Any = field(default_factory=dict)
    states: Any = field(default_factory=dict)
    inputs: Any = field(default_factory=dict)
    start: Any = field(default_factory=dict)
    known: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        seen: list[str] = ["t"]
        for what in ("coordinates", "parameters", "states", "inputs", "start"):
            given = instance_of(what, getattr(self, what), Mapping, "a table by name", "Write one.")
            object.__setattr__(self, what, dict(given))
            for name in given if what != "start" else ():
                check_name(name)
                dots = {"coordinates": ("", "_dot", "_ddot"), "states": ("", "_dot")}
                for symbol in (f"{name}{dot}" for dot in dots.get(what, ("",))):
                    if symbol in seen:
                        shown = described(f"{symbol!r} twice")
                        raise invalid((what, name), shown, "one meaning of a name", "Rename one.")
                    seen.append(symbol)
        for name, unit in self.coordinates.items():
            if unit not in ("m", "rad"):
                remedy = "What has another unit is a state, with an equation for its first rate."
                raise invalid(("coordinates", name), unit, "'m' or 'rad'", remedy)
        for name, value in self.parameters.items():
            if not isinstance(value, tuple | list) or len(value) != 2:
                want, remedy = "a number and its unit", f"Write {name} = (0.5, 'kg')."
                raise invalid(("parameters", name), value, want, remedy)
            self.parameters[name] = (_finite(("parameters", name), value[0]), value[1])
        for name, value in self.start.items():
            if name not in {**self.coordinates, **self.states, **self.inputs}:
                want = "a coordinate, a state or an input"
                raise invalid(("start", name), name, want, "Correct it.")
            self.start[name] = _finite(("start", name), value)
        for name in self.known:
            if name not in self.parameters:
                raise invalid("known", name, "a parameter", "Check the spelling.")
        object.__setattr__(self, "known", tuple(self.known))
        if not callable(self.law):
            self._check_formulas()
        here = slopes_at(self)
        where = ("law", *list(self.coordinates)[:1])
        if not np.isfinite(np.r_[here.M.ravel(), here.f, here.by.ravel(), here.dz]).all():
            shown = described("equations that are not finite at the start")
            raise invalid(where, shown, "finite numbers", "Give start values where they are.")
        if np.any(np.abs(here.M - here.M.T) > _ALIKE * np.max(np.abs(here.M))):
            shown = described(f"the mass matrix {here.M.tolist()}")
            want = "a symmetric one: the equation of each coordinate is the balance of forces on it"
            remedy = "Write them as Lagrange's equations have them, inertias times accelerations."
            raise invalid(where, shown, want, remedy)

    # Formulas --------------------------------------------------------------------------

    @property
    def values(self) -> dict[str, float]:
        """The parameters by name."""
        return {name: value for name, (value, _) in self.parameters.items()}

    def _check_formulas(self) -> None:
        """Refuse formulas that lack, are too many, or whose units do not fit."""
        law = instance_of("law", self.law, Mapping, "a mapping of names to formulas", "Write one.")
        object.__setattr__(self, "law", dict(law))
        wanted = (*self.coordinates, *self.states)
        for name in (*wanted, *law):
            if name not in law or name not in wanted:
                shown = described(f"{name!r} with{'out' * (name not in law)} an equation")
                want = f"an equation of each of {', '.join(wanted)}"
                raise invalid(("law", str(name)), shown, want, "Write one, or declare the name.")
        units: dict[str, Powers] = {"t": _SECOND}
        for name in (*wanted, *self.inputs, *self.parameters):
            place = "parameters" if name in self.parameters else "law"
            units[name] = _powers(number_unit(self, name), (place, name))
            for rate, power in (("_dot", -1.0), ("_ddot", -2.0)):
                units[f"{name}{rate}"] = multiplied(units[name], _SECOND, power)
        grades = {name: Grade(powers) for name, powers in units.items()}
        for name in wanted:
            program, own = self._program(name), number_unit(self, name)
            try:
                unit = graded(program, grades, shown=_unit_text).powers
                if name in self.coordinates and unit not in (None, _force_of(own)):
                    raise ArithmeticError(f"it is in {_unit_text(unit)}, not in {own}'s force")
            except ArithmeticError as error:
                want = "a balance of forces in N (torques in N m) with fitting units"
                want = want if name in self.coordinates else "an equation with fitting units"
                remedy = "Check units of parameters, and give numbers with units a name."
                shown = f"{program.text!r}, where {error}"
                raise misfit(("law", name), shown, want, remedy) from None
        self._tree  # accelerations enter linearly  # noqa: B018

    def _program(self, name: str) -> PostfixProgram:
        """Return right side less left side of an equation."""
        text = self.law[name]
        if not isinstance(text, str) or text.count("=") != 1:
            want = "one equation, such as 'm*x_ddot = F - c*x_dot'"
            raise invalid(("law", name), text, want, "Write one equals sign.")
        left, right = text.split("=")
        names = [*self._places, *self._rates]
        try:
            found = read_formula(f"f = ({right}) - ({left})", names, None)
        except InvalidInputError as error:
            raise InvalidInputError(f"{text!r}: {error}", ("law", name)) from None
        return PostfixProgram(" ".join(text.split()), found.program)

    @property
    def _rates(self) -> dict[str, int]:
        """Names of the accelerations and the rates of states, which equations solve for."""
        names = (*(f"{n}_ddot" for n in self.coordinates), *(f"{n}_dot" for n in self.states))
        return {name: i for i, name in enumerate(names)}

    @property
    def _places(self) -> dict[str, str]:
        """What the generated function calls each number."""
        found = {"t": "t"}
        for letter, names in (
            ("q", self.coordinates), ("z", self.states), ("u", self.inputs), ("p", self.parameters),
        ):  # fmt: skip
            found |= {name: f"{letter}[{i}]" for i, name in enumerate(names)}
        return found | {f"{name}_dot": f"v[{i}]" for i, name in enumerate(self.coordinates)}

    @property
    def _tree(self) -> tuple[ast.Module, bool]:
        """The function that writes M, f and dz, and whether M varies with the motion."""
        body, moving = [], {"t", *self.coordinates, *self.states, *self.inputs}
        moving |= {f"{name}_dot" for name in self.coordinates}
        varies, n = False, len(self.coordinates)
        for i, name in enumerate((*self.coordinates, *self.states)):
            solved, rest = self._solved(name)
            own = {j for j in solved if j < n} if i < n else {i}
            if set(solved) - own or (i >= n and i not in solved):
                rate = f"{name}_dot" if i >= n else "accelerations"
                remedy = "Use the equation of each rate to replace it."
                shown = f"{self.law[name]!r}, with other rates"
                raise misfit(("law", name), shown, f"{rate} as the only ones", remedy)
            if i >= n:
                rate = operation_node("/", rest, operation_node("negative", solved[i]))
                body.append((f"dz[{i - n}]", rate))
                continue
            body.append((f"f[{i}]", rest))
            for j, node in solved.items():
                body.append((f"M[{i}, {j}]", operation_node("negative", node)))
                used = {ast.unparse(part) for part in ast.walk(node)}
                varies |= bool(used & {self._places[name] for name in moving})
        tree = ast.parse("def law(t, q, v, z, u, p, M, f, dz):\n    pass")
        lines = [ast.parse(f"{place} = 0.0").body[0] for place, _ in body]
        for line, (_, node) in zip(lines, body, strict=True):
            line.value = node  # type: ignore[attr-defined]
        tree.body[0].body = lines  # type: ignore[attr-defined]
        return tree, varies

    def _solved(self, name: str) -> _Part:
        """Return what each rate is multiplied by in an equation, and the rest of it."""
        zero = ast.Constant(0.0)

        def leaf(item: float | str) -> _Part:
            if item in self._rates:
                return {self._rates[str(item)]: ast.Constant(1.0)}, zero
            if not isinstance(item, str):
                return {}, ast.Constant(item)
            return {}, ast.parse(self._places[item], mode="eval").body

        def combine(operation: str, *parts: _Part) -> _Part:
            (one, first), (other, last) = parts[0], parts[-1]
            if not any(part for part, _ in parts):
                return {}, operation_node(operation, *(rest for _, rest in parts))
            if operation in ("+", "-", "negative"):
                found = {j: operation_node("negative", x) for j, x in other.items()}
                if operation != "negative":
                    found = dict(one)
                    for j, x in other.items():
                        found[j] = operation_node(operation, one.get(j, zero), x)
                return found, operation_node(operation, *(rest for _, rest in parts))
            if operation == "*" and not other:
                return _scaled(one, "*", last), operation_node("*", first, last)
            if operation == "*" and not one:
                return _scaled(other, "*", first), operation_node("*", first, last)
            if operation == "/" and not other:
                return _scaled(one, "/", last), operation_node("/", first, last)
            remedy = "Multiply it out, so that each stands with a factor in front."
            want = "accelerations and rates that enter linearly"
            raise invalid(("law", name), self.law[name], want, remedy)

        return self._program(name).fold(leaf, combine)

    # Numbers about a point ---------------------------------------------------------------

    @cached_property
    def function(self) -> Any:
        """The function that writes M, f and dz, for numbers with derivatives."""
        if callable(self.law):
            return self.law
        found = _functions(*self._key)[0]
        corners = {"max": larger, "min": lambda a, b: -larger(dual(a) * -1.0, dual(b) * -1.0)}
        return FunctionType(found.__code__, {**found.__globals__, **corners})

    @property
    def varies(self) -> bool:
        """Whether the mass matrix may change with the motion."""
        return callable(self.law) or _functions(*self._key)[1]

    @property
    def _key(self) -> tuple[Any, ...]:
        law = self.law if callable(self.law) else tuple(self.law.items())
        names = (self.coordinates, self.parameters, self.states, self.inputs)
        return law, *(tuple(part) for part in names)

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return len(self.coordinates)

    def _slopes(
        self, values: Mapping[str, Any], point: Mapping[str, float], z: Array, of: range
    ) -> Slopes:
        n, nz = self.n, z.size
        known = np.zeros(2 * n + nz + len(self.inputs))
        known[:n] = [point.get(name, 0.0) for name in self.coordinates]
        known[2 * n : 2 * n + nz] = z
        known[2 * n + nz :] = [point.get(name, 0.0) for name in self.inputs]
        p = _objects([Dual(values[name]) for name in self.parameters])
        by: list[Any] = []
        M, f, dz = (_objects([Dual(0.0)] * k) for k in (n * n, n, nz))
        with np.errstate(all="ignore"):
            for j in of or range(1):
                w = _objects([Dual(float(x), float(i == j)) for i, x in enumerate(known)])
                M, f, dz = (_objects([Dual(0.0)] * k) for k in (n * n, n, nz))
                q, v, states, u = np.split(w, [n, 2 * n, 2 * n + nz])
                try:
                    self.function(0.0, q, v, states, u, p, M.reshape(n, n), f, dz)
                except ZeroDivisionError:
                    f[:] = Dual(np.nan)
                by.append([dual(x).slope for x in (*f, *dz)])
        told = [[dual(x).value for x in part] for part in (M, f, dz)]
        both = _objects([x for row in by for x in row]).reshape(len(by), n + nz).T
        parts = [_objects(told[0]).reshape(n, n), *map(_objects, told[1:]), both[:n], both[n:]]
        if all(isinstance(v, int | float) for v in values.values()):
            parts = [part.astype(float) for part in parts]
        return Slopes(*parts, z)


# Numbers of equations about a point, and their law.


def with_numbers(equations: Equations, changes: Mapping[str, float]) -> Equations:
    """Return the same equations with some parameters changed."""
    known = equations.parameters
    new = {n: (_finite(("parameter", n), v), known[n][1]) for n, v in changes.items()}
    found = copy(equations)  # fits ask thousands of times: the formulas stay as they are
    vars(found)["parameters"] = {**equations.parameters, **new}
    return found


def number_unit(equations: Equations, name: str) -> str:
    """Return the unit of a parameter, a coordinate, a state or an input."""
    known = {**equations.coordinates, **equations.states, **equations.inputs}
    return known[name] if name in known else equations.parameters[name][1]


def slopes_at(equations: Equations, values: Mapping[str, Any] | None = None) -> Slopes:
    """Return the equations about their start, exact to rounding.

    Parameters
    ----------
    equations : Equations
    values : mapping of str to float or UncertainSystem, optional
        Of the parameters; their own by default. States are as they settle there.
    """
    values, point = values or equations.values, equations.start
    z = np.array([equations.start.get(name, 0.0) for name in equations.states])
    real = {
        name: value if isinstance(value, int | float) else float(np.squeeze(value.nominal))
        for name, value in values.items()
    }
    for _ in range(50 * bool(z.size)):
        found = equations._slopes(real, point, z, range(2 * equations.n, 2 * equations.n + z.size))
        by, rate = np.array(found.dz_by, dtype=float), np.array(found.dz, dtype=float)
        if not np.isfinite(by).all() or np.max(np.abs(rate)) == 0:
            break
        size = np.maximum(np.abs(z), 1e-9)  # where nothing holds a state it stays
        step = np.linalg.lstsq(by * size, rate, rcond=1e-9)[0] * size
        z = z - step
        if np.max(np.abs(step) / size) < 1e-13:
            break
    every = range(2 * equations.n + z.size + len(equations.inputs))
    return equations._slopes(values, point, z, every)


def linear_part(equations: Equations) -> tuple[Array, Array, Array, Array]:
    """Return M, C, K and B about the start, states as they settle where they do."""
    here, n, nz = slopes_at(equations), equations.n, len(equations.states)
    by = here.by
    states = slice(2 * n, 2 * n + nz)
    Dz = here.dz_by[:, states]
    if nz and np.all(np.linalg.eigvals(Dz).real < 0):
        by = by - by[:, states] @ np.linalg.solve(Dz, here.dz_by)
    return here.M, -by[:, n : 2 * n], -by[:, :n], by[:, 2 * n + nz :]


def fastest_rate(equations: Equations, mass: Array) -> float:
    """Return the largest rate of the linear part in 1/s, with the mass matrix of the model."""
    here, n, nz = slopes_at(equations), equations.n, len(equations.states)
    A = np.zeros((2 * n + nz, 2 * n + nz))
    A[:n, n : 2 * n] = np.eye(n)
    A[n : 2 * n] = np.linalg.solve(mass, here.by[:, : 2 * n + nz])
    A[2 * n :] = here.dz_by[:, : 2 * n + nz]
    return float(np.max(np.abs(np.linalg.eigvals(A)), initial=0.0))


def sizes_of_states(equations: Equations, q: float, v: float) -> list[float]:
    """Return the size of each state at amplitudes of displacements and velocities."""
    here, n, nz = slopes_at(equations), equations.n, len(equations.states)
    moved = np.abs(here.dz_by[:, :n]).sum(1) * q + np.abs(here.dz_by[:, n : 2 * n]).sum(1) * v
    rates = np.max(np.abs(here.dz_by[:, 2 * n : 2 * n + nz]), axis=1, initial=v / q)
    return [abs(z) or float(size) for z, size in zip(here.z, moved / rates, strict=True)]


def effect_of(equations: Equations, others: tuple[str, ...], free: int, inputs: int) -> Effect:
    """Return what their linear part leaves, as an effect.

    Parameters
    ----------
    others : tuple of str
        The other coordinates of the model, free ones first.
    free, inputs : int
        Number of free coordinates and of force inputs of the model.
    """
    at = (*equations.coordinates, *others)
    kind = _kind(equations._key, len(at), free, inputs)
    return Effect.of(kind, at, equations.values)


def _objects(items: list[Any]) -> AnyArray:
    found = np.empty(len(items), dtype=object)
    found[:] = items
    return found


def _finite(key: tuple[str, ...], value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float | np.number):
        raise invalid(key, value, "a finite number", "Write a number in SI units.")
    if not np.isfinite(value):
        raise invalid(key, value, "a finite number", "Check the value.")
    return float(value)


def _unit_text(powers: Powers) -> str:
    return dimension_text(powers, " ")


def _force_of(unit: str) -> Powers:
    return multiplied(_NEWTON, {"m": 1.0}) if unit == "rad" else _NEWTON


def _scaled(parts: dict[int, ast.expr], operation: str, by: ast.expr) -> dict[int, ast.expr]:
    return {j: operation_node(operation, node, by) for j, node in parts.items()}


@lru_cache(maxsize=64)
def _functions(law: Any, *names: Any) -> tuple[Any, bool]:
    """Return the function of formulas, and whether their mass matrix varies."""
    bare = object.__new__(Equations)
    keys = ("coordinates", "parameters", "states", "inputs")
    for key, part in zip(keys, names, strict=True):
        object.__setattr__(bare, key, dict.fromkeys(part))
    object.__setattr__(bare, "law", dict(law))
    tree, varies = bare._tree
    return function_of(tree), varies


# What the linear part leaves, as the law of an effect with a port for each coordinate and input.


@dataclass(frozen=True, repr=False)
class EquationKind(EffectKind):
    """The kind of effect that equations of motion are to a simulation.

    Parameters
    ----------
    size : (int, int)
        Coordinates, and inputs behind them.
    """

    size: tuple[int, int] = (1, 0)

    @property
    def places(self) -> int:
        """Number of names in `at`."""
        return self.size[0]

    @property
    def ports(self) -> int:
        """Number of motions that the law reads."""
        return sum(self.size)


@dataclass(frozen=True)
class _Remainder:
    """The law; its numbers are the parameters, then those of :func:`context`."""

    key: tuple[Any, ...]
    coordinates: int
    free: int
    inputs: int

    def __call__(self, *_: Any) -> None:
        raise NotImplementedError  # runs take the compiled law

    def steepness(self, values: Values, q: float, v: float) -> Steepness:
        """Return none: steps follow from the linear part."""
        del values, q, v
        return 0.0, 0.0, 0.0

    def compiled(self) -> Any:
        """Return the law compiled to the signature of all laws."""
        law, names = self.key[0], [len(part) for part in self.key[1:]]
        if callable(law):
            function, varies = law, True
        else:
            function, varies = _functions(*self.key)
        compiled = njit(error_model="numpy")(function)
        return machine_code(_remainder(compiled, names, self, varies), cache=False)


@lru_cache(maxsize=64)
def _kind(key: tuple[Any, ...], coordinates: int, free: int, inputs: int) -> EquationKind:
    n, ports = len(key[1]), coordinates + inputs
    count = n * n + 2 * n * ports + free * free + 2 * free * ports + 1
    return EquationKind(
        kind="equations",
        title="Equations of motion",
        domain="dof",
        parameters=tuple(Parameter(name, "1", "of the equations") for name in key[2]),
        law=_Remainder(key, coordinates, free, inputs),
        states=len(key[3]),
        context=tuple(f"linear[{i}]" for i in range(count)),
        size=(coordinates, inputs),
    )


@njit(error_model="numpy")
def _solve(S, b):  # type: ignore[no-untyped-def]  # compiled
    """Solve a small system in place, by elimination with pivots."""
    n = b.size
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(S[i, k]) > abs(S[best, k]):
                best = i
        for j in range(n):
            S[k, j], S[best, j] = S[best, j], S[k, j]
        b[k], b[best] = b[best], b[k]
        for i in range(k + 1, n):
            factor = S[i, k] / S[k, k]
            b[i] -= factor * b[k]
            for j in range(k, n):
                S[i, j] -= factor * S[k, j]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            b[k] -= S[k, j] * b[j]
        b[k] /= S[k, k]


def _remainder(function: Any, names: list[int], of: _Remainder, varies: bool) -> Any:
    """Return the law: forces with which the linear part moves as the equations say.

    ``f = M q'' - F`` with F all other forces of the model, its linear part among them, where q''
    solves ``(M + M(q) - M0) q'' = F + r``; r is what the equations add to their linear part.
    """
    n, numbers, nz, nu = names
    coordinates, free, ports = of.coordinates, of.free, of.coordinates + of.inputs
    solve, wide = _solve, 2 * ports
    own, mass = numbers + n * n, numbers + n * n + n * wide
    all_forces = mass + free * free
    count = all_forces + free * wide

    def law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]  # compiled
        Q, V = _carray(q, (ports,)), _carray(v, (ports,))
        Z, D, P = _carray(z, (nz,)), _carray(dz, (nz,)), _carray(p, (numbers,))
        M, r = np.zeros((n, n)), np.zeros(n)
        function(t, Q[:n], V[:n], Z, Q[coordinates : coordinates + nu], P, M, r, D)
        for i in range(ports):
            f[i] = 0.0
        for i in range(n):
            for j in range(ports):
                r[i] -= p[own + i * wide + j] * q[j] + p[own + i * wide + ports + j] * v[j]
        if not varies:
            for i in range(n):
                f[i] = r[i]
            return
        total, a, S = np.zeros(free), np.zeros(free), np.zeros((free, free))
        others = int(p[count])
        for i in range(free):
            at = all_forces + i * wide
            for j in range(ports):
                total[i] += p[at + j] * q[j] + p[at + ports + j] * v[j]
            for j in range(others):
                total[i] += p[count + 1 + i * others + j] * f[ports + j]
            a[i] = total[i]
            for j in range(free):
                S[i, j] = p[mass + i * free + j]
        for i in range(n):
            a[i] += r[i]
            for j in range(n):
                S[i, j] += M[i, j] - p[numbers + i * n + j]
        solve(S, a)
        for i in range(free):
            f[i] = -total[i]
            for j in range(free):
                f[i] += p[mass + i * free + j] * a[j]

    return law


def context(
    equations: Equations, own: tuple[Array, Array, Array, Array], whole: Any, order: Array
) -> Iterator[float]:
    """Yield what the law needs to know of its model: `own` linear part, and the model's.

    Parameters
    ----------
    equations : Equations
    own : tuple of ndarray
        As of :meth:`Equations.linear_part`, B over all force inputs of the model.
    whole : MechanicalMatrices
    order : ndarray of int
        Positions of the coordinates of its effect in the model, free ones first.
    """
    M, C, K, B = own
    rest = np.zeros((equations.n, len(order) - equations.n))
    free = order[: len(whole.free)]
    forces = [-whole.K[free][:, order], whole.B[free]]
    rates = [-whole.C[free][:, order], np.zeros_like(whole.B[free])]
    parts = (
        M, np.hstack([-K, rest, B, -C, rest, 0 * B]),
        whole.M[free][:, free], np.hstack([*forces, *rates]),
    )  # fmt: skip
    for part in parts:
        yield from part.ravel().tolist()
    yield 0.0
