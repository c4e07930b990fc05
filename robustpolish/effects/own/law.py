"""The force law that a formula says: called from Python, or compiled to machine code."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic

from robustpolish.effects.compiled import POINTER, machine_code
from robustpolish.effects.kind import Values
from robustpolish.effects.own.formula import FUNCTIONS, Formula
from robustpolish.effects.own.written import Written

_CORNERS = frozenset({"abs", "sign", "min", "max"})
_HIGHEST = 64  # whole powers up to this one are multiplied out, as Numba does
_SIGNALS = (-10.0, -1.0, 0.0, 1.0, 10.0)  # of a channel, in its unit: signals end at 10 V
_GRID = 33  # odd: with the middle, where friction is steepest


def _entry(pointer, i):  # type: ignore[no-untyped-def]  # compiled by Numba
    return pointer[i]


def _power(x, y):  # type: ignore[no-untyped-def]  # compiled by Numba
    return np.power(x, y)


def _unary(name: str) -> Callable[[Any], Any]:
    """Return a function that Numba can compile in place of a name."""
    function = FUNCTIONS[name]

    def call(x):  # type: ignore[no-untyped-def]  # compiled by Numba
        return function(x)

    return call


_UNARY = {name: _unary(name) for name in FUNCTIONS}


@dataclass(frozen=True)
class FormulaLaw:
    """The law of an effect that somebody wrote as a formula.

    It is equal to another one that says the same, and can be pickled.

    Parameters
    ----------
    written : Written
    """

    written: Written

    @cached_property
    def formula(self) -> Formula:
        """The formula, read."""
        return self.written.read()

    def __call__(self, t: float, q: Any, v: Any, z: Any, p: Any, f: Any, dz: Any) -> None:
        """Write the force, as every law does."""
        f[0] = self.formula.value(self._values(t, q, v, p))

    def _values(self, t: Any, q: Any, v: Any, p: Any) -> dict[str, Any]:
        values = {"t": t, "q": q[0], "v": v[0]}
        values.update((name, p[i]) for i, (name, _) in enumerate(self.written.units))
        values.update((name, q[1 + i]) for i, (name, _) in enumerate(self.written.channels))
        return values

    @property
    def sharp(self) -> bool:
        """Whether the force may have corners."""
        return bool(self.formula.operations & _CORNERS)

    def compiled(self) -> Any:
        """Return the law compiled to the signature of all laws.

        The operations are put together as machine code one by one: no text is executed, and no
        file holds the result, which would be found again under the name of another formula.
        """
        force = _assembled(self)

        def law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]  # compiled by Numba
            f[0] = force(t, q, v, p)

        return machine_code(law, cache=False)


def _assembled(law: FormulaLaw) -> Any:
    """Return the force of (t, q, v, p) as a function that compiled code can call."""
    written = law.written
    places: dict[str, tuple[int, int]] = {"q": (1, 0), "v": (2, 0)}
    places.update((name, (3, i)) for i, (name, _) in enumerate(written.units))
    places.update((name, (1, 1 + i)) for i, (name, _) in enumerate(written.channels))

    @intrinsic
    def force(typing_context, t, q, v, p):  # type: ignore[no-untyped-def]
        signature = types.float64(types.float64, POINTER, POINTER, POINTER)

        def generate(context, builder, _, given):  # type: ignore[no-untyped-def]
            def constant(number: float) -> Any:
                return context.get_constant(types.float64, number)

            def call(function: Any, kinds: tuple[Any, ...], operands: tuple[Any, ...]) -> Any:
                return context.compile_internal(builder, function, types.float64(*kinds), operands)

            def leaf(item: float | str) -> tuple[Any, float | None]:
                if not isinstance(item, str):
                    return constant(item), item
                if item == "t":
                    return given[0], None
                array, index = places[item]
                where = context.get_constant(types.intp, index)
                return call(_entry, (POINTER, types.intp), (given[array], where)), None

            def combine(operation: str, *operands: tuple[Any, float | None]) -> tuple[Any, None]:
                values = tuple(value for value, _ in operands)
                if operation in _BUILDS:
                    return _BUILDS[operation](builder, *values), None
                if operation != "**":
                    return call(_UNARY[operation], (types.float64,), values), None
                exponent = operands[1][1]
                if exponent is not None and exponent.is_integer() and abs(exponent) <= _HIGHEST:
                    power = _multiplied(builder, values[0], int(abs(exponent)), constant(1.0))
                    return (builder.fdiv(constant(1.0), power) if exponent < 0 else power), None
                return call(_power, (types.float64, types.float64), values), None

            return law.formula.fold(leaf, combine)[0]

        return signature, generate

    return force


def _larger(builder: Any, x: Any, y: Any) -> Any:
    return builder.select(builder.fcmp_unordered(">", x, y), x, y)


def _smaller(builder: Any, x: Any, y: Any) -> Any:
    return builder.select(builder.fcmp_unordered("<", x, y), x, y)


_BUILDS: dict[str, Callable[..., Any]] = {
    "+": lambda builder, x, y: builder.fadd(x, y),
    "-": lambda builder, x, y: builder.fsub(x, y),
    "*": lambda builder, x, y: builder.fmul(x, y),
    "/": lambda builder, x, y: builder.fdiv(x, y),
    "negative": lambda builder, x: builder.fneg(x),
    "min": _smaller,
    "max": _larger,
}


def _multiplied(builder: Any, x: Any, exponent: int, one: Any) -> Any:
    """Return a whole power by repeated squaring."""
    power = one
    while exponent:
        if exponent & 1:
            power = builder.fmul(power, x)
        x, exponent = builder.fmul(x, x), exponent >> 1
    return power


@dataclass(frozen=True)
class FormulaGains:
    """The largest slopes of a formula, which decide on the length of steps.

    Parameters
    ----------
    law : FormulaLaw
    """

    law: FormulaLaw

    def __call__(self, values: Values, q: float, v: float) -> tuple[float, float, float]:
        """Return the largest stiffness and damping up to these amplitudes, and no rate."""
        grid = np.linspace(-1.0, 1.0, _GRID)
        along = {"q": q * grid[:, None], "v": v * grid[None, :], "t": 0.0, **values}
        slopes = [(0.0, 0.0)]
        for level in _SIGNALS if self.law.written.channels else (0.0,):
            along.update((name, level) for name, _ in self.law.written.channels)
            slopes.append((self._steepest(along, "q", q), self._steepest(along, "v", v)))
        stiffness, damping = np.max(slopes, axis=0).tolist()
        return stiffness, damping, 0.0

    def _steepest(self, along: dict[str, Any], name: str, amplitude: float) -> float:
        if amplitude == 0 or name not in self.law.formula.names:
            return 0.0
        step = 1e-6 * amplitude
        ends = [self.law.formula.value({**along, name: along[name] + d}) for d in (-step, step)]
        with np.errstate(all="ignore"):
            slopes = np.abs(np.asarray(ends[1]) - ends[0]) / (2 * step)
        return float(np.max(slopes, where=np.isfinite(slopes), initial=0.0))
