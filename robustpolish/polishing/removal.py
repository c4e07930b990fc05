"""Material removal by Preston's law: depth per time is pressure times speed."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from robustpolish.base.checks import described, instance_of, invalid, positive
from robustpolish.plots.charts import plot_path_in_space
from robustpolish.polishing.contact import disc_axis
from robustpolish.polishing.parameters import BrushParameters
from robustpolish.polishing.surfaces.mould import Mould
from robustpolish.polishing.surfaces.surface import Floats, PolishedSurface
from robustpolish.polishing.tool_path import ToolPath

# Picture of a run in three dimensions.

_PLACES = 80


def plot_polishing(signals: xr.Dataset, surface: PolishedSurface, ax: Any = None) -> Any:
    """Draw a mould and the path of the tool on it, coloured by the contact force.

    Parameters
    ----------
    signals : xarray.Dataset
        A run of :func:`robustpolish.polishing.simulate_brush`.
    surface : Surface or Mould
        The one of that run.
    ax : mpl_toolkits.mplot3d.Axes3D, optional

    Returns
    -------
    mpl_toolkits.mplot3d.Axes3D

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> import robustpolish as rp
    >>> signals = rp.polishing.simulate_brush(duration=0.05)
    >>> rp.polishing.plot_polishing(signals, rp.polishing.Surface()).get_zlabel()
    'z [mm]'
    >>> plt.close("all")
    """
    if isinstance(surface, Mould):
        x, y = surface.x, surface.y
    else:
        reach = 1.2 * float(signals.attrs["radius"])
        x, y = (
            np.linspace(float(part.min()) - reach, float(part.max()) + reach, _PLACES)
            for part in (signals["tool_x"], signals["tool_y"])
        )
    heights = surface.height(x[:, None], y[None, :])
    ground = xr.DataArray(heights, {"x": x, "y": y}, ("x", "y"))
    place = tuple(signals[name] for name in ("tool_x", "tool_y", "surface_height"))
    normal = signals["F_z"]  # of the listing, which has no force normal to the rim
    if "contact_force" in signals:
        normal = signals["contact_force"].sum("point")
        normal = normal.assign_attrs(units="N", long_name="contact force")
    return plot_path_in_space(ground, place, normal, ax)


_RATE = 1000.0  # places of the tool per second: 0.04 mm apart at 40 mm/s
_NODES = 180  # of the rim
_RINGS = 6  # of the face


def removal_map(
    signals: xr.Dataset,
    surface: PolishedSurface,
    *,
    preston: float = 1e-13,
    cell: float = 5e-4,
) -> xr.DataArray:
    """Return the depth that a run of the brush takes off, over the surface.

    Preston's law (F. W. Preston, "The theory and design of plate glass polishing machines",
    J. Soc. Glass Technology 11 (1927)): depth per time is a coefficient times pressure times speed,
    so that volume is the coefficient times normal force times the way slipped. The contact force
    of every moment is spread over the rim as deep as it stands in the surface.

    Parameters
    ----------
    signals : xarray.Dataset
        A run of the physical simulator of :func:`robustpolish.polishing.simulate_brush`.
    surface : Surface or Mould
        The one of that run.
    preston : float
        Preston's coefficient [1/Pa]. Only its order is usual; measure yours. The map is
        proportional to it.
    cell : float
        Side of the cells of the map [m], in the plane.

    Returns
    -------
    xarray.DataArray
        Depth [m] over `x` and `y` [m]. Times the area of a cell its sum is the volume.

    Raises
    ------
    InvalidInputError
        If the signals are not of the physical simulator.

    Examples
    --------
    >>> import robustpolish as rp
    >>> signals = rp.polishing.simulate_brush(duration=0.05)
    >>> depth = rp.polishing.removal_map(signals, rp.polishing.Surface())
    >>> depth.dims, depth.attrs["units"]
    (('x', 'y'), 'm')
    """
    if not isinstance(signals, xr.Dataset) or signals.attrs.get("simulator") != "physical":
        shown = described(f"simulator {getattr(signals, 'attrs', {}).get('simulator')!r}")
        remedy = "Make it with simulate_brush(...)."
        raise invalid("signals", shown, "a run of the physical simulator", remedy)
    remedy = "Pass that of the run."
    instance_of("surface", surface, PolishedSurface, "a Surface or a Mould", remedy)
    time = signals["time"].values
    interval = float(time[1] - time[0])
    every = max(1, round(1.0 / (_RATE * interval)))
    moments = np.arange(every // 2, time.size, every)
    normal = signals["contact_force"].sum("point").values
    edges = np.append(moments - every // 2, time.size)
    shares = np.add.reduceat(normal, edges[:-1]) * interval  # N s
    x, y, depth, speed = _rim(signals.isel(time=moments), surface)
    weight = np.maximum(depth, 0.0)
    # Where an averaged force meets no depth at the middle of its time, the deepest node has it.
    nowhere = weight.sum(axis=1) == 0
    weight[nowhere, np.argmax(depth[nowhere], axis=1)] = 1.0
    weight *= (shares / weight.sum(axis=1))[:, None]
    return _collected(x, y, positive("preston", preston, "1/Pa") * weight * speed, cell)


def _rim(at: xr.Dataset, surface: PolishedSurface) -> tuple[Floats, Floats, Floats, Floats]:
    """Places, depth and slip speed of the rim's nodes over time, each of shape (time, nodes)."""
    axis = disc_axis(at["theta"].values, at["psi"].values, at.attrs["disc"] == "three-angle")
    kx, ky, kz = axis
    norm = np.sqrt(1.0 - kx**2)
    a = np.stack([norm, -kx * ky / norm, -kx * kz / norm])
    b = np.stack([np.zeros_like(kx), kz / norm, -ky / norm])
    angle = 2 * np.pi * (np.arange(_NODES) + 0.5) / _NODES
    across = a[:, :, None] * np.cos(angle) + b[:, :, None] * np.sin(angle)
    arm = at.attrs["radius"] * across - 0.5 * at.attrs["height"] * axis[:, :, None]
    tool = np.stack([at[f"tool_{name}"].values for name in "xyz"])
    place, moved = tool[:, :, None] + arm, np.gradient(tool, at["time"].values, axis=1)
    spin = at["omega_z"].values if "omega_z" in at else np.full(kx.shape, at.attrs["spin"])
    slip = moved[:, :, None] + spin[:, None] * np.cross(axis[:, :, None], arm, axis=0)
    depth = surface.height(place[0], place[1]) - place[2]
    return place[0], place[1], depth, np.sqrt(np.sum(slip**2, axis=0))


