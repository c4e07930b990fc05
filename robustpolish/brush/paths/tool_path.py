"""A path of the tool's centre in time, twice continuously differentiable."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import BSpline

from robustpolish.brush.paths import contours, patterns, points
from robustpolish.brush.paths.course import at_constant_speed
from robustpolish.brush.surfaces.polished_surface import Floats, PolishedSurface
from robustpolish.brush.surfaces.uniform_spline import coefficients
from robustpolish.validation import described, invalid, positive

if TYPE_CHECKING:
    from robustpolish.brush.surfaces.mould import Mould

Interval = tuple[float, float]


@dataclass(frozen=True, eq=False)
class ToolPath:
    r"""Where the tool's centre is over time: cubic splines through places at equal intervals.

    Made by `raster`, `spiral`, `contour_parallel`, `through` and `from_csv`. With `over`, the
    speed is that along the surface; without, that in the plane.

    Parameters
    ----------
    places : ndarray, shape (n, 2)
        x and y [m] at equal intervals of time.
    interval : float
        Between them [s].
    name : str
        What it is.

    Examples
    --------
    >>> import robustpolish as rp
    >>> path = rp.ToolPath.spiral((0.0, 0.0), 0.012, 0.003, speed=0.04)
    >>> path
    ToolPath(spiral, 150.3 mm in 3.76 s)
    >>> round(1e3 * float(path.position(0.0)[0]), 6), round(float(path.velocity(0.0)[1]), 3)
    (12.0, 0.04)
    >>> corner = rp.ToolPath.through([(0.0, 0.0), (0.01, 0.0), (0.01, 0.01)], speed=0.01)
    >>> round(corner.duration, 1)
    2.0
    >>> bowl = rp.Mould.from_formula("x**2 + y**2", x=(-0.03, 0.03), y=(-0.03, 0.03))
    >>> rp.ToolPath.contour_parallel(bowl, 0.004, margin=0.012, speed=0.04).name
    'contour-parallel'

    From a file:

    >>> import tempfile, pathlib
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "path.csv"
    >>> _ = file.write_text("x,y\n0,0\n10,0\n10,10\n")
    >>> round(rp.ToolPath.from_csv(file, unit="mm", speed=0.01).duration, 1)
    2.0
    """

    places: Floats = field(repr=False)
    interval: float
    name: str = "path"

    def __post_init__(self) -> None:
        object.__setattr__(self, "places", np.array(self.places, dtype=float))
        shape = self.places.shape
        if len(shape) != 2 or shape[1] != 2 or shape[0] < 4 or not np.isfinite(self.places).all():
            shown = described(f"shape {shape}, or numbers that are not finite")
            raise invalid("places", shown, "shape (n, 2) with n of at least 4", "Give x and y.")
        positive("interval", self.interval, "s")

    def __repr__(self) -> str:
        """Tell name, length and duration."""
        return f"ToolPath({self.name}, {1e3 * self.length:.1f} mm in {self.duration:.2f} s)"

    @classmethod
    def raster(
        cls,
        x: Interval,
        y: Interval,
        step: float,
        *,
        speed: float,
        over: PolishedSurface | None = None,
    ) -> ToolPath:
        """Return lines along x, one after the other along y, with round turns.

        Parameters
        ----------
        x, y : tuple of float
            From where to where the tool's centre goes [m].
        step : float
            Distance between lines [m], made smaller so that they fill `y`.
        speed : float
            In m/s.
        over : PolishedSurface, optional
            Along which the speed is meant.

        Returns
        -------
        ToolPath

        Examples
        --------
        >>> import robustpolish as rp
        >>> rp.ToolPath.raster((0.0, 0.02), (0.0, 0.006), 0.002, speed=0.04).name
        'raster'
        """
        spacing = positive("step", step, "m")
        corners = patterns.raster(x, y, spacing)
        return cls._along(corners, 0.2 * spacing, speed, over, "raster")

    @classmethod
    def spiral(
        cls,
        centre: tuple[float, float],
        radius: float,
        pitch: float,
        *,
        speed: float,
        over: PolishedSurface | None = None,
    ) -> ToolPath:
        """Return an Archimedean spiral from the outside in, counter-clockwise.

        Parameters
        ----------
        centre : tuple of float
            In m.
        radius : float
            Of the start [m]. It ends where a turn would have a radius of a third of the pitch.
        pitch : float
            Between turns [m].
        speed, over
            As in `raster`.

        Returns
        -------
        ToolPath
        """
        spacing, outer = positive("pitch", pitch, "m"), positive("radius", radius, "m")
        return cls._along(
            patterns.spiral(centre, outer, spacing), 0.02 * spacing, speed, over, "spiral"
        )

    @classmethod
    def contour_parallel(
        cls, mould: Mould, step: float, *, margin: float, speed: float
    ) -> ToolPath:
        """Return loops parallel to the edge of a mould, from the outside in.

        Parameters
        ----------
        mould : Mould
            The loops stay on it; the speed is that along it.
        step : float
            Distance between loops [m].
        margin : float
            Distance of the first loop from the edge [m]: at least the reach of the brush, which
            is ``BrushParameters().rim_distance``.
        speed : float
            In m/s.

        Returns
        -------
        ToolPath

        Raises
        ------
        InvalidInputError
            If no place of the mould is that far from its edge.
        """
        spacing = positive("step", step, "m")
        corners = contours.loops(
            mould.distance_to_edge, mould.area, spacing, positive("margin", margin, "m")
        )
        return cls._along(corners, 0.25 * spacing, speed, mould, "contour-parallel")

    @classmethod
    def through(
        cls,
        places: ArrayLike,
        *,
        speed: float,
        over: PolishedSurface | None = None,
        rounding: float | None = None,
    ) -> ToolPath:
        """Return the straight lines between places, with corners made round.

        Parameters
        ----------
        places : array_like, shape (n, 2)
            x and y [m] of the corners, at least 2.
        speed, over
            As in `raster`.
        rounding : float, optional
            Along how much of the path a corner is spread [m]; a fiftieth of the length.

        Returns
        -------
        ToolPath
        """
        corners = points.checked_places(places)
        length = float(np.sum(np.hypot(*np.diff(corners, axis=0).T)))
        spread = length / 50 if rounding is None else positive("rounding", rounding, "m")
        return cls._along(corners, spread, speed, over, "lines")

    @classmethod
    def from_csv(
        cls,
        path: str | Path,
        *,
        unit: points.Unit = "m",
        speed: float | None = None,
        over: PolishedSurface | None = None,
        max_bytes: float | None = None,
    ) -> ToolPath:
        """Return the path of a file.

        Parameters
        ----------
        path : str or Path
            A CSV file whose first row names its columns: x, y, and perhaps t in s.
        unit : {"m", "mm", "um"}
            Of x and y.
        speed : float, optional
            In m/s. Needed without a column t: then as in `through`. With one, the path goes
            smoothly through the places at their times.
        over : PolishedSurface, optional
            As in `raster`.
        max_bytes : float, optional
            Largest size of the file in bytes, 1e8 by default.

        Returns
        -------
        ToolPath

        Raises
        ------
        InvalidInputError
            If the file cannot be read as that, times do not rise, or the speed is told twice.
        """
        places, time = points.read_csv(path, unit, points.FILE.limited(max_bytes))
        name = Path(path).name
        if time is None:
            if speed is None:
                raise invalid("speed", None, "a speed, as the file has no column t", "Give it.")
            made = cls.through(places, speed=speed, over=over)
            return cls(made.places, made.interval, name)
        if speed is not None:
            shown = described(f"{speed:g} beside a column t")
            raise invalid("speed", shown, "the times of the file alone", "Leave it out.")
        even, interval = points.at_even_times(places, time)
        return cls(even, interval, name)

    @classmethod
    def _along(
        cls,
        corners: Floats,
        rounding: float,
        speed: float,
        over: PolishedSurface | None,
        name: str,
    ) -> ToolPath:
        places, interval = at_constant_speed(corners, rounding, positive("speed", speed), over)
        return cls(places, interval, name)

    @property
    def duration(self) -> float:
        """From its beginning to its end [s]."""
        return self.interval * (len(self.places) - 1)

    @property
    def length(self) -> float:
        """Length in the plane [m]."""
        return float(np.sum(np.hypot(*np.diff(self.places, axis=0).T)))

    def position(self, time: ArrayLike) -> Floats:
        """Return x and y [m], shape (2, ...), at times [s].

        Parameters
        ----------
        time : array_like
            From 0 to `duration`.

        Returns
        -------
        ndarray, shape (2, ...)
        """
        return self._at(time, 0)

    def velocity(self, time: ArrayLike) -> Floats:
        """Return the velocities along x and y [m/s], shape (2, ...), at times [s].

        Parameters
        ----------
        time : array_like
            From 0 to `duration`.

        Returns
        -------
        ndarray, shape (2, ...)
        """
        return self._at(time, 1)

    @cached_property
    def packed(self) -> Floats:
        """The path as the one array that compiled code reads: intervals per second, x, y."""
        found = coefficients(self.places)
        return np.concatenate([[1.0 / self.interval], found[:, 0], found[:, 1]])

    def _at(self, time: ArrayLike, derivative: int) -> Floats:
        moments = np.asarray(time, dtype=float)
        late = 1e-9 * self.interval
        if moments.size and not (moments.min() >= -late and moments.max() <= self.duration + late):
            shown = described(f"times from {moments.min():g} to {moments.max():g} s")
            raise invalid(
                "time", shown, f"from 0 to {self.duration:g} s, where the path is", "Stay on it."
            )
        knots = self.interval * np.arange(-3.0, len(self.places) + 3.0)
        found = BSpline(knots, coefficients(self.places), 3)(moments, nu=derivative)
        return np.moveaxis(found, -1, 0)
