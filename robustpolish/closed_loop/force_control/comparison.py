"""What each way to control the force takes off along a path."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from robustpolish.brush import BrushParameters, ToolPath, removal_of_force
from robustpolish.brush.surfaces.polished_surface import PolishedSurface
from robustpolish.closed_loop.force_control.controllers import ForceControl
from robustpolish.display import Card, Displayed, Table
from robustpolish.plotting import plot_over_plane, plot_time_series
from robustpolish.simulation import linear_response
from robustpolish.validation import described, invalid, one_of

_OUTPUTS = ("force_error", "tool", "gap", "push")


@dataclass(frozen=True, eq=False, repr=False)
class ForceComparison(Displayed):
    """Force and removal along a path, by the ways to control the force.

    Attributes
    ----------
    signals : xarray.Dataset
        `force` [N], `tool` [m] and `push` [N] over `control` and `time`, and `surface`, the
        deviation of the mould [m].
    table : xarray.Dataset
        By `control`: `force_error`, root mean square of F - F_p over F_p; `least` and `largest`
        force [N]; `touching`, the share of time with a force above 0; `removal_error`, root mean
        square of what was taken off too much or too little, over that of what was wanted; `push`,
        root mean square [N].
    removal : mapping of str to xarray.DataArray
        Depth taken off [m] over x and y; "wanted" is that of the constant polishing force.

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> import numpy as np
    >>> import robustpolish as rp
    >>> path = rp.ToolPath.through([(0.0, 0.0), (0.02, 0.0)], speed=0.02)
    >>> time = np.linspace(0.0, 1.0, 1001)
    >>> passive = rp.passive_stiffness(rp.PolishingAxis())
    >>> found = rp.compare_force_control([passive], path, 1e-3 * time, time)
    >>> print(found.explain().splitlines()[1][:18].strip())
    passive, 500 N/m
    >>> found.plot().get_xlabel(), found.plot_removal("wanted").get_xlabel()
    ('time [s]', 'x [mm]')
    >>> plt.close("all")
    """

    signals: xr.Dataset
    table: xr.Dataset
    removal: dict[str, xr.DataArray]

    def explain(self) -> str:
        """Return the table as text.

        Returns
        -------
        str
        """
        return str(self)

    def _card(self) -> Card:
        columns = ("control", "force error [%]", "least [N]", "largest [N]", "removal error [%]")
        rows = tuple(
            (
                str(name),
                100.0 * float(row.force_error),
                float(row.least),
                float(row.largest),
                100.0 * float(row.removal_error),
            )
            for name in self.table["control"].values
            for row in (self.table.sel(control=name),)
        )
        return Card("", (Table("", columns, rows),))

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the forces over time.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional

        Returns
        -------
        matplotlib.axes.Axes
        """
        forces = self.signals["force"]
        return plot_time_series(
            {str(name): forces.sel(control=name, drop=True) for name in forces["control"].values},
            ax,
        )

    def plot_removal(self, control: str, ax: Axes | None = None, *, error: bool = False) -> Axes:
        """Draw the map of what was taken off.

        Parameters
        ----------
        control : str
            Name of a control, or "wanted".
        ax : matplotlib.axes.Axes, optional
        error : bool
            Draw what was taken off too much instead.

        Returns
        -------
        matplotlib.axes.Axes
        """
        shown = self.removal[one_of("control", control, self.removal)]
        if error:
            shown = (shown - self.removal["wanted"]).rename("too much").assign_attrs(units="m")
        return plot_over_plane(shown, ax)


def height_deviation(
    actual: PolishedSurface, programmed: PolishedSurface | None, path: ToolPath, time: ArrayLike
) -> np.ndarray:
    """Return by how much a mould is higher than the robot believes, along a path.

    Parameters
    ----------
    actual : Surface or Mould
        What lies on the table.
    programmed : Surface or Mould, optional
        What the robot was told; without one it holds the height at which the path begins.
    path : ToolPath
    time : array_like, shape (n,)
        [s].

    Returns
    -------
    ndarray, shape (n,)
        [m], from where the tool touched down: 0 at first.

    Examples
    --------
    >>> import robustpolish as rp
    >>> path = rp.ToolPath.through([(0.0, 0.0), (0.01, 0.0)], speed=0.01)
    >>> tilted = rp.Mould.from_formula("0.01*x", x=(-0.02, 0.03), y=(-0.02, 0.02))
    >>> rp.height_deviation(tilted, rp.Surface.flat(), path, [0.0, 1.0]).round(9).tolist()
    [0.0, 0.0001]
    """
    x, y = path.position(time)
    heights = actual.height(x, y) - (0.0 if programmed is None else programmed.height(x, y))
    if not np.all(np.isfinite(heights)):
        shown = described("a path that leaves one of the surfaces")
        raise invalid("path", shown, "a path on both surfaces", "Move or shrink it.")
    return heights - heights[0]


