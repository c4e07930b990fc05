"""A learned law to look at: its curve, how well it is known, in words and as a formula."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from scipy.optimize import minimize_scalar
from scipy.stats import chi2

from robustpolish.base.arrays import Array
from robustpolish.base.checks import invalid
from robustpolish.base.results import Card, Displayed, plus_minus, quantities
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.effects.spline_law import coefficients_of, knot_error_bound, spline_basis
from robustpolish.plots.residuals import plot_force_curve, plot_surface

# The simplest formula that lies within the band of a learned curve.
#
# Terms that are linear in one number, and those with a length or a speed of their own, are fitted
# to the coefficients of the curve by least squares with their covariance. One number is tried
# before two, two before three: the first count at which the misfit is no more than chance is
# taken.

Shape = Callable[[Array, float], Array]

_REFINED = 6
"""How many of the best sums have their length or speed fitted, after some were tried."""


_CHANCE = 0.99
"""Share of right formulas whose misfit is called chance: one in a hundred is refused."""
_AS_GOOD = 0.003
"""Share of the largest force within which a formula is as good as a curve, however narrow its band:
splines round the corners of a dead zone by about as much."""
_UNKNOWN = 0.05
"""The same where no covariance is known."""
_TURNS = tuple(np.geomspace(0.003, 0.9, 36).tolist())
"""Shares of the range that are tried for a gap, or for the length over which a force saturates."""


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


def simplest_formula(curve: Curve, over: str, units: tuple[str, str]) -> Formula | None:
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
        if best is not None and best.chi2 <= chi2.ppf(_CHANCE, fit.freedom(number)):
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
            yield from ((chosen, share * reach) for share in _TURNS)


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
        share = _AS_GOOD if known else _UNKNOWN
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
        step = _TURNS[1] / _TURNS[0]
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


# What a learned curve resembles, in words with numbers.


def describe_law(curve: xr.Dataset, place: str, formula: Formula | None) -> str:
    """Return sentences on a learned curve or surface.

    Parameters
    ----------
    curve : xarray.Dataset
        ``force`` and ``stderr`` over ``displacement``, ``velocity`` or both, or ``stiffness`` or
        ``damping`` over ``time``.
    place : str
    formula : Formula or None

    Returns
    -------
    str
        The first line says what it is a curve of, how far it was seen and how large it is.
    """
    quantity = next(str(name) for name in curve.data_vars if name != "stderr")
    found = curve[quantity]
    dims = [str(name) for name in found.dims]
    ranges = " and ".join(
        f"{float(curve[d][0]):.3g} to {float(curve[d][-1]):.3g} {curve[d].attrs['units']}"
        for d in dims
    )
    largest = float(np.max(np.abs(found.values)))
    unit = found.attrs["units"]
    lines = [
        f"{quantity.capitalize()} over {' and '.join(dims)} at {place}, seen from {ranges}: "
        f"up to {largest:.3g} {unit}."
    ]
    stderr = curve["stderr"].values
    if np.isfinite(stderr).all() and largest > 0:
        share = 100 * float(np.median(stderr)) / largest
        lines.append(f"Its standard error is {share:.2g} % of that in the middle of all points.")
    if largest > 0:
        if dims == ["displacement"]:
            lines += _spring(curve)
        elif dims == ["velocity"]:
            lines += _damper(curve)
        elif dims == ["time"]:
            lines.append(_along_time(found))
        else:
            lines += _energy(curve)
    if formula is None:
        lines.append("No simple formula lies within its band.")
    else:
        lines.append(f"The simplest formula within its band: {formula}.")
    return "\n".join(lines)


def _spring(curve: xr.Dataset) -> list[str]:
    x, g = curve["displacement"].values, curve["force"].values
    unit, length = curve["force"].attrs["units"], curve["displacement"].attrs["units"]
    lines = _symmetry(x, g, "the displacement")
    side = _one_sided(x, g)
    if side:
        return [*lines, f"It acts on one side only, at {side} displacements."]
    if any("even" in line and "neither" not in line for line in lines):
        return lines
    slope = np.gradient(g, x)
    zone = _dead_zone(x, g, slope)
    if zone is not None:
        low, high = zone
        return [*lines, f"It has a dead zone from {low:.3g} to {high:.3g} {length}."]
    middle, ends = _slopes(x, slope)
    told = f"slope {middle:.3g} {unit}/{length} about the middle and {ends:.3g} at the ends"
    return [*lines, f"It {_bend(middle, ends, *_OF_SPRINGS)}: {told}."]


def _damper(curve: xr.Dataset) -> list[str]:
    v, g = curve["velocity"].values, curve["force"].values
    unit, length = curve["force"].attrs["units"], curve["velocity"].attrs["units"]
    lines = _symmetry(v, g, "the velocity")
    side = _one_sided(v, g)
    if side:
        lines.append(f"It acts in one direction only, at {side} velocities.")
    lines += _energy(curve)
    outer = np.abs(v) > 0.25 * np.max(np.abs(v))
    sizes = np.abs(g[outer])
    turns = np.sign(g[v < 0][:1]) != np.sign(g[v > 0][-1:])
    if not side and turns.all() and np.ptp(sizes) < 0.3 * np.mean(sizes):
        mean = float(np.mean(sizes))
        lines.append(f"It hardly depends on the speed, as dry friction of {mean:.3g} {unit}.")
        return lines
    slope = np.gradient(g, v)
    middle, ends = _slopes(v, slope)
    told = f"slope {middle:.3g} {unit}/({length}) about rest and {ends:.3g} at the ends"
    return [*lines, f"It {_bend(middle, ends, *_OF_DAMPERS)}: {told}."]


def _along_time(found: xr.DataArray) -> str:
    """Say how far a stiffness or damping goes along the record, and whether it turns back."""
    values, unit = found.values, found.attrs["units"]
    steps = np.diff(values)
    up, down = float(steps[steps > 0].sum()), float(-steps[steps < 0].sum())
    way = "rises" if up > down else "falls"
    if min(up, down) > 0.1 * max(up, down):  # of the way up
        way = "goes up and down"
    return (
        f"It comes on top of what the model was given, and {way} along the record: from "
        f"{values[0]:.3g} to {values[-1]:.3g}, between {values.min():.3g} and {values.max():.3g} "
        f"{unit}."
    )


_OF_SPRINGS = "hardens", "softens", "is nearly straight"
_OF_DAMPERS = (
    "grows faster than the velocity", "grows more slowly than the velocity", "is nearly viscous",
)  # fmt: skip


def _bend(middle: float, ends: float, more: str, less: str, straight: str) -> str:
    """Say what becomes of a slope from the middle to the ends."""
    if abs(ends) <= 0.2 * abs(middle):
        return "saturates"
    if ends > 1.5 * middle and ends > 0:
        return more
    return less if ends < 0.67 * middle else straight


def _symmetry(x: Array, g: Array, what: str) -> list[str]:
    """Say whether a curve changes its sign with x, as far as both signs of x were seen."""
    reach = min(-x[0], x[-1])
    if reach < 0.3 * max(abs(x[0]), abs(x[-1])):
        return []
    grid = np.linspace(0.0, reach, 61)
    ahead, behind = np.interp(grid, x, g), np.interp(-grid, x, g)
    odd, even = np.mean((ahead - behind) ** 2), np.mean((ahead + behind) ** 2)
    share = float(odd / max(odd + even, 1e-300))
    if share >= 0.9:
        return [f"It is odd, {100 * share:.0f} % of its square: it changes its sign with {what}."]
    if share <= 1 - 0.9:
        return [f"It is even, {100 * (1 - share):.0f} % of its square: it keeps its sign."]
    return [f"It is neither odd nor even: {100 * share:.0f} % of its square is odd."]


def _one_sided(x: Array, g: Array) -> str:
    """Return "positive" or "negative" if a curve is as good as zero on the other side."""
    if x[0] >= 0 or x[-1] <= 0:
        return ""
    negative, positive = (float(np.sqrt(np.mean(g[s] ** 2))) for s in (x < 0, x > 0))
    if negative < 0.1 * positive:
        return "positive"
    return "negative" if positive < 0.1 * negative else ""


def _dead_zone(x: Array, g: Array, slope: Array) -> tuple[float, float] | None:
    """Return the ends of a stretch without force beyond which the slope is nearly constant."""
    small = np.abs(g) < 0.05 * np.max(np.abs(g))
    middle = int(np.argmin(np.abs(x)))
    if not small[middle]:
        return None
    first, last = middle, middle
    while first > 0 and small[first - 1]:
        first -= 1
    while last + 1 < x.size and small[last + 1]:
        last += 1
    if x[last] - x[first] < 0.2 * (x[-1] - x[0]) or first == 0 or last == x.size - 1:
        return None
    ends = []
    for at, outside in ((first, slice(first - 1, None, -1)), (last, slice(last + 1, None))):
        steep = slope[outside]
        third = max(steep.size // 3, 1)
        near, far = float(np.mean(steep[third : 2 * third])), float(np.mean(steep[2 * third :]))
        # a cube is small about rest, too, but its slope goes on growing to the very ends
        if steep.size < 6 or far > 1.25 * near or not near:
            return None
        begin = outside.start + (third if at == last else -third)
        ends.append(float(x[begin] - g[begin] / near))  # where the straight part would begin
    return ends[0], ends[1]


def _slopes(x: Array, slope: Array) -> tuple[float, float]:
    """Return the slope about the middle of a range, and the mean slope at its ends."""
    share = (x - x[0]) / (x[-1] - x[0])
    middle = slope[(share > 0.4) & (share < 0.6)]
    ends = np.concatenate([slope[share < 0.12], slope[share > 0.88]])
    return float(np.mean(middle)), float(np.mean(ends))


def _energy(curve: xr.Dataset) -> list[str]:
    """Say whether a force takes energy out or feeds it, and where, as far as that is sure."""
    v = curve["velocity"].values
    force, stderr = curve["force"].values, np.nan_to_num(curve["stderr"].values, nan=0.0)
    if force.ndim == 2:  # what depends on the displacement alone stores energy
        still = np.array([np.interp(0.0, v, row) for row in force])
        force = force - still[:, None]
    power = force * v
    feeds = (power < 0) & (np.abs(force) > 2.0 * stderr)  # two standard errors: it has a sign
    little = 0.01 * np.max(np.abs(power))
    feeds &= np.abs(power) > little
    if not feeds.any():
        return ["It takes energy out at every speed that was seen."]
    speeds = v[feeds.any(axis=0) if force.ndim == 2 else feeds]
    unit = curve["velocity"].attrs["units"]
    if np.all(feeds | (np.abs(power) <= little)):
        return ["It feeds energy at every speed that was seen."]
    return [f"It feeds energy at speeds from {speeds.min():.3g} to {speeds.max():.3g} {unit}."]


_POINTS, _POINTS_ACROSS, _FINE = 121, 31, 601


@dataclass(frozen=True, eq=False, repr=False)
class LearnedLaw(Displayed):
    """A force that was learned as a curve over what it depends on, or a stiffness over time.

    The curve is that of the restoring force: positive where it pulls the first coordinate back,
    as a spring and a damper do. Of what varies with time it is the stiffness, or the damping.

    Parameters
    ----------
    effect : Effect
        Of a kind such as `learned_stiffness_9`.
    covariance : ndarray, shape (coefficients, coefficients), optional
        Of the coefficients, in N^2 (or N^2 m^2 of a torque); no band is known without it.
    rotational : bool, optional
        Whether it is a torque over an angle.

    Raises
    ------
    InvalidInputError
        If the effect is no learned law.

    Examples
    --------
    >>> import robustpolish as rp
    >>> from robustpolish.effects import Effect
    >>> knots = {"low": -0.01, "high": 0.01}
    >>> line = {f"c{j + 1}": 100.0 * (j - 3) / 3 for j in range(7)}
    >>> law = rp.results.LearnedLaw(Effect("learned_stiffness_7", "x", knots | line))
    >>> law.over, law.seen
    ('displacement', {'displacement': (-0.01, 0.01)})
    >>> law.curve(3)["force"].values.round(6).tolist()
    [-66.666667, 0.0, 66.666667]
    >>> print(law.formula())
    k*q with k = 6667 N/m
    >>> law.describe().splitlines()[0]
    'Force over displacement at x, ground, seen from -0.01 to 0.01 m: up to 66.7 N.'
    >>> law.plot().get_xlabel()
    'displacement [mm]'
    """

    effect: Effect
    covariance: Array | None = None
    rotational: bool = False

    def __post_init__(self) -> None:
        if not self.effect.definition.over:
            raise invalid("effect", self.effect.kind, "a learned law", "Plot others as signals.")

    @property
    def over(self) -> str:
        """What it is a curve over: displacement, velocity, or both, or time."""
        return " and ".join(self.effect.definition.over)

    @property
    def units(self) -> tuple[str, str]:
        """The units of the force and of the displacement."""
        return ("N m", "rad") if self.rotational else ("N", "m")

    @property
    def quantity(self) -> str:
        """What is a curve: the force or, over time, the stiffness or the damping."""
        if self.over != "time":
            return "force"
        return "stiffness" if "spring" in self.effect.definition.contains else "damping"

    @property
    def unit(self) -> str:
        """The unit of that quantity: its coefficients are values of it."""
        return self.effect.definition.parameters[-1].unit(self.rotational)

    @property
    def seen(self) -> dict[str, tuple[float, float]]:
        """The range of each variable that the data showed: outside, the law is a guess."""
        values = self.effect.values
        found = {self.effect.definition.over[0]: (values["low"], values["high"])}
        if "slow" in values:
            found["velocity"] = (values["slow"], values["fast"])
        return found

    @cached_property
    def coefficients(self) -> Array:
        """The coefficients in one row, shape (count,)."""
        return coefficients_of(self.effect.values).ravel()

    def curve(self, points: int | None = None) -> xr.Dataset:
        """Return the curve and its standard error over the range that was seen.

        Parameters
        ----------
        points : int, optional
            In each direction; 121 of a curve and 31 of a surface by default.

        Returns
        -------
        xarray.Dataset
            ``force`` and ``stderr`` (NaN if not known) over displacement, velocity or both; over
            time ``stiffness`` or ``damping`` stands in place of the force. The error holds what the
            data leave open, and what happens between knots.
        """
        axes = self._axes(points or (_POINTS_ACROSS if len(self.seen) > 1 else _POINTS))
        basis = self._basis(axes)
        shape = tuple(grid.size for grid in axes.values())
        values = (self.coefficients @ basis).reshape(shape)
        stderr = np.full(shape, np.nan)
        if self.covariance is not None:
            power = np.einsum("ip,ij,jp->p", basis, np.nan_to_num(self.covariance), basis)
            unseen = np.abs(basis).T @ ~np.isfinite(np.diag(self.covariance)) > 0
            swings = knot_error_bound(coefficients_of(self.effect.values)).ravel() @ np.abs(basis)
            stderr = np.sqrt(np.maximum(power, 0.0) + swings**2)
            stderr = np.where(unseen, np.inf, stderr).reshape(shape)
        length = self.units[1]
        units = {"displacement": length, "velocity": f"{length}/s", "time": "s"}
        coords = {name: (name, grid, {"units": units[name]}) for name, grid in axes.items()}
        return xr.Dataset(
            {
                self.quantity: (tuple(axes), values, {"units": self.unit}),
                "stderr": (tuple(axes), stderr, {"units": self.unit}),
            },
            coords,
        )

    def _axes(self, points: int) -> dict[str, Array]:
        return {name: np.linspace(*ends, points) for name, ends in self.seen.items()}

    def _basis(self, axes: dict[str, Array]) -> Array:
        """Return the splines on a grid, shape (coefficients, points)."""
        count = round(self.coefficients.size ** (1 / len(axes)))
        found = np.ones((1, 1))
        for name, grid in axes.items():
            here = spline_basis(grid, *self.seen[name], count, name != "displacement")
            found = np.kron(found, here)
        return np.array(found, dtype=np.float64)

    def formula(self) -> Formula | None:
        """Return the simplest formula that lies within the band of the curve.

        Returns
        -------
        Formula or None
            None if no sum of two simple terms does.
        """
        axes = self._axes(_POINTS_ACROSS if len(self.seen) > 1 else _FINE)
        basis = self._basis(axes)
        letters = {"displacement": "q", "velocity": "v", "time": "t"}
        named = {letters[name]: grid for name, grid in axes.items()}
        inverse = np.linalg.lstsq(basis.T, np.eye(basis.shape[1]), rcond=None)[0]
        project = np.array(inverse, dtype=np.float64)
        curve = Curve(self.coefficients, self.covariance, named, basis, project)
        units = (self.unit, "s") if self.over == "time" else self.units
        return simplest_formula(curve, self.over, units)

    def describe(self) -> str:
        """Say in words what the law resembles, with numbers.

        Returns
        -------
        str
            Several lines.
        """
        return describe_law(self.curve(), ", ".join(self.effect.at), self.formula())

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the curve with its 95 % band, or the surface.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
        """
        found = self.curve()
        if len(self.seen) > 1:
            return plot_surface(found, ax)
        band = None if self.covariance is None else 1.96 * found["stderr"]
        return plot_force_curve(found[self.quantity], band, ax)

    def _card(self) -> Card:
        head, *rest = self.describe().splitlines()
        ranges = [(f"{name} seen", f"{low:.4g} to {high:.4g}") for name, (low, high) in
                  self.seen.items()]  # fmt: skip
        return Card(
            head, (quantities(*ranges, ("coefficients", self.coefficients.size)),), tuple(rest)
        )
