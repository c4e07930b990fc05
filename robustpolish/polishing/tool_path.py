"""Tool paths: rasters, spirals, contour-parallel loops and files, as cubic splines in time."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import contourpy
import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import BSpline, CubicSpline
from scipy.ndimage import gaussian_filter1d

from robustpolish.base.checks import described, invalid, misfit, positive
from robustpolish.base.input_files import FileSpec
from robustpolish.base.jit import njit
from robustpolish.polishing.surfaces.importers import FILE, Unit, checked_side, csv_rows, scale_of
from robustpolish.polishing.surfaces.spline import cell, coefficients, slope_weights, weights
from robustpolish.polishing.surfaces.surface import Floats, PolishedSurface

if TYPE_CHECKING:
    from robustpolish.polishing.surfaces.mould import Mould


# Contour-parallel loops: lines of equal distance from an edge.

_GRID = 240  # places along the longer side
_SHORTEST = 3.0  # loops shorter than so many steps are left out


def loops(
    distance: Callable[[ArrayLike, ArrayLike], Floats],
    area: tuple[tuple[float, float], tuple[float, float]],
    step: float,
    margin: float,
) -> Floats:
    """Return loops at distances margin, margin + step, ... from the edge as one line, shape (n, 2).

    Each loop begins where it is next to the end of the one before. Where the area inside falls
    into parts, the nearest one is next.
    """
    spacing = max(high - low for low, high in area) / _GRID
    x, y = (np.linspace(low, high, max(8, round((high - low) / spacing)) + 1) for low, high in area)
    far = distance(x[:, None], y[None, :])
    deepest = float(np.max(far))
    if not deepest > margin:
        shown = described(f"{margin:g} m, but no place is more than {deepest:.3g} m from the edge")
        raise invalid("margin", shown, "less than that", "Take a smaller brush or a larger mould.")
    line = np.empty((0, 2))
    drawn = contourpy.contour_generator(x, y, far.T)
    for level in np.arange(margin, deepest, step):
        found = [np.array(part) for part in drawn.lines(level)]
        left = [
            part[:-1]
            for part in found
            if _lengths(part)[-1] > _SHORTEST * step and np.allclose(part[0], part[-1])
        ]
        while left:
            end = line[-1:] if len(line) else left[0][:1]
            gaps = [np.hypot(*(part - end).T) for part in left]
            nearest = int(np.argmin([gap.min() for gap in gaps]))
            turned = np.roll(left.pop(nearest), -int(np.argmin(gaps[nearest])), axis=0)
            line = np.concatenate([line, turned, turned[:1]])
    if len(line) < 4:
        shown = described(f"{step:g} m, with no loop longer than {_SHORTEST:g} steps")
        raise invalid("step", shown, "steps smaller than the mould", "Lower step or margin.")
    return line


# Rounding of corners, and parametrisation by constant speed.

_PER_ROUNDING = 4  # places of the spline per length of a rounding
_FINE = 4  # finer than that before rounding
_MOST = 200_000


def at_constant_speed(
    corners: Floats, rounding: float, speed: float, over: PolishedSurface | None
) -> tuple[Floats, float]:
    """Return places at equal times along a rounded line, shape (n, 2), and the interval [s].

    Corners are rounded by a Gaussian mean along the line whose standard deviation is half the
    rounding; the ends stay where they are.

    Parameters
    ----------
    corners : ndarray, shape (n, 2)
        [m].
    rounding : float
        [m].
    speed : float
        [m/s], along the surface `over`, or in the plane without one.
    over : PolishedSurface or None
    """
    length = float(_lengths(corners)[-1])
    step = rounding / _PER_ROUNDING / _FINE
    count = int(np.ceil(length / step)) + 1
    if not length > 0 or count > _FINE * _MOST:
        shown = described(f"a length of {length:g} m with {rounding:g} m between turns")
        raise invalid("step", shown, f"at most {_MOST} places", "Take larger steps.")
    fine = _evenly(corners, _lengths(corners), max(count, 64))
    width = 0.5 * rounding * (len(fine) - 1) / length
    # Mirrored through its end points, a line keeps them, and its direction there.
    before, after = 2 * fine[0] - fine[:0:-1], 2 * fine[-1] - fine[-2::-1]
    rounded = gaussian_filter1d(np.concatenate([before, fine, after]), width, axis=0)
    rounded = rounded[len(fine) - 1 : 2 * len(fine) - 1]
    far = _lengths(rounded, over)
    places = _evenly(rounded, far, max(len(fine) // _FINE, 16))
    return places, float(far[-1]) / speed / (len(places) - 1)


def _lengths(places: Floats, over: PolishedSurface | None = None) -> Floats:
    """Length of the line up to each place [m], shape (n,)."""
    steps = np.hypot(*np.diff(places, axis=0).T)
    if over is not None:
        rise = np.diff(over.height(places[:, 0], places[:, 1]))
        outside = np.flatnonzero(~np.isfinite(rise))
        if outside.size:
            x, y = 1e3 * places[outside[0]]
            shown = described(f"a path that leaves the surface near x = {x:.4g} mm, y = {y:.4g} mm")
            raise invalid("over", shown, "a surface below all of the path", "Move the path.")
        steps = np.hypot(steps, rise)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _evenly(places: Floats, far: Floats, count: int) -> Floats:
    """Return places at equal distances along a line of straight pieces."""
    wanted = np.linspace(0.0, far[-1], count)
    return np.stack([np.interp(wanted, far, column) for column in places.T], axis=1)


# Evaluation in compiled code: intervals per second, then the coefficients of x and of y.


@njit(cache=True)
def evaluate_path(time, packed, place, velocity):  # pragma: no cover - compiled
    """Write the horizontal place [m] and velocity [m/s] at a time [s]."""
    count = (packed.size - 1) // 2
    number, fraction = cell(time, 0.0, packed[0], count)
    share, rate = weights(fraction), slope_weights(fraction)
    for axis in range(2):
        first = 1 + axis * count + number
        here = moving = 0.0
        for i in range(4):
            here += share[i] * packed[first + i]
            moving += rate[i] * packed[first + i]
        place[axis] = here
        velocity[axis] = moving * packed[0]


# Input of paths: checks, CSV files, and resampling at even times.

_FINER = 4  # times per shortest interval of a file
_MOST_POINTS = 400_000


def checked_places(places: ArrayLike) -> Floats:
    """Return corners of a path, shape (n, 2), without repetitions."""
    corners = np.array(places, dtype=float)
    if corners.ndim != 2 or corners.shape[1] != 2 or not np.all(np.isfinite(corners)):
        shown = described(f"shape {corners.shape}, or numbers that are not finite")
        raise invalid("places", shown, "finite x and y, shape (n, 2)", "Correct them.")
    moved = np.concatenate([[True], np.any(np.diff(corners, axis=0) != 0, axis=1)])
    if np.sum(moved) < 2:
        raise invalid("places", described("a single place"), "at least two", "Give more.")
    return corners[moved]


def read_csv(path: str | Path, unit: str, file: FileSpec = FILE) -> tuple[Floats, Floats | None]:
    """Return x and y [m], shape (n, 2), and the times [s] if the file has a column t."""
    rows = csv_rows(path, file, csv.DictReader, skipinitialspace=True)
    path = Path(path)
    names = {(name or "").strip().lower(): name for name in (rows[0] if rows else {})}
    if not {"x", "y"} <= set(names):
        shown = f"columns {', '.join(names) or 'none'} in {path.name}"
        raise misfit("path", shown, "columns x and y, and perhaps t", "Name them in its first row.")
    wanted = [names[key] for key in ("x", "y", "t") if key in names]
    try:
        table = np.array([[float(row[name]) for name in wanted] for row in rows])
    except (TypeError, ValueError) as error:
        shown = described(f"{path.name} ({error})")
        raise invalid("path", shown, "numbers in every row", "Correct the file.") from None
    places = scale_of(unit) * table[:, :2]
    return (places, table[:, 2]) if "t" in names else (checked_places(places), None)


def at_even_times(places: Floats, time: Floats) -> tuple[Floats, float]:
    """Return a smooth path through places at their times, at even times, and the interval [s]."""
    steps = np.diff(time)
    if len(time) < 4 or not np.isfinite(places).all() or not np.all(steps > 0):
        shown = described("times that do not rise, numbers missing, or fewer than 4 places")
        raise invalid("path", shown, "rising times with a place each", "Correct the file.")
    with np.errstate(over="ignore"):
        shortest = (time[-1] - time[0]) / steps.min()
    if not shortest * _FINER < _MOST_POINTS:
        shown = described(f"times between {steps.min():g} and {steps.max():g} s apart")
        raise invalid("path", shown, "times of about equal distance", "Resample the path.")
    even = np.linspace(time[0], time[-1], int(np.ceil(shortest)) * _FINER + 1)
    return CubicSpline(time, places)(even), float(even[1] - even[0])


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
    >>> path = rp.polishing.ToolPath.spiral((0.0, 0.0), 0.012, 0.003, speed=0.04)
    >>> path
    ToolPath(spiral, 150.3 mm in 3.76 s)
    >>> round(1e3 * float(path.position(0.0)[0]), 6), round(float(path.velocity(0.0)[1]), 3)
    (12.0, 0.04)
    >>> corner = rp.polishing.ToolPath.through([(0.0, 0.0), (0.01, 0.0), (0.01, 0.01)], speed=0.01)
    >>> round(corner.duration, 1)
    2.0
    >>> bowl = rp.polishing.Mould.from_formula("x**2 + y**2", x=(-0.03, 0.03), y=(-0.03, 0.03))
    >>> rp.polishing.ToolPath.contour_parallel(bowl, 0.004, margin=0.012, speed=0.04).name
    'contour-parallel'

    From a file:

    >>> import tempfile, pathlib
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "path.csv"
    >>> _ = file.write_text("x,y\n0,0\n10,0\n10,10\n")
    >>> round(rp.polishing.ToolPath.from_csv(file, unit="mm", speed=0.01).duration, 1)
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
        x: tuple[float, float],
        y: tuple[float, float],
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
        >>> rp.polishing.ToolPath.raster((0.0, 0.02), (0.0, 0.006), 0.002, speed=0.04).name
        'raster'
        """
        spacing = positive("step", step, "m")
        x, y = checked_side("x", x), checked_side("y", y)
        count = int(np.ceil((y[1] - y[0]) / spacing * (1 - 1e-9))) + 1
        along = np.where(np.arange(count)[:, None] % 2 == 0, [x], [x[::-1]])  # to and fro
        corners = np.stack([along.ravel(), np.repeat(np.linspace(y[0], y[1], count), 2)], axis=1)
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
        middle = np.asarray(centre, dtype=float)
        if middle.shape != (2,) or not np.all(np.isfinite(middle)):
            raise invalid("centre", centre, "x and y [m]", "Give two numbers.")
        end = spacing / 3
        if outer <= 2 * end:
            shown = described(f"{spacing:g} m at a radius of {outer:g} m")
            raise invalid("pitch", shown, "less than 1.5 times the radius", "Lower it.")
        count = max(200, int(720 * outer / spacing))
        angle = np.linspace(0.0, 2 * np.pi * (outer - end) / spacing, count)
        far = outer - spacing * angle / (2 * np.pi)
        corners = middle + np.stack([far * np.cos(angle), far * np.sin(angle)], axis=1)
        return cls._along(corners, 0.02 * spacing, speed, over, "spiral")

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
        spacing, reach = positive("step", step, "m"), positive("margin", margin, "m")
        corners = loops(mould.distance_to_edge, mould.area, spacing, reach)
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
        corners = checked_places(places)
        length = float(np.sum(np.hypot(*np.diff(corners, axis=0).T)))
        spread = length / 50 if rounding is None else positive("rounding", rounding, "m")
        return cls._along(corners, spread, speed, over, "lines")

    @classmethod
    def from_csv(
        cls,
        path: str | Path,
        *,
        unit: Unit = "m",
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
        places, time = read_csv(path, unit, FILE.limited(max_bytes))
        name = Path(path).name
        if time is None:
            if speed is None:
                raise invalid("speed", None, "a speed, as the file has no column t", "Give it.")
            made = cls.through(places, speed=speed, over=over)
            return cls(made.places, made.interval, name)
        if speed is not None:
            shown = described(f"{speed:g} beside a column t")
            raise invalid("speed", shown, "the times of the file alone", "Leave it out.")
        even, interval = at_even_times(places, time)
        return cls(even, interval, name)

    @classmethod
    def _along(
        cls, corners: Floats, rounding: float, speed: float, over: Any, name: str
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
        moments, late = np.asarray(time, dtype=float), 1e-9 * self.interval
        if moments.size and not (moments.min() >= -late and moments.max() <= self.duration + late):
            shown, remedy = f"times from {moments.min():g} to {moments.max():g} s", "Stay on it."
            raise misfit("time", shown, f"from 0 to {self.duration:g} s, where the path is", remedy)
        knots = self.interval * np.arange(-3.0, len(self.places) + 3.0)
        found = BSpline(knots, coefficients(self.places), 3)(moments, nu=derivative)
        return np.moveaxis(found, -1, 0)
