"""Kinds of effects whose law is a curve that data drew: cubic B-splines over uniform knots.

Their names tell their size. `learned_stiffness_9` is a force over the displacement with nine
coefficients, `learned_damping_9` one over the velocity, `learned_force_7x7` one over both. In
`learned_varying_stiffness_9` it is the stiffness that is a curve, over time, in
`learned_varying_damping_9` the damping. They are no part of the catalogue: nobody can look for them
by name, they are learned where the catalogue ends.

::

    f = -g(q)          g(q) = sum_j c_j B_j(q)       uniform knots over [low, high]
    f = -k(t) q        k(t) = sum_j c_j B_j(t)       over the record, in its own time

Outside of the knots g goes on over a displacement, its curvature fading over one stretch between
knots and straight from there, as a spline with one coefficient more and no further bend would. It
stays over a velocity: what no data has shown shall not feed energy. What varies with time stays as
it began and ended. The coefficients of a straight line are its values at points as far apart as the
knots (Greville's abscissae), so that second differences of neighbours measure how much a curve
bends (Eilers and Marx 1996, Statistical Science 11(2), 89-121).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal, cast

import numpy as np

from robustpolish.base.arrays import Array
from robustpolish.base.jit import njit
from robustpolish.base.results import tables
from robustpolish.machines.effects.evaluate import machine_code
from robustpolish.machines.effects.kind import EffectKind, Law, Parameter, Steepness, Values

Over = Literal["stiffness", "damping", "force", "varying_stiffness", "varying_damping"]
_NAME = re.compile(r"learned_(\w+)_(\d{1,3})(?:x(\d{1,2}))?")
_FEWEST, _MOST, _MOST_ACROSS = 5, 200, 40
_CURVE, _SURFACE = 3, 5
"""Numbers that stand before the coefficients of a curve, and before those of a surface."""
_SWING = 1 / 80
_REFERENCE = "Eilers and Marx (1996), Statistical Science 11(2), 89-121"


@njit(cache=True)
def _weights(x, low, high, count, stays):  # type: ignore[no-untyped-def]  # compiled
    """Return the first of the four splines at x, and what each of them counts there."""
    step = (high - low) / (count - 3)
    if not step > 0.0:
        return 0, 0.0, 0.0, 0.0, 0.0
    inside = low  # where x is not a number, too
    if x > high:
        inside = high
    elif x > low:
        inside = x
    i = min(int((inside - low) / step), count - 4)
    s = (inside - low) / step - i
    r = 1.0 - s
    beyond = 0.0 if stays else (x - inside) / step
    near = min(abs(beyond), 1.0)
    bend = near * near / 2 - near * near * near / 6 + (abs(beyond) - near) / 2
    return (
        i,
        r * r * r / 6 - beyond * r * r / 2 + bend * r,
        (3 * s * s * s - 6 * s * s + 4) / 6 + beyond * (1.5 * s * s - 2 * s) + bend * (3 * s - 2),
        (3 * r * r * r - 6 * r * r + 4) / 6 - beyond * (1.5 * r * r - 2 * r) + bend * (3 * r - 2),
        s * s * s / 6 + beyond * s * s / 2 + bend * s,
    )


def _curve(over: str, count: int) -> Law:
    """Return the law of a curve over q or v; or over t, times q (a stiffness) or v (a damping)."""
    over_time, spring = over.startswith("varying"), over.endswith("stiffness")
    over_q = spring and not over_time
    stays, times_q, times_v = not over_q, over_time and spring, over_time and not spring

    def law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]  # compiled by Numba
        x = t if over_time else q[0] if over_q else v[0]
        i, a, b, c, d = _weights(x, p[0], p[1], count, stays)
        force = -(a * p[i + 3] + b * p[i + 4] + c * p[i + 5] + d * p[i + 6])
        f[0] = force * q[0] if times_q else force * v[0] if times_v else force

    return law


def _surface(count: int) -> Law:
    def law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]  # compiled by Numba
        i, a, b, c, d = _weights(q[0], p[0], p[1], count, False)
        j, e, g, h, k = _weights(v[0], p[2], p[3], count, True)
        total = 0.0
        at = 5 + i * count + j
        for weight in (a, b, c, d):
            total += weight * (e * p[at] + g * p[at + 1] + h * p[at + 2] + k * p[at + 3])
            at += count
        f[0] = -total

    return law


@dataclass(frozen=True)
class SplineLaw:
    """The law of a curve or surface, which is compiled for the number of its coefficients.

    Parameters
    ----------
    over : {"stiffness", "damping", "force", "varying_stiffness", "varying_damping"}
    count : int
        Of coefficients, in each direction.
    """

    over: Over
    count: int

    def __call__(self, t: float, q: Any, v: Any, z: Any, p: Any, f: Any, dz: Any) -> None:
        """Write the force, as every law does."""
        self._law()(t, q, v, z, p, f, dz)

    def _law(self) -> Law:
        return _surface(self.count) if self.over == "force" else _curve(self.over, self.count)

    def steepness(self, values: Values, q: float, v: float) -> Steepness:
        """Return the largest stiffness and damping of the curve, and no rate; see `EffectKind`."""
        if self.over == "force":
            fastest = _steepest(values, "slow", "fast", 1)
            return _steepest(values, "low", "high", 0), fastest, 0.0
        varies = self.over.startswith("varying")
        size = _largest(values) if varies else _steepest(values, "low", "high", 0)
        return (0.0, size, 0.0) if self.over.endswith("damping") else (size, 0.0, 0.0)

    def compiled(self) -> Any:
        """Return the law as machine code."""
        return machine_code(self._law())


@njit(cache=True)
def _columns(x, low, high, count, stays):  # type: ignore[no-untyped-def]  # compiled
    out = np.zeros((count, x.size))
    for m in range(x.size):
        i, a, b, c, d = _weights(x[m], low, high, count, stays)
        out[i, m], out[i + 1, m], out[i + 2, m], out[i + 3, m] = a, b, c, d
    return out


def spline_basis(x: Array, low: float, high: float, count: int, stays: bool = False) -> Array:
    """Return the values of the B-splines of a learned law at some points.

    Parameters
    ----------
    x : ndarray, shape (points,)
    low, high : float
        First and last knot.
    count : int
        Of splines, at least 5.
    stays : bool, optional
        Whether the curve stays outside of the knots, instead of going on ever straighter.

    Returns
    -------
    ndarray, shape (count, points)

    Examples
    --------
    >>> basis = spline_basis(np.linspace(-2.0, 2.0, 5), -1.0, 1.0, 7)
    >>> line = spline_centres(-1.0, 1.0, 7)
    >>> bool(np.allclose(line @ basis, [-2.0, -1.0, 0.0, 1.0, 2.0]))
    True
    """
    return _columns(np.ascontiguousarray(x, dtype=float), float(low), float(high), count, stays)


def spline_centres(low: float, high: float, count: int) -> Array:
    """Return the points at which coefficients are the values of a straight line.

    Parameters
    ----------
    low, high : float
        First and last knot.
    count : int
        Of splines.

    Returns
    -------
    ndarray, shape (count,)
    """
    return np.array(low + (high - low) / (count - 3) * (np.arange(count) - 1.0), dtype=float)


def knot_error_bound(c: Array) -> Array:
    """Return how far a law may be from its splines for want of knots, one value a coefficient.

    A spline cannot follow a corner between its knots and swings about it. How far shows in the
    fourth differences nearby: of kinks, jumps and smooth curves alike, nine in ten errors of the
    nearest spline are within a fortieth of them.

    Parameters
    ----------
    c : ndarray, shape (count,) or (count, count)

    Returns
    -------
    ndarray
        Shaped like c: a standard deviation, half of that.

    Examples
    --------
    >>> corner = np.abs(spline_centres(-1.0, 1.0, 11))
    >>> knot_error_bound(corner).round(3).tolist()
    [0.0, 0.0, 0.006, 0.012, 0.012, 0.012, 0.012, 0.012, 0.006, 0.0, 0.0]
    """
    found = np.zeros_like(c)
    for axis in range(c.ndim):
        swings = np.moveaxis(np.abs(np.diff(c, 4, axis=axis)), axis, 0)
        here = np.moveaxis(found, axis, 0)
        for j in range(len(here)):
            near = swings[max(j - 4, 0) : j + 1]
            here[j] = np.maximum(here[j], _SWING * np.max(near, axis=0, initial=0.0))
    return found


def coefficients_of(values: Mapping[str, float]) -> Array:
    """Return the coefficients among the values of a learned law, those of a surface as a square.

    Parameters
    ----------
    values : mapping of str to float
        Of all parameters, in the order of the kind.

    Returns
    -------
    ndarray, shape (count,) or (count, count)
    """
    numbers = np.array(list(values.values()))
    if "slow" not in values:
        return numbers[_CURVE:]
    count = round(float(np.sqrt(numbers.size - _SURFACE)))
    return numbers[_SURFACE:].reshape(count, count)


def smoothness_prior(values: Mapping[str, float]) -> Array:
    """Return rows whose products with the coefficients are standard normal beforehand.

    Parameters
    ----------
    values : mapping of str to float
        Of all parameters.

    Returns
    -------
    ndarray, shape (rows, coefficients)
        None at all if the roughness is 0: then nothing is known.
    """
    c = coefficients_of(values)
    roughness = values["roughness"]
    if not roughness > 0:
        return np.zeros((0, c.size))
    rows = np.diff(np.eye(len(c)), 2, axis=0)
    if c.ndim == 2:
        eye = np.eye(len(c))
        rows = np.vstack([np.kron(rows, eye), np.kron(eye, rows)])
    return np.array(rows / roughness, dtype=np.float64)


def _largest(values: Mapping[str, float]) -> float:
    return float(np.max(np.abs(coefficients_of(values)), initial=0.0)) or 1.0


def _steepest(values: Mapping[str, float], first: str, last: str, axis: int) -> float:
    c = coefficients_of(values)
    width = (values[last] - values[first]) / (c.shape[axis] - 3)
    return float(np.max(np.abs(np.diff(c, axis=axis)))) / width if width > 0 else 0.0


_TOLD = tables(__file__, "laws.toml")
_DIMENSIONS = {"displacement": "L", "velocity": "L/T", "time": "T"}
_KNOTS = (("low", "high"), ("slow", "fast"))


def learned_name(over: Over, count: int) -> str:
    """Return the name of a kind of learned law.

    Parameters
    ----------
    over : {"stiffness", "damping", "force", "varying_stiffness", "varying_damping"}
        A force over the displacement, the velocity, or both; a stiffness or damping over time.
    count : int
        Of coefficients, in each direction.

    Returns
    -------
    str

    Examples
    --------
    >>> learned_name("stiffness", 9), learned_name("force", 7)
    ('learned_stiffness_9', 'learned_force_7x7')
    """
    return f"learned_{over}_{count}x{count}" if over == "force" else f"learned_{over}_{count}"


@lru_cache(maxsize=256)
def learned_kind(name: str) -> EffectKind | None:
    """Return the kind that a name such as `learned_stiffness_9` codes, None if it codes none.

    Parameters
    ----------
    name : str

    Returns
    -------
    EffectKind or None

    Examples
    --------
    >>> learned_kind("learned_damping_8").parameters[-1].name
    'c8'
    >>> learned_kind("cubic_stiffness") is None
    True
    """
    told = _NAME.fullmatch(name)
    if told is None or told[1] not in _TOLD["learned"]:
        return None
    over, count = cast(Over, told[1]), int(told[2])
    law, square = _TOLD["learned"][over], over == "force"
    variables, dimension = law["over"], law["dimension"]
    fits = _FEWEST <= count <= (_MOST_ACROSS if square else _MOST)
    if not fits or told[3] != (told[2] if square else None):
        return None
    variable = " and ".join(variables)
    varies = over.removeprefix("varying_") if over.startswith("varying") else ""
    what = (
        f"A {varies} that changes along the record"
        if varies
        else f"A force that depends on {variable} and that no effect of the catalogue describes"
    )
    parameters = []
    for ends, along in zip(_KNOTS, variables, strict=False):
        for end, default, which in zip(ends, (-1.0, 1.0), ("least", "largest"), strict=True):
            meaning, unit = (
                f"{which} {along} that was seen: an end of the knots",
                _DIMENSIONS[along],
            )
            parameters.append(Parameter(end, unit, meaning, default=default, fitted=False))
    meaning = "expected size of the second differences of the coefficients, 0 if unknown"
    parameters.append(Parameter("roughness", dimension, meaning, lower=0.0, fitted=False))
    columns = [f"_{j + 1}" for j in range(count)] if square else [""]
    names = [f"c{i + 1}{column}" for i in range(count) for column in columns]
    meaning = "coefficient of a spline"
    parameters += [Parameter(c, dimension, meaning, fit_size=_largest) for c in names]
    return EffectKind(
        kind=name,
        title=f"Learned {varies or 'law'} over {variable}",
        domain="pair",
        parameters=tuple(parameters),
        law=SplineLaw(over, count),
        prior=smoothness_prior,
        over=tuple(variables),
        contains=tuple(law["contains"]),
        looks_like=f"{what}; its curve was learned from the data.",
        checks=tuple(_TOLD["checks"]["time" if varies else "motion"]),
        references=(_REFERENCE,),
    )