def removal_of_force(
    path: ToolPath,
    time: ArrayLike,
    force: ArrayLike,
    *,
    parameters: BrushParameters | None = None,
    preston: float = 1e-13,
    cell: float = 5e-4,
) -> xr.DataArray:
    """Return the depth that a brush takes off which lies flat and is pressed on by a given force.

    By Preston's law as in `removal_map`, with the pressure even over the face of the disc.

    Parameters
    ----------
    path : ToolPath
        Of the tool's centre.
    time : array_like, shape (n,)
        Equally spaced, on the path [s].
    force : array_like, shape (n,)
        Normal force [N]; where it would be negative nothing touches.
    parameters : BrushParameters, optional
        Radius and spin.
    preston, cell
        As in `removal_map`.

    Returns
    -------
    xarray.DataArray
        Depth [m] over `x` and `y` [m].

    Examples
    --------
    >>> import numpy as np
    >>> import robustpolish as rp
    >>> path = rp.polishing.ToolPath.spiral((0.0, 0.0), 0.012, 0.003, speed=0.04)
    >>> time = np.linspace(0.0, 1.0, 1001)
    >>> depth = rp.polishing.removal_of_force(path, time, np.full(time.size, 10.0))
    >>> round(float(depth.sum()) * 5e-4**2 / 1e-13, 1)  # 10 N times 1 s at 2/3 of the rim's speed
    20.9
    """
    brush = BrushParameters() if parameters is None else parameters
    moments = np.asarray(time, dtype=float)
    pressed = np.maximum(np.asarray(force, dtype=float), 0.0)
    if moments.ndim != 1 or moments.size < 2 or pressed.shape != moments.shape:
        shown = described(f"shapes {moments.shape} and {pressed.shape}")
        raise invalid("force", shown, "one number for each time", "Give as many of both.")
    every = max(1, round(1.0 / (_RATE * (moments[1] - moments[0]))))
    edges = np.arange(0, moments.size - 1, every)
    duration = np.diff(np.append(moments[edges], moments[-1]))
    sums = np.add.reduceat(pressed[:-1], edges)
    counts = np.diff(np.append(edges, moments.size - 1))
    middle = moments[edges] + 0.5 * duration
    centre, moved = path.position(middle), path.velocity(middle)
    # Rings of equal area at their mean radius, which has the mean speed; nodes even along each.
    edge = np.sqrt(np.arange(_RINGS + 1) / _RINGS)
    ring = brush.radius * 2 / 3 * np.diff(edge**3) * _RINGS
    angle = 2 * np.pi * (np.arange(_NODES // 4) + 0.5) / (_NODES // 4)
    spots = (ring[:, None] * np.stack([np.cos(angle), np.sin(angle)])[:, None, :]).reshape(2, -1)
    slip_x = moved[0][:, None] - brush.spin * spots[1]
    slip_y = moved[1][:, None] + brush.spin * spots[0]
    impulse = (sums / counts * duration)[:, None] / spots.shape[1]
    volume = positive("preston", preston, "1/Pa") * impulse * np.hypot(slip_x, slip_y)
    return _collected(centre[0][:, None] + spots[0], centre[1][:, None] + spots[1], volume, cell)


def _collected(x: Floats, y: Floats, volume: Floats, cell: float) -> xr.DataArray:
    """Add up volumes [m^3] in cells and return them as depths [m]."""
    side = positive("cell", cell, "m")
    columns, axes = [], {}
    for name, part in (("x", x), ("y", y)):
        low = np.floor(part.min() / side)
        columns.append(np.floor(part / side - low).astype(int))
        axes[name] = (name, side * (low + 0.5 + np.arange(columns[-1].max() + 1)), {"units": "m"})
    (i, j), shape = columns, tuple(len(axis) for _, axis, _ in axes.values())
    found = np.bincount((i * shape[1] + j).ravel(), volume.ravel(), shape[0] * shape[1])
    depth, attributes = found.reshape(shape) / side**2, {"units": "m"}
    attributes["long_name"] = "depth taken off"
    return xr.DataArray(depth, axes, ("x", "y"), "removal", attributes)
