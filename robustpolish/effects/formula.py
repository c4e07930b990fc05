"""The simplest formula that lies within the band of a learned curve.

Terms that are linear in one number, and those with a length or a speed of their own, are fitted to
the coefficients of the curve by least squares with their covariance. One number is tried before
two, two before three: the first count at which the misfit is no more than chance is taken.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.stats import chi2

from robustpolish.arrays import Array
from robustpolish.display import plus_minus

Shape = Callable[[Array, float], Array]

_REFINED = 6
"""How many of the best sums have their length or speed fitted, after some were tried."""


@dataclass(frozen=True)
class Likeness:
    """When a formula counts as the one behind a curve.

    Attributes
    ----------
    chance : float
        Share of right formulas whose misfit is called chance: one in a hundred is refused.
    as_good : float
        Share of the largest force within which a formula is as good as a curve, however narrow
        its band: splines round the corners of a dead zone by about as much.
    unknown : float
        The same where no covariance is known.
    turns : tuple of float
        Shares of the range that are tried for a gap, or for the length over which a force
        saturates.
    """

    chance: float = 0.99
    as_good: float = 0.003
    unknown: float = 0.05
    turns: tuple[float, ...] = tuple(np.geomspace(0.003, 0.9, 36).tolist())


LIKENESS = Likeness()
"""What :meth:`LearnedLaw.formula` goes by."""


@dataclass(frozen=True)
class Formula:
    """A formula for a learned law, as the force against the motion, with its numbers.

    Attributes
    ----------
    expression : str
        Of the restoring force, such as ``"k5*q**5"``, in q and v and the numbers; of a stiffness or
        damping in t.
    numbers : mapping of str to float
    stderr : mapping of str to float
        Standard errors of the numbers; NaN where not known, as of a gap or a length.
    units : mapping of str to str
    misfit : float
        Root mean square difference from the curve over the largest force.

    Examples
    --------
    >>> print(Formula("k3*q**3", {"k3": 4e6}, {"k3": 1e5}, {"k3": "N/m^3"}, 0.01))
    k3*q**3 with k3 = 4.00e+06 +- 1.0e+05 N/m^3
    """

    expression: str
    numbers: Mapping[str, float]
    stderr: Mapping[str, float]
    units: Mapping[str, str]
    misfit: float

    def __str__(self) -> str:
        told = []
        for name, value in self.numbers.items():
            told.append(f"{name} = {plus_minus(value, self.stderr[name], 4)} {self.units[name]}")
        return f"{self.expression} with {', '.join(told)}"


class Term(NamedTuple):
    """A term of a formula: a number times a shape.

    `turn` is the name of the shape's own length or speed, empty if it has none; `powers` are those
    of displacement and velocity by which the number's unit divides.
    """

    name: str
    expression: str
    shape: Shape
    over: str
    powers: tuple[int, int]
    turn: str = ""


def _power(n: int) -> Shape:
    return lambda x, d: x**n


def _dead(x: Array, d: float) -> Array:
    return np.sign(x) * np.maximum(np.abs(x) - d, 0.0)


_Q = (
    Term("k", "k*q", _power(1), "q", (1, 0)),
    Term("k3", "k3*q**3", _power(3), "q", (3, 0)),
    Term("k5", "k5*q**5", _power(5), "q", (5, 0)),
    Term("ka", "ka*q*abs(q)", lambda x, d: x * np.abs(x), "q", (2, 0)),
    Term("k2", "k2*q**2", _power(2), "q", (2, 0)),
    Term("F0", "F0", lambda x, d: np.ones_like(x), "q", (0, 0)),
    Term("Fs", "Fs*tanh(q/d)", lambda x, d: np.tanh(x / d), "q", (0, 0), "d"),
    Term("kd", "kd*sign(q)*max(abs(q) - d, 0)", _dead, "q", (1, 0), "d"),
    Term("kr", "kr*max(q - d, 0)", lambda x, d: np.maximum(x - d, 0.0), "q", (1, 0), "d"),
    Term("kl", "kl*min(q + d, 0)", lambda x, d: np.minimum(x + d, 0.0), "q", (1, 0), "d"),
    Term("kr", "kr*max(q, 0)", lambda x, d: np.maximum(x, 0.0), "q", (1, 0)),
    Term("kl", "kl*min(q, 0)", lambda x, d: np.minimum(x, 0.0), "q", (1, 0)),
)
_V = (
    Term("c", "c*v", _power(1), "v", (0, 1)),
    Term("F", "F*sign(v)", lambda x, d: np.sign(x), "v", (0, 0)),
    Term("ca", "ca*v*abs(v)", lambda x, d: x * np.abs(x), "v", (0, 2)),
    Term("c3", "c3*v**3", _power(3), "v", (0, 3)),
    Term("F0", "F0", lambda x, d: np.ones_like(x), "v", (0, 0)),
    Term("F", "F*tanh(v/w)", lambda x, d: np.tanh(x / d), "v", (0, 0), "w"),
)
_BOTH = (
    Term("cq", "cq*q**2*v", lambda x, d: x, "q2v", (2, 1)),
    Term("kv", "kv*q*v", lambda x, d: x, "qv", (1, 1)),
)
_T = (
    Term("a0", "a0", lambda x, d: np.ones_like(x), "t", (0, 0)),
    Term("a1", "a1*t", _power(1), "t", (1, 0)),
    Term("a2", "a2*t**2", _power(2), "t", (2, 0)),
    Term("aw", "aw*(1 - exp(-t/d))", lambda x, d: -np.expm1(-x / d), "t", (0, 0), "d"),
)
TERMS = {
    "displacement": _Q,
    "velocity": _V,
    "displacement and velocity": (*_Q, *_V, *_BOTH),
    "time": _T,
}


class Curve(NamedTuple):
    """Coefficients of a curve or surface, and what makes coefficients of a shape.

    `axes` are grids over q and v, or t, without what it does not depend on; `project` turns
    values on the grid (flattened) into coefficients, `basis` coefficients into values.
    """

    coefficients: Array
    covariance: Array | None
    axes: Mapping[str, Array]
    basis: Array
    project: Array


def simplest(curve: Curve, over: str, units: tuple[str, str]) -> Formula | None:
    """Return the simplest formula that lies within the band of a curve, None if none does.

    Parameters
    ----------
    curve : Curve
    over : str
        "displacement", "velocity", "displacement and velocity", or "time".
    units : tuple of str
        Of the force and of the displacement; over time, of what varies and of the time.

    Returns
    -------
    Formula or None
    """
    if not np.any(curve.coefficients @ curve.basis):
        return None
    fit = _Fit(curve)
    for number in (1, 2, 3):
        found = [fit(terms, turn) for terms, turn in _choices(TERMS[over], number, curve.axes)]
        found += [fit.turned(f) for f in sorted(found, key=lambda f: f.chi2)[:_REFINED] if f.turn]
        best = min(found, key=lambda f: f.chi2, default=None)
        if best is not None and best.chi2 <= chi2.ppf(LIKENESS.chance, fit.freedom(number)):
            return _formula(best, fit, units)
    return None


def _choices(
    terms: Sequence[Term], number: int, axes: Mapping[str, Array]
) -> Iterator[tuple[tuple[Term, ...], float]]:
    """Yield sums of at most two terms with so many numbers, lengths and speeds of theirs tried."""
    for size in (1, 2):
        for chosen in itertools.combinations(terms, size):
            turning = [term for term in chosen if term.turn]
            names = {term.name for term in chosen}
            if size + len(turning) != number or len(turning) > 1 or len(names) < size:
                continue
            if not turning:
                yield chosen, 0.0
                continue
            reach = float(np.max(np.abs(axes[turning[0].over])))
            yield from ((chosen, share * reach) for share in LIKENESS.turns)


class _Found(NamedTuple):
    terms: tuple[Term, ...]
    turn: float
    numbers: Array
    covariance: Array
    chi2: float


class _Fit:
    """Least squares of sums of terms on the coefficients of a curve."""

    def __init__(self, curve: Curve) -> None:
        self.curve = curve
        values = curve.coefficients @ curve.basis
        self.largest = float(np.max(np.abs(values)))
        known = curve.covariance is not None and bool(np.isfinite(curve.covariance).all())
        self.known = known
        share = LIKENESS.as_good if known else LIKENESS.unknown
        spread = np.eye(curve.coefficients.size) * (share * self.largest) ** 2
        if known and curve.covariance is not None:
            spread = spread + curve.covariance
        self.precision = np.linalg.inv(spread)
        self.grids = dict(curve.axes)
        if {"q", "v"} <= set(self.grids):
            q, v = np.meshgrid(self.grids["q"], self.grids["v"], indexing="ij")
            self.grids = {"q": q.ravel(), "v": v.ravel()}
            self.grids |= {"qv": (q * v).ravel(), "q2v": (q * q * v).ravel()}

    def freedom(self, number: int) -> int:
        """Return how many coefficients are left to chance."""
        return max(self.curve.coefficients.size - number, 1)

    def column(self, term: Term, turn: float) -> Array:
        """Return the coefficients of one unit of a term."""
        return self.curve.project @ term.shape(self.grids[term.over], turn)

    def turned(self, found: _Found) -> _Found:
        """Return the same terms with the length that fits best about the one that was tried."""
        turns = LIKENESS.turns
        step = turns[1] / turns[0]
        bounds = found.turn / step, found.turn * step
        best: Any = minimize_scalar(lambda d: self(found.terms, float(d)).chi2, bounds=bounds)
        return self(found.terms, float(best.x))

    def __call__(self, terms: tuple[Term, ...], turn: float) -> _Found:
        X = np.column_stack([self.column(term, turn) for term in terms])
        size = np.sqrt(np.sum(X**2, axis=0))
        size[size == 0] = 1.0
        X = X / size
        c, W = self.curve.coefficients, self.precision
        inverse = np.linalg.pinv(X.T @ W @ X, rcond=1e-12, hermitian=True)
        a = inverse @ (X.T @ W @ c)
        rest = c - X @ a
        return _Found(terms, turn, a / size, inverse / np.outer(size, size), float(rest @ W @ rest))


def _formula(found: _Found, fit: _Fit, units: tuple[str, str]) -> Formula:
    names = [term.name for term in found.terms]
    spread = np.diag(found.covariance) if fit.known else np.full(len(names), np.nan)
    errors = np.sqrt(spread).tolist()
    numbers = dict(zip(names, found.numbers.tolist(), strict=True))
    stderr = dict(zip(names, errors, strict=True))
    told = {term.name: unit_of_power(units, *term.powers) for term in found.terms}
    for term in found.terms:
        if term.turn:
            numbers[term.turn], stderr[term.turn] = found.turn, float("nan")
            told[term.turn] = units[1] + ("/s" if term.over == "v" else "")
    X = np.column_stack([fit.column(term, found.turn) for term in found.terms])
    rest = (fit.curve.coefficients - X @ found.numbers) @ fit.curve.basis
    misfit = float(np.sqrt(np.mean(rest**2))) / fit.largest
    expression = " + ".join(term.expression for term in found.terms)
    return Formula(expression, numbers, stderr, told, misfit)


def unit_of_power(units: tuple[str, str], q: int, v: int) -> str:
    """Return the unit of a number that multiplies powers of displacement and velocity.

    Parameters
    ----------
    units : tuple of str
        Of the force and of the displacement.
    q, v : int
        The powers.

    Returns
    -------
    str

    Examples
    --------
    >>> unit_of_power(("N", "m"), 5, 0), unit_of_power(("N", "m"), 2, 1)
    ('N/m^5', 'N s/m^3')
    """
    force, length = units
    seconds = "" if v == 0 else " s" if v == 1 else f" s^{v}"
    lengths = "" if q + v == 0 else f"/{length}" if q + v == 1 else f"/{length}^{q + v}"
    return f"{force}{seconds}{lengths}"
