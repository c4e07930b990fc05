"""Parameters of the brush, its path and contact, and the datasets of both brush simulators."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from math import hypot, pi, sqrt
from types import MappingProxyType
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from robustpolish.base.arrays import AnyArray as Array
from robustpolish.base.checks import instance_of, invalid, one_of
from robustpolish.polishing.quantities import check_quantities, quantity
from robustpolish.polishing.surfaces.surface import PolishedSurface, Surface
from robustpolish.polishing.tool_path import ToolPath

RUN_STIFFNESS: Mapping[int, float] = MappingProxyType({1: 1e4, 2: 1e6, 3: 1e8, 4: 1e10})
"""Contact stiffness k_p [N/m] of the thesis's runs (table 9.2)."""


_MAY_BE_ZERO = frozenset(
    {"friction", "contact_damping", "spin", "rotation_rate", "rotation_radius", "feed"}
)


@dataclass(frozen=True)
class BrushParameters:
    """Polishing brush, tool path, contact and surface, in SI units.

    Each field carries its unit and source in `dataclasses.fields(BrushParameters)[i].metadata`.

    Parameters
    ----------
    radius : float
        Radius r_d of the disc [m].
    height : float
        Height h of the disc [m]; the ball joint sits at half height.
    mass : float
        Mass m of the brush [kg].
    spin : float
        Speed p of the tool rotation [rad/s].
    rotation_radius, rotation_rate : float
        Radius R_rot [m] and speed lambda [rad/s] of the robot's circling.
    feed : float
        Longitudinal speed v of the robot [m/s].
    polishing_force : float
        Force F_p [N] that presses the brush down, constant.
    friction : float
        Coefficient mu [-] of Coulomb friction. Uncertain: the thesis doubts its own value.
    contact_stiffness : float
        k_p [N/m]; of the whole rim when it is pressed flat down (see `for_run`).
    contact_damping : float
        Hunt-Crossley coefficient [s/m]: the contact force is k_p times penetration times
        (1 + contact_damping times rate of penetration), never below zero. Not measured, and it
        decides: at 50 s/m contact is quiet, at a tenth of that the brush may rattle.
    slip_scale : float
        Slip speed [m/s] below which friction fades out; the rim slips at radius times spin,
        3.14 m/s, far above it.
    spindle_damping : float
        Torque per deviation of the spin from `spin` [N m s/rad] by which the drive holds
        the speed of the three-angle disc. The two-angle disc has an ideal drive.
    surface : Surface or Mould
        What is polished.
    path : ToolPath, optional
        Where the tool's centre goes. Without one it circles and is fed along x (9.2).

    Raises
    ------
    InvalidInputError
        If a value is not finite, negative, or zero where it has to be positive.

    Examples
    --------
    >>> import robustpolish as rp
    >>> brush = rp.polishing.BrushParameters.for_run(3, friction=0.2)
    >>> brush.contact_stiffness, brush.friction
    (100000000.0, 0.2)
    >>> round(1e6 * brush.tilt_inertia, 3), round(1e6 * brush.spin_inertia, 3)
    (6.667, 10.0)
    """

    radius: float = quantity(0.010, "m", "table 9.1, r_d")
    height: float = quantity(0.010, "m", "table 9.1, h")
    mass: float = quantity(0.2, "kg", "table 9.1, m")
    spin: float = quantity(100.0 * pi, "rad/s", "table 9.1, p")
    rotation_radius: float = quantity(0.003, "m", "table 9.1, r_rot")
    rotation_rate: float = quantity(4.0 * pi, "rad/s", "table 9.1, lambda")
    feed: float = quantity(0.001, "m/s", "table 9.1, v")
    polishing_force: float = quantity(10.0, "N", "table 9.1, F_p")
    friction: float = quantity(0.25 * sqrt(2.0), "-", "table 9.1, mu")
    contact_stiffness: float = quantity(RUN_STIFFNESS[1], "N/m", "table 9.2, run 1")
    contact_damping: float = quantity(50.0, "s/m", "chosen; not in the thesis")
    slip_scale: float = quantity(0.01, "m/s", "chosen; regularises Coulomb's law")
    spindle_damping: float = quantity(0.01, "N m s/rad", "chosen; drops the spin by 1 %")
    surface: PolishedSurface = field(
        default_factory=Surface, metadata={"unit": "", "source": "eq. 9.1, made to fit the disc"}
    )
    path: ToolPath | None = field(default=None, metadata={"unit": "", "source": "eq. 9.2 if none"})

    def __post_init__(self) -> None:
        remedy = "Pass Surface(along, across), or a Mould."
        where = "BrushParameters.surface"
        instance_of(where, self.surface, PolishedSurface, "a Surface or a Mould", remedy)
        if self.path is not None:
            remedy = "Make one with ToolPath.spiral(...) or the like, or leave it out."
            instance_of("BrushParameters.path", self.path, ToolPath, "a ToolPath", remedy)
        check_quantities(self, "BrushParameters.", zero=_MAY_BE_ZERO)

    @classmethod
    def for_run(cls, run: int, **changes: Any) -> BrushParameters:
        """Return the parameters with the contact stiffness of run 1, 2, 3 or 4 (table 9.2).

        Parameters
        ----------
        run : {1, 2, 3, 4}
        **changes : float, Surface, Mould or ToolPath
            Other fields of the class.

        Returns
        -------
        BrushParameters

        Examples
        --------
        >>> import robustpolish as rp
        >>> rp.polishing.BrushParameters.for_run(2, mass=0.25).mass
        0.25
        """
        return cls(**changes).with_run(run)

    @classmethod
    def as_published(cls, run: int = 1) -> BrushParameters:
        """Return the thesis's parameters, its surface (9.1) included.

        Parameters
        ----------
        run : {1, 2, 3, 4}, optional

        Returns
        -------
        BrushParameters

        Examples
        --------
        >>> import robustpolish as rp
        >>> rp.polishing.BrushParameters.as_published().surface.across
        5.0
        """
        return cls.for_run(run, surface=Surface.as_published())

    def with_run(self, run: int) -> BrushParameters:
        """Return a copy with the contact stiffness of run 1, 2, 3 or 4 (table 9.2).

        Parameters
        ----------
        run : {1, 2, 3, 4}

        Returns
        -------
        BrushParameters

        Examples
        --------
        >>> import robustpolish as rp
        >>> rp.polishing.BrushParameters().with_run(3).contact_stiffness
        100000000.0
        """
        return replace(self, contact_stiffness=RUN_STIFFNESS[one_of("run", run, RUN_STIFFNESS)])

    @property
    def trough(self) -> Surface:
        """The surface, for what knows troughs on the circling path only; refuses any other."""
        if not isinstance(self.surface, Surface) or self.path is not None:
            other = self.path if isinstance(self.surface, Surface) else self.surface
            wanted = "Surface(along, across) and no path, for the listing"
            raise invalid("parameters", other, wanted, "Take the physical simulator.")
        return self.surface

    @property
    def rim_distance(self) -> float:
        """Distance r [m] from the ball joint to the rim (section 6.1)."""
        return hypot(self.radius, 0.5 * self.height)

    @property
    def spin_inertia(self) -> float:
        """Moment of inertia [kg m^2] about the axis of the disc (eq. 6.33)."""
        return 0.5 * self.mass * self.radius**2

    @property
    def tilt_inertia(self) -> float:
        """Moment of inertia [kg m^2] about an axis across the disc (eq. 6.33)."""
        return self.mass * (3.0 * self.radius**2 + self.height**2) / 12.0

    @property
    def impact_duration(self) -> float:
        """Duration t_m [s] of an impact as the thesis estimates it (eq. 7.40)."""
        return 0.5 * pi * sqrt(self.mass / self.contact_stiffness)


