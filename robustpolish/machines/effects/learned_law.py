"""A learned law to look at: its curve, how well it is known, in words and as a formula."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from scipy.optimize import minimize_scalar
from scipy.stats import chi2

from robustpolish.base.arrays import Array
from robustpolish.base.checks import invalid
from robustpolish.base.results import Card, Displayed, plus_minus, quantities, tables
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.effects.formula_language import PostfixProgram, read_formula
from robustpolish.machines.effects.spline_law import coefficients_of, knot_error_bound, spline_basis
from robustpolish.plots.residuals import plot_force_curve, plot_surface

# The simplest formula that lies within the band of a learned curve.
#
# Terms that are linear in one number, and those with a length or a speed of their own, are fitted
# to the coefficients of the curve by least squares with their covariance. One number is tried
# before two, two before three: the first count at which the misfit is no more than chance is
# taken.

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
_POINTS, _POINTS_ACROSS, _FINE = 121, 31, 601
_LETTERS = {"displacement": "q", "velocity": "v", "time": "t"}


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
        told = [
            f"{name} = {plus_minus(value, self.stderr[name], 4)} {self.units[name]}"
            for name, value in self.numbers.items()
        ]
        return f"{self.expression} with {', '.join(told)}"


_TERMS: Mapping[str, dict[str, list[int]]] = tables(__file__, "laws.toml")["terms"]


class _Term(NamedTuple):
    """A term, read: its number, and the length or speed of its own over a variable, or ""."""

    formula: PostfixProgram
    powers: tuple[int, int]
    name: str
    turn: str
    variable: str


@lru_cache(maxsize=4)
def _terms(over: str) -> list[_Term]:
    found, texts = [], {}
    for part in dict.fromkeys([*over.split(" and "), over]):
        texts |= _TERMS[part]
    for text, (q, v) in texts.items():
        name = text.split("*")[0]
        turn = "".join(re.findall(r"\b[dw]\b", text)[:1])
        formula = read_formula(f"f = {text}", [name, *turn])
        variable = next((letter for letter in "qvt" if letter in formula.names), "")
        found.append(_Term(formula, (q, v), name, turn, variable))
    return found


class _Fit(NamedTuple):
    """Terms fitted to a curve, with one length or speed of theirs."""

    terms: tuple[_Term, ...]
    turn: float
    numbers: Array
    covariance: Array
    chi2: float


def _simplest_formula(law: LearnedLaw) -> Formula | None:
    """Return the simplest formula that lies within the band of a law, None if none does."""
    axes = law._axes(_POINTS_ACROSS if len(law.seen) > 1 else _FINE)
    basis, c, covariance = law._basis(axes), law.coefficients, law.covariance
    values = c @ basis
    largest = float(np.max(np.abs(values)))
    if not largest:
        return None
    # from values on the grid to coefficients
    project = np.linalg.lstsq(basis.T, np.eye(values.size), rcond=None)[0]
    grids = (grid.ravel() for grid in np.meshgrid(*axes.values(), indexing="ij"))
    motion = dict(zip((_LETTERS[name] for name in axes), grids, strict=True))
    known = covariance is not None and bool(np.isfinite(covariance).all())
    spread = np.eye(c.size) * ((_AS_GOOD if known else _UNKNOWN) * largest) ** 2
    W = np.linalg.inv(spread if covariance is None or not known else spread + covariance)

    @cache
    def column(term: _Term, turn: float) -> Array:
        unit = term.formula.value({**motion, term.name: 1.0, term.turn: turn})
        return np.asarray(project @ np.broadcast_to(unit, values.shape), dtype=float)

    def fit(terms: tuple[_Term, ...], turn: float) -> _Fit:
        X = np.column_stack([column(term, turn) for term in terms])
        size = np.sqrt(np.sum(X**2, axis=0))
        size[size == 0] = 1.0
        X = X / size
        inverse = np.linalg.pinv(X.T @ W @ X, rcond=1e-12, hermitian=True)
        a = inverse @ (X.T @ W @ c)
        rest = c - X @ a
        return _Fit(terms, turn, a / size, inverse / np.outer(size, size), float(rest @ W @ rest))

    def refined(found: _Fit) -> _Fit:
        """Return the same terms with the length that fits best about the one that was tried."""
        step = _TURNS[1] / _TURNS[0]
        bounds = found.turn / step, found.turn * step
        best: Any = minimize_scalar(lambda d: fit(found.terms, float(d)).chi2, bounds=bounds)
        return fit(found.terms, float(best.x))

    for number in (1, 2, 3):
        fits = [fit(*choice) for choice in _choices(_terms(law.over), number, motion)]
        fits += [refined(f) for f in sorted(fits, key=lambda f: f.chi2)[:_REFINED] if f.turn]
        best = min(fits, key=lambda f: f.chi2, default=None)
        if best is not None and best.chi2 <= chi2.ppf(_CHANCE, max(c.size - number, 1)):
            break
    else:
        return None
    names = [term.name for term in best.terms]
    errors = np.sqrt(np.diag(best.covariance)) if known else np.full(len(names), np.nan)
    numbers = dict(zip(names, best.numbers.tolist(), strict=True))
    stderr = dict(zip(names, errors.tolist(), strict=True))
    force, length = (law.unit, "s") if law.over == "time" else law.units
    units = {term.name: _unit(force, length, *term.powers) for term in best.terms}
    for term in best.terms:
        if term.turn:
            numbers[term.turn], stderr[term.turn] = best.turn, float("nan")
            units[term.turn] = length + ("/s" if term.variable == "v" else "")
    X = np.column_stack([column(term, best.turn) for term in best.terms])
    misfit = float(np.sqrt(np.mean(((c - X @ best.numbers) @ basis) ** 2))) / largest
    expression = " + ".join(term.formula.text.removeprefix("f = ") for term in best.terms)
    return Formula(expression, numbers, stderr, units, misfit)


def _choices(
    terms: Sequence[_Term], number: int, motion: Mapping[str, Array]
) -> Iterator[tuple[tuple[_Term, ...], float]]:
    """Yield sums of at most two terms with so many numbers, lengths and speeds of theirs tried."""
    for size in (1, 2):
        for chosen in itertools.combinations(terms, size):
            turning = [term for term in chosen if term.turn]
            names = {term.name for term in chosen}
            if size + len(turning) != number or len(turning) > 1 or len(names) < size:
                continue
            turns = [0.0]
            if turning:
                reach = float(np.max(np.abs(motion[turning[0].variable])))
                turns = [share * reach for share in _TURNS]
            yield from ((chosen, turn) for turn in turns)


def _unit(force: str, length: str, q: int, v: int) -> str:
    """Return the unit of a number that multiplies powers of displacement and velocity."""
    seconds = "" if v == 0 else " s" if v == 1 else f" s^{v}"
    lengths = "" if q + v == 0 else f"/{length}" if q + v == 1 else f"/{length}^{q + v}"
    return f"{force}{seconds}{lengths}"


# What a learned curve resembles, in words with numbers.


def _course(curve: xr.Dataset, over: str) -> list[str]:
    """Return sentences on a force over the displacement or the velocity."""
    x, g, spring = curve[over].values, curve["force"].values, over == "displacement"
    unit, length = curve["force"].attrs["units"], curve[over].attrs["units"]
    lines, side = _symmetry(x, g, f"the {over}"), _one_sided(x, g)
    slope = np.gradient(g, x)
    if side and spring:
        return [*lines, f"It acts on one side only, at {side} displacements."]
    if spring:
        if any("even" in line and "neither" not in line for line in lines):
            return lines
        zone = _dead_zone(x, g, slope)
        if zone is not None:
            return [*lines, f"It has a dead zone from {zone[0]:.3g} to {zone[1]:.3g} {length}."]
    else:
        if side:
            lines.append(f"It acts in one direction only, at {side} velocities.")
        lines += _energy(curve)
        sizes = np.abs(g[np.abs(x) > 0.25 * np.max(np.abs(x))])
        turns = np.sign(g[x < 0][:1]) != np.sign(g[x > 0][-1:])
        if not side and turns.all() and np.ptp(sizes) < 0.3 * np.mean(sizes):
            told = f"as dry friction of {float(np.mean(sizes)):.3g} {unit}"
            return [*lines, f"It hardly depends on the speed, {told}."]
    # the slope about the middle of the range, and the mean slope at its ends
    share = (x - x[0]) / (x[-1] - x[0])
    middle = float(np.mean(slope[(share > 0.4) & (share < 0.6)]))
    ends = float(np.mean(np.concatenate([slope[share < 0.12], slope[share > 0.88]])))
    more, less, straight = _OF_SPRINGS if spring else _OF_DAMPERS
    if abs(ends) <= 0.2 * abs(middle):
        bend = "saturates"
    elif ends > 1.5 * middle and ends > 0:
        bend = more
    else:
        bend = less if ends < 0.67 * middle else straight
    per, where = (length, "the middle") if spring else (f"({length})", "rest")
    told = f"slope {middle:.3g} {unit}/{per} about {where} and {ends:.3g} at the ends"
    return [*lines, f"It {bend}: {told}."]


def _along_time(values: Array, unit: str) -> str:
    """Say how far a stiffness or damping goes along the record, and whether it turns back."""
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
        """Return a grid over each variable, within what was seen."""
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
        return _simplest_formula(self)

    def describe(self) -> str:
        """Say in words what the law resembles, with numbers.

        Returns
        -------
        str
            Several lines. The first says what it is a curve of, how far it was seen and how large
            it is.
        """
        curve, unit, formula = self.curve(), self.unit, self.formula()
        values, stderr = curve[self.quantity].values, curve["stderr"].values
        largest = float(np.max(np.abs(values)))
        ranges = " and ".join(
            f"{low:.3g} to {high:.3g} {curve[name].attrs['units']}"
            for name, (low, high) in self.seen.items()
        )
        lines = [
            f"{self.quantity.capitalize()} over {self.over} at {', '.join(self.effect.at)}, "
            f"seen from {ranges}: up to {largest:.3g} {unit}."
        ]
        if np.isfinite(stderr).all() and largest > 0:
            share = 100 * float(np.median(stderr)) / largest
            lines.append(
                f"Its standard error is {share:.2g} % of that in the middle of all points."
            )
        if largest > 0 and self.over == "time":
            lines.append(_along_time(values, unit))
        elif largest > 0:
            lines += _energy(curve) if len(self.seen) > 1 else _course(curve, self.over)
        found = f"The simplest formula within its band: {formula}."
        return "\n".join([*lines, found if formula else "No simple formula lies within its band."])

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
