"""Where a brush does not go into a mould: curvature against the brush's radius."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from robustpolish.brush.parameters import BrushParameters
from robustpolish.brush.paths.tool_path import ToolPath
from robustpolish.brush.surfaces.mould import Mould
from robustpolish.brush.surfaces.polished_surface import Floats
from robustpolish.plotting import plot_over_plane
from robustpolish.validation import instance_of, positive

_PLACES = 200  # along each side, at least


@dataclass(frozen=True, eq=False)
class BrushFit:
    """Where a disc of a radius fits into a mould.

    Attributes
    ----------
    radius : float
        Of the disc [m].
    curvature : xarray.DataArray
        Largest curvature [1/m] over `x` and `y` [m]; nan where there is no mould. The disc fits
        where it is below 1 / radius.
    sharpest : tuple of float
        x, y [m] and radius of curvature [m] of the sharpest hollow; of those on the path, if one
        was given.
    share_too_narrow, share_bulging : float
        Of the mould, or of the path: where the hollow is narrower than the disc, and where the
        mould bulges in all directions, so that the disc touches with its face.

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> import robustpolish as rp
    >>> bowl = rp.Mould.from_formula("10*x**2 + 10*y**2", x=(-0.03, 0.03), y=(-0.03, 0.03))
    >>> fit = rp.check_brush_fit(bowl, 0.010)
    >>> fit.explain()
    'A disc of 10 mm fits everywhere: the sharpest hollow has 50 mm, at x = 0 mm, y = 0 mm.'
    >>> fit.plot().get_xlabel()
    'x [mm]'
    >>> plt.close("all")
    """

    radius: float
    curvature: xr.DataArray = field(repr=False)
    sharpest: tuple[float, float, float]
    share_too_narrow: float
    share_bulging: float

    @property
    def fits(self) -> bool:
        """Whether the disc fits everywhere, whether it touches with its rim or its face."""
        return self.share_too_narrow == 0

    def explain(self) -> str:
        """Tell in words where the disc does not fit.

        Returns
        -------
        str
        """
        x, y, sharpest = self.sharpest
        where = f"x = {round(1e3 * x, 3):g} mm, y = {round(1e3 * y, 3):g} mm"
        words = (
            f"A disc of {1e3 * self.radius:.4g} mm "
            + ("fits everywhere" if self.fits else f"does not fit at {self.share_too_narrow:.1%}")
            + f": the sharpest hollow has {1e3 * sharpest:.4g} mm, at {where}."
        )
        if self.share_bulging:
            words += (
                f" At {self.share_bulging:.1%} the mould bulges in all directions; there the disc "
                "touches with its face, which the simulator refuses."
            )
        return words

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw radius times largest curvature over the mould; from 1 on the disc does not fit.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional

        Returns
        -------
        matplotlib.axes.Axes
        """
        shown = (self.radius * self.curvature).rename("radius x curvature")
        return plot_over_plane(shown.assign_attrs(units="1"), ax, level=1.0)


def check_brush_fit(
    mould: Mould, radius: float | None = None, path: ToolPath | None = None
) -> BrushFit:
    """Compare the curvature of a mould with the radius of a brush, and say where it does not fit.

    Parameters
    ----------
    mould : Mould
    radius : float, optional
        Of the disc [m]; that of ``BrushParameters()``.
    path : ToolPath, optional
        Judge only what its disc passes over. Without one the whole mould.

    Returns
    -------
    BrushFit

    Examples
    --------
    >>> import robustpolish as rp
    >>> groove = rp.Mould.from_formula("40*y**2", x=(-0.03, 0.03), y=(-0.02, 0.02))
    >>> fit = rp.check_brush_fit(groove, 0.010)
    >>> fit.fits, round(1e3 * fit.sharpest[2], 3)
    (True, 12.5)
    >>> print(rp.check_brush_fit(groove, 0.020).explain().split(":")[0])
    A disc of 20 mm does not fit at 37.6%
    """
    instance_of("mould", mould, Mould, "a Mould", "Make one with Mould.from_stl(...) or the like.")
    reach = BrushParameters().radius if radius is None else positive("radius", radius, "m")
    x, y = _finer(mould.x), _finer(mould.y)
    largest, _ = mould.principal_curvatures(x[:, None], y[None, :])
    judged = np.isfinite(largest)
    if path is not None:
        judged &= _near(x, y, path, reach)
    found = np.where(judged, largest, -np.inf)
    i, j = np.unravel_index(int(np.argmax(found)), found.shape)
    sharpest = 1.0 / found[i, j] if found[i, j] > 0 else np.inf
    count = int(judged.sum())
    axes = {"x": ("x", x, {"units": "m"}), "y": ("y", y, {"units": "m"})}
    flat = 1e-9 + 1e-6 / reach  # a plane is no bulge, though rounding bends it
    return BrushFit(
        radius=reach,
        curvature=xr.DataArray(largest, axes, ("x", "y"), "curvature", {"units": "1/m"}),
        sharpest=(float(x[i]), float(y[j]), float(sharpest)),
        share_too_narrow=float(np.sum(found * reach >= 1.0)) / count,
        share_bulging=float(np.sum(judged & (largest < -flat))) / count,
    )


def _finer(axis: Floats) -> Floats:
    """Return a grid so fine that nothing sharp hides between its places."""
    parts = int(np.ceil(_PLACES / (axis.size - 1)))
    return np.linspace(axis[0], axis[-1], parts * (axis.size - 1) + 1)


def _near(x: Floats, y: Floats, path: ToolPath, reach: float) -> np.ndarray:
    """Which places of the grid a disc on the path passes over."""
    steps = max(2, int(8 * path.length / reach))
    near = np.zeros((x.size, y.size), dtype=bool)
    for here in path.position(np.linspace(0.0, path.duration, steps)).T:
        near |= np.hypot(x[:, None] - here[0], y[None, :] - here[1]) <= reach
    return near