NUMBERS = tuple(item.name for item in fields(BrushParameters) if item.metadata["unit"])
"""Fields that are numbers: all but surface and path."""


# Position of the tool's centre: circling feed (eqs. 9.2 and 9.3), or a given path.


def tool_position(time: ArrayLike, parameters: BrushParameters) -> NDArray[np.float64]:
    """Place of the tool's centre: on the path of the parameters, or circling (eq. 9.2).

    Parameters
    ----------
    time : array_like
        Times [s].
    parameters : BrushParameters
        The path, or radius and rate of the circling, feed, and brush radius.

    Returns
    -------
    ndarray, shape (2, ...)
        x and y in world axes [m].

    Examples
    --------
    >>> import robustpolish as rp
    >>> from robustpolish.polishing import tool_position
    >>> tool_position(0.0, rp.polishing.BrushParameters()).round(4).tolist()
    [0.016, 0.0]
    """
    if parameters.path is not None:
        return parameters.path.position(time)
    moment = np.asarray(time, dtype=float)
    turn, circle = parameters.rotation_rate * moment, parameters.rotation_radius
    x = circle * np.cos(turn) + parameters.feed * moment + (parameters.radius + circle)
    return np.stack([x, circle * np.sin(turn)])


def tool_velocity(time: ArrayLike, parameters: BrushParameters) -> NDArray[np.float64]:
    """Velocity of the tool's centre: on the path of the parameters, or circling (eq. 9.3).

    Parameters
    ----------
    time : array_like
        Times [s].
    parameters : BrushParameters
        The path, or radius and rate of the circling, and feed.

    Returns
    -------
    ndarray, shape (2, ...)
        Components along x and y in world axes [m/s].

    Examples
    --------
    >>> import robustpolish as rp
    >>> from robustpolish.polishing import tool_velocity
    >>> tool_velocity(0.0, rp.polishing.BrushParameters()).round(4).tolist()
    [0.001, 0.0377]
    """
    if parameters.path is not None:
        return parameters.path.velocity(time)
    turn = parameters.rotation_rate * np.asarray(time, dtype=float)
    speed = parameters.rotation_radius * parameters.rotation_rate
    return np.stack([parameters.feed - speed * np.sin(turn), speed * np.cos(turn)])


