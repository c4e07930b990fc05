"""Force control of polishing by four ways, and the material that a force removes (Preston)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import pi, sqrt
from typing import Any

import control
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from robustpolish.base.arrays import Vector
from robustpolish.base.checks import described, instance_of, invalid, one_of, positive
from robustpolish.base.results import Card, Displayed, Table
from robustpolish.linear.response import linear_response
from robustpolish.linear.stability import stability
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.plots.charts import plot_over_plane, plot_path_in_space
from robustpolish.plots.time import plot_time_series
from robustpolish.polishing.contact import disc_axis
from robustpolish.polishing.parameters import BrushParameters
from robustpolish.polishing.quantities import check_quantities, quantity
from robustpolish.polishing.surfaces.mould import Mould
from robustpolish.polishing.surfaces.surface import Floats, PolishedSurface
from robustpolish.polishing.tool_path import ToolPath
from robustpolish.synthesis.design import Design
from robustpolish.synthesis.output_feedback.output_feedback import output_feedback

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


# Plant: a tool of one mass with an actuator and a linear contact.


@dataclass(frozen=True)
class PolishingAxis:
    r"""A tool that a robot leads along a programmed path and presses on what is really there.

    ::

        m z'' = (F - F_p) - k z - c z' + a,      a' = omega_a (u - a),
        F = F_p + k_c (s - z) + c_c (s' - z').

    z is the height of the tool and s that of the mould, both over where the robot believes the
    mould to be; F, the contact force, pushes the tool up, and so does the actuator's force a. The
    contact is linear, so that a force below zero means that the tool has left the mould.

    Parameters
    ----------
    mass : float
        Moving mass m of tool and spindle [kg]: brush and bearing of table 9.1.
    contact_stiffness, contact_damping : float
        k_c [N/m] and c_c [N s/m]: of the thesis's run 1, and of Hunt-Crossley contact of 50 s/m
        at 10 N.
    polishing_force : float
        F_p [N], which is wanted all the time.
    stiffness, damping : float
        k [N/m] and c [N s/m] of what the tool hangs in at the robot.
    actuator_bandwidth : float
        omega_a / (2 pi) [Hz].
    surface_bandwidth : float
        In Hz. Waves of the mould pass below the tool no quicker than this.

    Raises
    ------
    InvalidInputError
        If a number is negative, zero where it has to be positive, or not finite.

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.polishing.PolishingAxis().plant()
    >>> plant.disturbance_names, plant.measurement_names
    (('surface', 'force_noise'), ('force', 'height', 'climb'))
    """

    mass: float = quantity(1.537, "kg")
    contact_stiffness: float = quantity(1e4, "N/m")
    contact_damping: float = quantity(500.0, "N s/m")
    polishing_force: float = quantity(10.0, "N")
    stiffness: float = quantity(0.0, "N/m")
    damping: float = quantity(5.0, "N s/m")
    actuator_bandwidth: float = quantity(100.0, "Hz")
    surface_bandwidth: float = quantity(100.0, "Hz")

    def __post_init__(self) -> None:
        zero = ("contact_damping", "stiffness", "damping")
        check_quantities(self, "PolishingAxis.", zero=zero)

    def plant(self) -> GeneralizedPlant:
        """Return the axis as a plant around its working point.

        Returns
        -------
        GeneralizedPlant
            From `surface` [m] and `force_noise` [N] to `force_error` = F - F_p [N], `tool` = z [m]
            and `gap` = s - z [m]. The control `push` [N] acts upwards; measured are `force`, the
            error with the noise [N], `height`, z [m], and `climb`, z' [m/s].
        """
        m, k, c = self.mass, self.contact_stiffness, self.contact_damping
        slow, quick = 2 * pi * self.surface_bandwidth, 2 * pi * self.actuator_bandwidth
        # States: s, z, z', a. The mould's rate is slow (w - s), with w the disturbance.
        force, (_, tool, climb, _) = np.array([k - c * slow, -k, -c, 0.0]), np.eye(4)
        A = np.zeros((4, 4))
        A[0, 0], A[1, 2], A[3, 3] = -slow, 1.0, -quick
        A[2] = (force + np.array([0.0, -self.stiffness, -self.damping, 1.0])) / m
        units = {"s": "m", "z": "m", "dz": "m/s", "a": "N", "surface": "m", "force_noise": "N"}
        units |= {"push": "N", "force_error": "N", "tool": "m", "gap": "m", "force": "N"}
        return GeneralizedPlant.from_matrices(
            A,
            np.array([[slow, 0.0], [0.0, 0.0], [c * slow / m, 0.0], [0.0, 0.0]]),
            np.array([[0.0], [0.0], [0.0], [quick]]),
            np.array([force, tool, [1.0, -1.0, 0.0, 0.0]]),
            np.array([force, tool, climb]),
            D11=np.array([[c * slow, 0.0], [0.0, 0.0], [0.0, 0.0]]),
            D21=np.array([[c * slow, 1.0], [0.0, 0.0], [0.0, 0.0]]),
            states=["s", "z", "dz", "a"],
            disturbances=["surface", "force_noise"],
            controls=["push"],
            performance=["force_error", "tool", "gap"],
            measurements=["force", "height", "climb"],
            units={**units, "height": "m", "climb": "m/s"},
        )


# Controllers of the polishing force (thesis, section 3.4.1).


@dataclass(frozen=True, eq=False)
class ForceControl:
    """A way to control the polishing force.

    Attributes
    ----------
    name : str
    axis : PolishingAxis
        With what the tool hangs in.
    controller : control.StateSpace
        From the measurements of ``axis.plant()`` (force error, height, climb) to its push.
    loop : control.StateSpace
        From `surface` and `force_noise` to `force_error`, `tool`, `gap` and the push; stable.
    design : Design or None
        The certified design, where there is one.

    Examples
    --------
    >>> import robustpolish as rp
    >>> way = rp.polishing.impedance_control(rp.polishing.PolishingAxis())
    >>> way.name, way.controller.D.shape
    ('impedance, 100 N/m', (1, 3))
    """

    name: str
    axis: PolishingAxis
    controller: control.StateSpace = field(repr=False)
    loop: control.StateSpace = field(repr=False)
    design: Design | None = field(default=None, repr=False)


def passive_stiffness(
    axis: PolishingAxis, stiffness: float = 500.0, damping: float | None = None
) -> ForceControl:
    """Hang the tool in a soft spring and a damper, preloaded to the polishing force.

    No force is measured and nothing is driven: where the mould is higher by s, the force is higher
    by about k s.

    Parameters
    ----------
    axis : PolishingAxis
    stiffness : float
        k of the spring [N/m].
    damping : float, optional
        c of the damper [N s/m]; a tenth of the critical one of spring and mass.

    Returns
    -------
    ForceControl

    Examples
    --------
    >>> import robustpolish as rp
    >>> found = rp.polishing.passive_stiffness(rp.polishing.PolishingAxis(), 500.0)
    >>> round(float(found.loop.dcgain()[0, 0]), 1)  # N per m: 500 and 1e4 N/m in series
    476.2
    """
    k = positive("stiffness", stiffness, "N/m")
    critical = 2 * sqrt(k * _axis(axis).mass)
    hung = replace(axis, stiffness=k, damping=_damping(damping, 0.1 * critical))
    return _closed(f"passive, {k:.4g} N/m", hung, _static([0.0, 0.0, 0.0]))


def impedance_control(
    axis: PolishingAxis,
    mass: float | None = None,
    damping: float | None = None,
    stiffness: float = 100.0,
) -> ForceControl:
    """Drive the tool so that it answers forces like a wanted mass, damper and spring.

    M z'' + B z' + K z = F - F_p (N. Hogan, "Impedance control: an approach to manipulation",
    J. Dynamic Systems, Measurement and Control 107 (1985)): the actuator replaces the tool's own
    mass by M and adds B and K. At rest the force is off by K times the height, as with a
    spring of K, which may be softer than any that carries a tool.

    Parameters
    ----------
    axis : PolishingAxis
    mass : float, optional
        M [kg]; that of the tool, for which no force has to be measured.
    damping : float, optional
        B [N s/m]; critical for M and K.
    stiffness : float
        K [N/m].

    Returns
    -------
    ForceControl

    Raises
    ------
    InvalidInputError
        If the loop is not stable: the actuator is too slow for a mass so much smaller.

    Examples
    --------
    >>> import robustpolish as rp
    >>> found = rp.polishing.impedance_control(rp.polishing.PolishingAxis(), stiffness=100.0)
    >>> round(float(found.loop.dcgain()[0, 0]), 1)
    99.0
    """
    own = _axis(axis).mass
    wanted = own if mass is None else positive("mass", mass, "kg")
    k = positive("stiffness", stiffness, "N/m")
    b = _damping(damping, 2 * sqrt(k * wanted))
    ratio = own / wanted
    # What hangs already is taken out again.
    gain = [ratio - 1, axis.stiffness - ratio * k, axis.damping - ratio * b]
    return _closed(f"impedance, {k:.4g} N/m", axis, _static(gain))


def admittance_control(
    axis: PolishingAxis,
    damping: float | None = None,
    mass: float | None = None,
    stiffness: float = 0.0,
    position_bandwidth: float = 40.0,
) -> ForceControl:
    """Shift the height that a position controller holds, as the measured force asks.

    M r'' + B r' + K r = F - F_p gives the height r, which a proportional-derivative controller
    follows. Without K the force is right at rest, whatever the height, and off by B times the
    speed at which the mould rises.

    Parameters
    ----------
    axis : PolishingAxis
    damping : float, optional
        B [N s/m]; such that force is corrected with a bandwidth of a tenth of the position's.
    mass : float, optional
        M [kg]; a tenth of B divided by the position's bandwidth.
    stiffness : float
        K [N/m].
    position_bandwidth : float
        Of the position controller without contact [Hz].

    Returns
    -------
    ForceControl

    Raises
    ------
    InvalidInputError
        If the loop is not stable.

    Examples
    --------
    >>> import robustpolish as rp
    >>> found = rp.polishing.admittance_control(rp.polishing.PolishingAxis())
    >>> abs(round(float(found.loop.dcgain()[0, 0]), 3))
    0.0
    """
    omega = 2 * pi * positive("position_bandwidth", position_bandwidth, "Hz")
    usual = 10 * _axis(axis).contact_stiffness / omega
    b = usual if damping is None else positive("damping", damping)
    m = 0.1 * b / omega if mass is None else positive("mass", mass, "kg")
    k = positive("stiffness", stiffness, "N/m", zero=True)
    hold, brake = axis.mass * omega**2, 1.4 * axis.mass * omega
    A = np.array([[0.0, 1.0], [-k / m, -b / m]])  # r, r'
    B = np.array([[0.0, 0.0, 0.0], [1 / m, 0.0, 0.0]])
    controller = control.StateSpace(A, B, [[hold, brake]], [[0.0, -hold, -brake]])
    return _closed(f"admittance, {b:.4g} N s/m", axis, controller)


def hinf_force_control(
    axis: PolishingAxis,
    bandwidth: float = 5.0,
    *,
    deviation: float = 1e-3,
    accuracy: float = 0.01,
    largest_push: float = 20.0,
) -> ForceControl:
    """Design an output feedback that keeps the force error small, by its H-infinity norm.

    Any controller with a weighted norm below 1 will do; the central one has less gain and slower
    poles than those near the least norm.

    Parameters
    ----------
    axis : PolishingAxis
    bandwidth : float
        In Hz: waves of the mould that pass more slowly shall not be felt.
    deviation : float
        How far the mould is off [m], in that band.
    accuracy : float
        Error of the force that counts as 1, as a share of the polishing force.
    largest_push : float
        Push of the actuator that counts as much [N].

    Returns
    -------
    ForceControl
        With its certified `design`.

    Raises
    ------
    InfeasibleError
        If no controller comes below 1: ask for less accuracy, or allow larger pushes.

    Examples
    --------
    >>> import robustpolish as rp
    >>> found = rp.polishing.hinf_force_control(rp.polishing.PolishingAxis())
    >>> found.design.certificate.stable
    True
    """
    plant = _axis(axis).plant()
    force, edge = axis.polishing_force, positive("bandwidth", bandwidth, "Hz")
    size = positive("deviation", deviation, "m")
    # Waves of the mould fade above the band; below it an error of `accuracy` counts as 1.
    lag = 1.0 / (2 * pi * edge)
    slow = control.TransferFunction([size], [lag**2, 2 * lag, 1.0])
    share = positive("accuracy", accuracy)
    asked = plant.weighted(
        {"surface": slow, "force_noise": 1e-3 * force, "force_error": 1.0 / (share * force)}
    )
    design = output_feedback(
        asked,
        control_weight=1.0 / positive("largest_push", largest_push, "N"),
        gamma=1.0,
        measurement_noise=[1e-3 * force, 1e-2 * size, 1e-2 * size * 2 * pi * edge],
    )
    return _closed("H-infinity", axis, design.controller, design)


def _axis(axis: PolishingAxis) -> PolishingAxis:
    return instance_of("axis", axis, PolishingAxis, "a PolishingAxis", "Pass PolishingAxis(...).")


def _static(gain: list[float]) -> control.StateSpace:
    return control.StateSpace([], [], [], np.array([gain]))


def _damping(given: float | None, usual: float) -> float:
    return usual if given is None else positive("damping", given, "N s/m", zero=True)


def _closed(
    name: str, axis: PolishingAxis, controller: control.StateSpace, design: Design | None = None
) -> ForceControl:
    """Close the loop, and refuse one that is not stable."""
    loop = axis.plant().with_control_outputs().closed_loop(controller)
    found = stability(loop)
    if found.verdict != "stable":
        shown = described(f"{name}, whose loop has a pole at {found.pole:.3g} rad/s")
        remedy = "Ask for less: more damping, a larger mass or a smaller bandwidth."
        raise invalid("controller", shown, "a stable loop", remedy)
    return ForceControl(name, axis, controller, loop, design)


# Comparison of force and removal along a path.


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
    >>> path = rp.polishing.ToolPath.through([(0.0, 0.0), (0.02, 0.0)], speed=0.02)
    >>> time = np.linspace(0.0, 1.0, 1001)
    >>> passive = rp.polishing.passive_stiffness(rp.polishing.PolishingAxis())
    >>> found = rp.polishing.compare_force_control([passive], path, 1e-3 * time, time)
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
        shares = {name: 100.0 * self.table[name] for name in ("force_error", "removal_error")}
        keys = ("control", "force_error", "least", "largest", "removal_error")
        shown = self.table.assign(shares)
        rows = zip(*(shown[key].values.tolist() for key in keys), strict=True)
        return Card("", (Table("", columns, tuple(rows)),))

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
        names = [str(name) for name in forces["control"].values]
        return plot_time_series({name: forces.sel(control=name, drop=True) for name in names}, ax)

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
    >>> path = rp.polishing.ToolPath.through([(0.0, 0.0), (0.01, 0.0)], speed=0.01)
    >>> tilted = rp.polishing.Mould.from_formula("0.01*x", x=(-0.02, 0.03), y=(-0.02, 0.02))
    >>> rp.polishing.height_deviation(
    ...     tilted, rp.polishing.Surface.flat(), path, [0.0, 1.0]).round(9).tolist(
    ... )
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
    that lies flat (see :func:`robustpolish.polishing.removal_of_force`).

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
    >>> axis = rp.polishing.PolishingAxis()
    >>> path = rp.polishing.ToolPath.through([(0.0, 0.0), (0.02, 0.0)], speed=0.02)
    >>> time = np.linspace(0.0, 1.0, 2001)
    >>> ways = [rp.polishing.passive_stiffness(axis), rp.polishing.hinf_force_control(axis)]
    >>> found = rp.polishing.compare_force_control(
    ...     ways, path, 1e-3 * np.sin(2 * np.pi * time), time
    ... )
    >>> bool(found.table["removal_error"][1] < 0.5 * found.table["removal_error"][0])
    True
    """
    names = [item.name for item in controls]
    if not names or len(set(names)) < len(names) or "wanted" in names:
        raise invalid("controls", names, "controls with names of their own", "Rename them.")
    wanted = sorted({item.axis.polishing_force for item in controls})
    if len(wanted) > 1:
        shown = described(f"polishing forces {wanted} N")
        raise invalid("controls", shown, "one polishing force", "Design all for one axis.")
    (force,) = wanted
    moments = np.asarray(time, dtype=float)
    columns = []
    for name, column in (("deviation", deviation), ("force_noise", force_noise)):
        given = np.zeros(moments.shape) if column is None else np.asarray(column, dtype=float)
        if given.shape != moments.shape or not np.all(np.isfinite(given)):
            shown = described(f"shape {given.shape}, or numbers that are not finite")
            raise invalid(name, shown, f"shape {moments.shape}, as time", "Give one per time.")
        columns.append(given)
    surface, noise = columns

    def response(item: ForceControl) -> Vector:
        # The plant's mould follows its input with a lag, which is taken back here.
        lag = 1.0 / (2 * pi * item.axis.surface_bandwidth)
        ahead = surface + lag * np.gradient(surface, moments)
        return linear_response(item.loop, moments, np.stack([ahead, noise], 1)).outputs

    error, tool, _, push = np.moveaxis(np.array([response(item) for item in controls]), -1, 0)
    both = ("control", "time")
    signals = xr.Dataset(
        {
            "force": (both, force + error, {"units": "N", "long_name": "force"}),
            "tool": (both, tool, {"units": "m"}),
            "push": (both, push, {"units": "N"}),
            "surface": ("time", surface, {"units": "m"}),
        },
        coords={"time": ("time", moments, {"units": "s"}), "control": names},
    )
    pressed = signals["force"]
    forces = {"wanted": np.full(moments.shape, force)}
    forces |= dict(zip(names, pressed.values, strict=True))
    maps = {
        name: removal_of_force(path, moments, applied, parameters=parameters, preston=preston)
        for name, applied in forces.items()
    }
    aim, norm = maps["wanted"].values, np.linalg.norm
    missed = [float(norm(maps[name].values - aim) / norm(aim)) for name in names]
    table = xr.Dataset(
        {
            "force_error": ((pressed / force - 1) ** 2).mean("time") ** 0.5,
            "least": pressed.min("time").assign_attrs(units="N"),
            "largest": pressed.max("time").assign_attrs(units="N"),
            "touching": (pressed > 0).mean("time"),
            "removal_error": ("control", missed),
            "push": ((signals["push"] ** 2).mean("time") ** 0.5).assign_attrs(units="N"),
        }
    )
    return ForceComparison(signals, table, maps)
