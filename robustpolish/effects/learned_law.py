"""A learned law to look at: its curve, how well it is known, in words and as a formula."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from robustpolish.arrays import Array
from robustpolish.display import Card, Displayed, quantities
from robustpolish.effects.effect import Effect
from robustpolish.effects.formula import Curve, Formula, simplest
from robustpolish.effects.learned import between_knots, coefficients_of, spline_basis
from robustpolish.effects.learned_words import in_words
from robustpolish.plotting import plot_force_curve, plot_surface
from robustpolish.validation import invalid

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
    >>> law = rp.LearnedLaw(Effect("learned_stiffness_7", "x", knots | line))
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
            swings = between_knots(coefficients_of(self.effect.values)).ravel() @ np.abs(basis)
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
        return simplest(curve, self.over, units)

    def describe(self) -> str:
        """Say in words what the law resembles, with numbers.

        Returns
        -------
        str
            Several lines.
        """
        return in_words(self.curve(), ", ".join(self.effect.at), self.formula())

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
