"""Parameters of the brush, its tool path and its contact: table 9.1 and chosen values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from math import hypot, pi, sqrt
from types import MappingProxyType
from typing import Any

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