def compare_force_control(
    controls: Sequence[ForceControl],
    path: ToolPath,
    deviation: ArrayLike,
    time: ArrayLike,
    *,
    force_noise: ArrayLike | None = None,
    preston: float = 1e-13,
    parameters: BrushParameters | None = None,
) -> ForceComparison:
    """Lead the tool along a path on a mould that is not where the robot believes it, and compare.

    Each loop is simulated exactly; the removal follows by Preston's law from its force, for a brush
    that lies flat (see :func:`robustpolish.removal_of_force`).

    Parameters
    ----------
    controls : sequence of ForceControl
        Such as `passive_stiffness`, `impedance_control`, `admittance_control` and
        `hinf_force_control` make; with one polishing force and names of their own.
    path : ToolPath
    deviation : array_like, shape (n,)
        Of the mould's height [m], as of `height_deviation`.
    time : array_like, shape (n,)
        Equally spaced, from 0 [s].
    force_noise : array_like, shape (n,), optional
        Of the measured force [N].
    preston : float
        Preston's coefficient [1/Pa].
    parameters : BrushParameters, optional
        Radius and spin of the brush.

    Returns
    -------
    ForceComparison

    Raises
    ------
    InvalidInputError
        If there is no control, if names or polishing forces do not suit each other, or if a
        signal does not have one number for each time.

    Examples
    --------
    >>> import numpy as np
    >>> import robustpolish as rp
    >>> axis = rp.PolishingAxis()
    >>> path = rp.ToolPath.through([(0.0, 0.0), (0.02, 0.0)], speed=0.02)
    >>> time = np.linspace(0.0, 1.0, 2001)
    >>> ways = [rp.passive_stiffness(axis), rp.hinf_force_control(axis)]
    >>> found = rp.compare_force_control(ways, path, 1e-3 * np.sin(2 * np.pi * time), time)
    >>> bool(found.table["removal_error"][1] < 0.5 * found.table["removal_error"][0])
    True
    """
    force = _same_force(controls)
    moments = np.asarray(time, dtype=float)
    columns = [
        np.zeros(moments.shape) if column is None else np.asarray(column, dtype=float)
        for column in (deviation, force_noise)
    ]
    for name, column in zip(("deviation", "force_noise"), columns, strict=True):
        if column.shape != moments.shape or not np.all(np.isfinite(column)):
            shown = described(f"shape {column.shape}, or numbers that are not finite")
            raise invalid(name, shown, f"shape {moments.shape}, as time", "Give one per time.")
    names = [item.name for item in controls]
    responses = []
    for item in controls:
        # The plant's mould follows its input with a lag, which is taken back here.
        lag = 1.0 / (2 * pi * item.axis.surface_bandwidth)
        ahead = columns[0] + lag * np.gradient(columns[0], moments)
        responses.append(
            linear_response(item.loop, moments, np.stack([ahead, columns[1]], 1)).outputs
        )
    found = dict(zip(_OUTPUTS, np.moveaxis(np.array(responses), -1, 0), strict=True))
    both = ("control", "time")
    signals = xr.Dataset(
        {
            "force": (both, force + found["force_error"], {"units": "N", "long_name": "force"}),
            "tool": (both, found["tool"], {"units": "m"}),
            "push": (both, found["push"], {"units": "N"}),
            "surface": ("time", columns[0], {"units": "m"}),
        },
        coords={"time": ("time", moments, {"units": "s"}), "control": names},
    )
    forces = {"wanted": np.full(moments.shape, force)}
    forces |= dict(zip(names, signals["force"].values, strict=True))
    maps = {
        name: removal_of_force(path, moments, pressed, parameters=parameters, preston=preston)
        for name, pressed in forces.items()
    }
    return ForceComparison(signals, _table(signals, maps, force), maps)


def _same_force(controls: Sequence[ForceControl]) -> float:
    names = [item.name for item in controls]
    if not names or len(set(names)) < len(names) or "wanted" in names:
        raise invalid("controls", names, "controls with names of their own", "Rename them.")
    forces = {item.axis.polishing_force for item in controls}
    if len(forces) > 1:
        shown = described(f"polishing forces {sorted(forces)} N")
        raise invalid("controls", shown, "one polishing force", "Design all for one axis.")
    return forces.pop()


def _table(signals: xr.Dataset, maps: dict[str, xr.DataArray], force: float) -> xr.Dataset:
    pressed = signals["force"]
    wanted = maps["wanted"].values
    missed = [
        float(np.linalg.norm(maps[str(name)].values - wanted) / np.linalg.norm(wanted))
        for name in signals["control"].values
    ]
    return xr.Dataset(
        {
            "force_error": ((pressed / force - 1) ** 2).mean("time") ** 0.5,
            "least": pressed.min("time").assign_attrs(units="N"),
            "largest": pressed.max("time").assign_attrs(units="N"),
            "touching": (pressed > 0).mean("time"),
            "removal_error": ("control", missed),
            "push": ((signals["push"] ** 2).mean("time") ** 0.5).assign_attrs(units="N"),
        }
    )
