"""Mould of any shape as a tensor-product cubic spline over a grid."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import distance_transform_edt

from robustpolish.base.checks import described, invalid, positive
from robustpolish.polishing.surfaces import importers
from robustpolish.polishing.surfaces.importers import Unit
from robustpolish.polishing.surfaces.spline import coefficients, expansions, pack
from robustpolish.polishing.surfaces.surface import Floats, PolishedSurface


@dataclass(frozen=True, eq=False)
class Mould(PolishedSurface):
    r"""A mould as a height f(x, y), twice continuously differentiable, over a grid.

    The height is a cubic spline along x and y. Its slopes and second derivatives are those of the
    spline, without differences, and they are what the simulators see. Made by `from_array`,
    `from_csv`, `from_stl` and `from_formula`.

    Parameters
    ----------
    x, y : ndarray, shape (n,), (m,)
        Equally spaced places of the grid [m].
    coefficients : ndarray, shape (n + 2, m + 2)
        Of the cubic B-splines [m].
    inside : ndarray of bool, shape (n, m)
        Where there is a mould; outside, the height is only a smooth continuation.
    name : str
        What it was made of.
    error : float
        Largest distance [m] between the spline and what it was made of, at its vertices for a mesh.

    Examples
    --------
    >>> import robustpolish as rp
    >>> bowl = rp.polishing.Mould.from_formula("x**2 / 0.1", x=(-0.04, 0.04), y=(-0.03, 0.03))
    >>> round(1e3 * float(bowl.height(0.02, 0.0)), 6)
    4.0
    >>> slopes, bends = bowl.gradient(0.02, 0.0), bowl.bends(0.02, 0.0)
    >>> round(float(slopes[0]), 6), round(float(bends[0]), 6)
    (0.4, 20.0)
    >>> round(float(bowl.distance_to_edge(0.03, 0.0)), 6)
    0.01

    From files:

    >>> import tempfile, pathlib, trimesh
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "grid.csv"
    >>> _ = file.write_text("x/y,0,1,2,3\n0,0,0,0,0\n1,1,1,1,1\n2,2,2,2,2\n3,3,3,3,3\n")
    >>> round(1e3 * float(rp.polishing.Mould.from_csv(file, unit="mm").height(1.5e-3, 1e-3)), 6)
    1.5
    >>> square = [[0, 0, 0], [9, 0, 0], [9, 9, 3], [0, 9, 3]]
    >>> sheet = trimesh.Trimesh(square, [[0, 1, 2], [0, 2, 3]])
    >>> _ = sheet.export(file.with_suffix(".stl"))
    >>> slope = rp.polishing.Mould.from_stl(file.with_suffix(".stl"), unit="mm")
    >>> round(1e3 * float(slope.height(3e-3, 6e-3)), 3)
    2.0
    """

    x: Floats = field(repr=False)
    y: Floats = field(repr=False)
    coefficients: Floats = field(repr=False)
    inside: Any = field(repr=False)
    name: str = "mould"
    error: float = 0.0

    def __repr__(self) -> str:
        """Tell what it was made of, and its size."""
        (west, east), (south, north) = self.area
        return f"Mould({self.name}, {1e3 * (east - west):.4g} x {1e3 * (north - south):.4g} mm)"

    @classmethod
    def from_array(
        cls, heights: ArrayLike, x: ArrayLike, y: ArrayLike, *, unit: Unit = "m"
    ) -> Mould:
        """Return the mould through a map of heights.

        Parameters
        ----------
        heights : array_like, shape (n, m)
            ``heights[i, j]`` stands at ``x[i]``, ``y[j]``.
        x, y : array_like, shape (n,), (m,)
            Rising and equally spaced; at least 4 each.
        unit : {"m", "mm", "um"}
            Of all three.

        Returns
        -------
        Mould

        Raises
        ------
        InvalidInputError
            If shapes do not match, places are not equally spaced, or a height is missing.

        Examples
        --------
        >>> import numpy as np
        >>> import robustpolish as rp
        >>> x, y = np.linspace(0, 40, 21), np.linspace(0, 30, 16)
        >>> mould = rp.polishing.Mould.from_array(0.01 * x[:, None] ** 2 + 0 * y, x, y, unit="mm")
        >>> round(float(mould.gradient(0.010, 0.010)[0]), 9)
        0.2
        """
        scale = importers.scale_of(unit)
        places, others, found = importers.checked(heights, x, y)
        return cls._through(scale * found, scale * places, scale * others, "a map of heights")

    @classmethod
    def from_csv(
        cls,
        path: str | Path,
        *,
        unit: Unit = "m",
        spacing: float | None = None,
        max_bytes: float | None = None,
    ) -> Mould:
        """Return the mould of a grid of heights in a file.

        Parameters
        ----------
        path : str or Path
            A CSV file. Its first row holds the places along y, after an empty or named first
            cell, and its first column those along x. With `spacing`, heights alone.
        unit : {"m", "mm", "um"}
            Of everything in the file, and of `spacing`.
        spacing : float, optional
            Distance of rows, and of columns, of a file with heights alone.
        max_bytes : float, optional
            Largest size of the file in bytes, 1e8 by default.

        Returns
        -------
        Mould

        Raises
        ------
        InvalidInputError
            If the file cannot be read as that, or as in `from_array`.
        """
        scale = importers.scale_of(unit)
        wanted = importers.FILE.limited(max_bytes)
        places, others, found = importers.checked(*importers.read_csv(path, spacing, wanted))
        return cls._through(scale * found, scale * places, scale * others, Path(path).name)

    @classmethod
    def from_stl(
        cls,
        path: str | Path,
        *,
        unit: Unit,
        spacing: float | None = None,
        max_bytes: float | None = None,
    ) -> Mould:
        """Return the smooth mould through the vertices of a mesh.

        Vertices of a mesh lie on the surface, its flat faces do not: the spline of least bending
        goes through the vertices, and follows the faces only where no vertex is near.

        Parameters
        ----------
        path : str or Path
            An STL file, or a mesh in OBJ, OFF or PLY; seen from above, z up.
        unit : {"m", "mm", "um"}
            Of the file, which does not say it.
        spacing : float, optional
            Of the grid, in the unit of the file; about as far as vertices are apart.
        max_bytes : float, optional
            Largest size of the file in bytes, 1e8 by default.

        Returns
        -------
        Mould

        Raises
        ------
        InvalidInputError
            If the mesh has holes, steep or overhanging faces, coordinates that are not finite,
            several pieces, or if no smooth surface comes near its vertices.
        """
        scale = importers.scale_of(unit)
        shape = importers.read_mesh(path, scale, importers.FILE.limited(max_bytes))
        step = None if spacing is None else scale * positive("spacing", spacing, unit)
        x, y, faces = importers.covered(shape, step)
        found, error = importers.fitted(shape, x, y, faces)
        rise = float(np.ptp(shape.vertices[:, 2]))
        if error > max(0.02 * rise, 1e-6):
            shown = described(f"vertices up to {error:.2g} m away from a smooth surface")
            raise invalid(
                "path", shown, f"at most {max(0.02 * rise, 1e-6):.2g} m (2 % of its height)",
                "Give a smaller spacing, or a mesh without steps and sharp edges.",
            )  # fmt: skip
        return cls(x, y, found, np.isfinite(faces), Path(path).name, error)

    @classmethod
    def from_formula(
        cls,
        text: str,
        *,
        x: tuple[float, float],
        y: tuple[float, float],
        parameters: Mapping[str, float] | None = None,
    ) -> Mould:
        """Return the mould of a formula; it is read, and never executed.

        Parameters
        ----------
        text : str
            The height in m as an expression of x and y in m, such as
            ``"0.5*x**2/R + 1e-4*sin(k*y)"``, of smooth functions: sin, cos, tan, exp, log, sqrt,
            tanh, arctan.
        x, y : tuple of float
            From where to where [m].
        parameters : mapping of str to float, optional
            Values of other names.

        Returns
        -------
        Mould
            On a grid so fine that between its places the spline keeps to the formula within 1 nm;
            `error` says how closely.

        Raises
        ------
        InvalidInputError
            If the formula cannot be read, is not finite everywhere, or not smooth.
        """
        places, others, heights, error = importers.sampled(text, x, y, parameters or {})
        return cls._through(heights, places, others, text, error)

    @classmethod
    def _through(
        cls, heights: Floats, x: Floats, y: Floats, name: str, error: float = 0.0
    ) -> Mould:
        found = coefficients(coefficients(heights).T).T
        return cls(x, y, found, np.ones(heights.shape, dtype=bool), name, error)

    @cached_property
    def packed(self) -> Floats:  # pyright: ignore[reportIncompatibleMethodOverride]
        """The mould as the one array that compiled code reads."""
        return pack(self.x, self.y, self.coefficients)

    @cached_property
    def sharpest_bend(self) -> float:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Largest second derivative of the height in any direction on the mould [1/m]."""
        r, s, t = self.bends(self.x[:, None], self.y[None, :])
        return max(0.0, float(np.nanmax(0.5 * (r + t) + np.hypot(0.5 * (r - t), s))))

    @property
    def area(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """From where to where the grid goes along x and along y [m]."""
        return (float(self.x[0]), float(self.x[-1])), (float(self.y[0]), float(self.y[-1]))

    def height(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """Height f(x, y) [m]; nan outside the mould.

        Parameters
        ----------
        x, y : array_like
            In m, broadcast together.

        Returns
        -------
        ndarray
        """
        return self._evaluate(x, y)[0]

    def gradient(self, x: ArrayLike, y: ArrayLike) -> tuple[Floats, Floats]:
        """Slopes df/dx and df/dy [-] of the spline, exact; nan outside the mould.

        Parameters
        ----------
        x, y : array_like
            In m, broadcast together.

        Returns
        -------
        tuple of ndarray
        """
        found = self._evaluate(x, y)
        return found[1], found[2]

    def bends(self, x: ArrayLike, y: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Second derivatives f_xx, f_xy, f_yy [1/m] of the spline, exact; nan outside the mould.

        Parameters
        ----------
        x, y : array_like
            In m, broadcast together.

        Returns
        -------
        tuple of ndarray
        """
        found = self._evaluate(x, y)
        return found[3], found[4], found[5]

    def distance_to_edge(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """Horizontal distance [m] to where the mould ends, at least; below 0 outside.

        Parameters
        ----------
        x, y : array_like
            In m, broadcast together.

        Returns
        -------
        ndarray
            Exact for a rectangle; up to two cells too small for others.
        """
        one, other = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
        (west, east), (south, north) = self.area
        least = np.minimum.reduce([one - west, east - one, other - south, north - other])
        if not self.inside.all():
            step = self.x[1] - self.x[0], self.y[1] - self.y[0]
            column = np.clip(np.rint((one - west) / step[0]), 0, self.x.size - 1).astype(int)
            row = np.clip(np.rint((other - south) / step[1]), 0, self.y.size - 1).astype(int)
            to_hole = self._to_outside[column, row] - 1.5 * np.hypot(*step)
            least = np.minimum(least, to_hole)
        return least

    @cached_property
    def _to_outside(self) -> Floats:
        step = self.x[1] - self.x[0], self.y[1] - self.y[0]
        return np.asarray(distance_transform_edt(self.inside, sampling=step))

    def _evaluate(self, x: ArrayLike, y: ArrayLike) -> Floats:
        one, other = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
        found = expansions(one.ravel(), other.ravel(), self.packed).reshape(6, *one.shape)
        return np.where(self._holds(one, other), found, np.nan)

    def _holds(self, x: Floats, y: Floats) -> Any:
        """Whether places lie in a cell with four corners on the mould."""
        (west, east), (south, north) = self.area
        spare = 1e-9 * (east - west + north - south)
        within = (x >= west - spare) & (x <= east + spare)
        within &= (y >= south - spare) & (y <= north + spare)
        if self.inside.all():
            return within
        i = np.clip((x - west) / (self.x[1] - self.x[0]), 0, self.x.size - 2)
        j = np.clip((y - south) / (self.y[1] - self.y[0]), 0, self.y.size - 2)
        i, j = (np.nan_to_num(part).astype(int) for part in (i, j))
        corners = self.inside[i, j] & self.inside[i + 1, j]
        return within & corners & self.inside[i, j + 1] & self.inside[i + 1, j + 1]