Variable = tuple[Any, Array, dict[str, Any]]

POINTS = ("C1", "C2", "C3", "C4")

_FORCE_TEXT = {
    "F_x": "force on the tool along -x",
    "F_y": "force on the tool along -y",
    "F_z": "force on the tool along +z, away from the surface",
    "F_p": "polishing force of the robot on the bearing, along -z",
}


def variable(values: Array, units: str, text: str, dims: Any = "time") -> Variable:
    """Return one variable of a dataset: dimensions, values, attributes."""
    return dims, values, {"units": units, "long_name": text}


def force_variables(*forces: Array) -> dict[str, Variable]:
    """Return F_x, F_y, F_z and F_p [N], with the signs of (8.45)."""
    named = zip(_FORCE_TEXT.items(), forces, strict=True)
    return {name: variable(force, "N", text) for (name, text), force in named}


def angle_variables(
    angles: tuple[Array, Array, Array, Array], names: tuple[str, str], level: float | None
) -> dict[str, Variable]:
    """Return theta, psi and their rates; `level` is psi of a level disc, where it has one."""
    theta, psi, theta_rate, psi_rate = angles
    variables = {
        "theta": variable(theta, "rad", names[0]),
        "psi": variable(psi, "rad", names[1]),
        "theta_rate": variable(theta_rate, "rad/s", f"rate of {names[0]}"),
        "psi_rate": variable(psi_rate, "rad/s", f"rate of {names[1]}"),
    }
    if level is not None:
        variables["psi"][2]["level"] = level
    return variables


def path_variables(time: Array, parameters: BrushParameters) -> dict[str, Variable]:
    """Return the tool path (9.2) and the surface under it (9.1, 9.4, 9.5)."""
    surface, (x, y) = parameters.surface, tool_position(time, parameters)
    along, across = tool_velocity(time, parameters)
    moving = np.hypot(along, across) > 0.0
    angle = np.zeros_like(x)
    angle[moving] = surface.elevation(x[moving], y[moving], (along[moving], across[moving]))
    text = "elevation of the surface in the direction of the tool's movement"
    return {
        "tool_x": variable(x, "m", "place of the tool's centre along the feed"),
        "tool_y": variable(y, "m", "place of the tool's centre across the feed"),
        "surface_height": variable(surface.height(x, y), "m", "surface under the tool's centre"),
        "elevation": variable(angle, "rad", text),
    }


def parameter_attributes(parameters: BrushParameters) -> dict[str, float | str]:
    """Return every parameter as an attribute that any file format can keep."""
    surface, path = parameters.surface, parameters.path
    told: dict[str, float | str] = {name: getattr(parameters, name) for name in NUMBERS}
    if isinstance(surface, Surface):
        told |= {"surface_along": surface.along, "surface_across": surface.across}
    else:
        told["surface"] = repr(surface)
    return told if path is None else {**told, "path": repr(path)}


def parameters_from_attributes(attributes: Mapping[Any, Any]) -> BrushParameters:
    """Undo `parameter_attributes`."""
    surface = Surface(attributes["surface_along"], attributes["surface_across"])
    return BrushParameters(**{name: attributes[name] for name in NUMBERS}, surface=surface)


def labelled(
    time: Array, variables: Mapping[str, Variable], attributes: Mapping[str, Any]
) -> xr.Dataset:
    """Put variables along `time` and `point` together."""
    coordinates = {"time": ("time", time, {"units": "s"}), "point": list(POINTS)}
    return xr.Dataset(dict(variables), coordinates, dict(attributes))
