"""A shaft that spins with its discs in its bearings."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from robustpolish.arrays import Array, Vector
from robustpolish.display import Card, Displayed, Table, quantities
from robustpolish.models.plant.plant import GeneralizedPlant
from robustpolish.models.rotor.assembly import Assembly, Mesh, assembled
from robustpolish.models.rotor.campbell import Campbell, followed
from robustpolish.models.rotor.critical import critical_speeds
from robustpolish.models.rotor.parts import RotorBearing, RotorDisc, ShaftSegment
from robustpolish.models.rotor.plant import named_places
from robustpolish.models.rotor.reduced import ReducedRotor
from robustpolish.models.rotor.reduction import METHODS, Method, reduction_basis
from robustpolish.models.rotor.whirl import RotorModes, eigen_whirl, whirl_modes
from robustpolish.validation import described, instance_of, invalid, is_whole, one_of, positive

Theory = Literal["timoshenko", "euler"]


@dataclass(frozen=True, eq=False, repr=False)
class RotorModel(Displayed):
    """A round shaft of beam elements that spins with its discs in its bearings.

    The shaft bends in x and y and spins about z, from x to y. Two deflections and two slopes per
    node, in a frame that does not turn, with rotary inertia and gyroscopic moments of shaft and
    discs. Bearings may differ in x and y; shaft and discs are round.

    Parameters
    ----------
    shaft : sequence of ShaftSegment
        One behind the other.
    discs : sequence of RotorDisc, optional
    bearings : sequence of RotorBearing, optional
        None at all for a free rotor.
    theory : {"timoshenko", "euler"}, optional
        With or without shear. Rotary inertia counts in both.
    internal_damping : float, optional
        Damping of the shaft's bending over its stiffness, in s. It turns with the shaft, and
        drives forward whirl that is slower than the spin.

    Raises
    ------
    InvalidInputError
        If a part is of another kind, there is no shaft, or the damping negative.

    References
    ----------
    Friswell, Penny, Garvey, Lees (2010), Dynamics of rotating machines, Cambridge, chapters 5 to 7.

    Examples
    --------
    >>> import math
    >>> import robustpolish as rp
    >>> shaft = [rp.ShaftSegment(1.5, 0.05, elements=6)]
    >>> discs = [
    ...     rp.RotorDisc.cylinder(0.5, diameter=0.28, width=0.07, bore=0.05),
    ...     rp.RotorDisc.cylinder(1.0, diameter=0.35, width=0.07, bore=0.05),
    ... ]
    >>> bearings = [rp.RotorBearing(0.0, 1e6), rp.RotorBearing(1.5, 1e6)]
    >>> rotor = rp.RotorModel(shaft, discs, bearings)
    >>> rotor.modes(4000 * math.pi / 30, count=4)
    Whirl at 418.879 rad/s (4000 rev/min)
      whirl     frequency [Hz]  damping  roundness
      backward         13.5902        0         -1
      forward          13.9731        0          1
      backward         40.0726        0         -1
      forward          46.9047        0          1

    A plant for every synthesis, with a magnet and a sensor at each end:

    >>> ends = {"left": 0.0, "right": 1.5}
    >>> few = rotor.reduced(3, [0.0, 0.5, 1.5], speed=418.0)
    >>> plant = few.plant(loads={"disc": 0.5}, actuators=ends, sensors=ends)
    >>> plant.control_names
    ('u_left_x', 'u_left_y', 'u_right_x', 'u_right_y')
    """

    shaft: tuple[ShaftSegment, ...]
    discs: tuple[RotorDisc, ...] = ()
    bearings: tuple[RotorBearing, ...] = ()
    theory: Theory = "timoshenko"
    internal_damping: float = 0.0

    def __init__(
        self,
        shaft: Sequence[ShaftSegment],
        discs: Sequence[RotorDisc] = (),
        bearings: Sequence[RotorBearing] = (),
        theory: Theory = "timoshenko",
        internal_damping: float = 0.0,
    ) -> None:
        parts = (("shaft", shaft, ShaftSegment), ("discs", discs, RotorDisc))
        for name, given, kind in (*parts, ("bearings", bearings, RotorBearing)):
            remedy = f"Write [{kind.__name__}(...)]."
            instance_of(name, given, Sequence, f"a list of {kind.__name__}", remedy)
            for i, part in enumerate(given):
                instance_of((name, i), part, kind, f"a {kind.__name__}", remedy)
            object.__setattr__(self, name, tuple(given))
        if not shaft:
            raise invalid("shaft", shaft, "at least one segment", "Write [ShaftSegment(...)].")
        one_of("theory", theory, ("timoshenko", "euler"))
        object.__setattr__(self, "theory", theory)
        beta = positive("internal_damping", internal_damping, "s", zero=True)
        object.__setattr__(self, "internal_damping", beta)

    @property
    def length(self) -> float:
        """Of the shaft, in m."""
        return float(sum(segment.length for segment in self.shaft))

    @cached_property
    def assembly(self) -> Assembly:
        """Mesh and matrices."""
        places = [part.position for part in (*self.discs, *self.bearings)]
        mesh = Mesh.of(self.shaft, places, self.theory == "timoshenko")
        return assembled(mesh, self.discs, self.bearings, self.internal_damping)

    def modes(self, speed: float = 0.0, count: int = 10) -> RotorModes:
        """Return the lowest whirl modes at a speed.

        Parameters
        ----------
        speed : float, optional
            Of the spin, in rad/s.
        count : int, optional

        Returns
        -------
        RotorModes

        Raises
        ------
        InvalidInputError
            If the speed is not finite, or parts that nothing holds have no mass.

        Examples
        --------
        >>> import robustpolish as rp
        >>> rp.spindle_rotor().modes(314.0, count=4).frequencies_hz.round(1)
        array([ 128. ,  135.7, 1070.6, 1135.6])
        """
        speed = _speed("speed", speed)
        system, nodes = self.assembly.system, self.assembly.mesh.nodes
        values, vectors, growth = eigen_whirl(system, speed)
        found = whirl_modes(values, vectors, system, self.assembly.ports(nodes.tolist()))
        return RotorModes(found[:count], speed, nodes, growth)

    def campbell(self, speeds: ArrayLike, count: int = 6) -> Campbell:
        """Follow the lowest whirl modes over speed.

        Parameters
        ----------
        speeds : array_like, shape (speeds,)
            In rad/s, rising, the first at or above 0.
        count : int, optional
            How many modes, the lowest at the first speed.

        Returns
        -------
        Campbell

        Raises
        ------
        InvalidInputError
            If the speeds do not rise.

        Examples
        --------
        >>> import robustpolish as rp
        >>> rp.spindle_rotor().campbell([0.0, 314.0], count=2).whirl[-1].round(6)
        array([-1.,  1.])
        """
        given: Vector = np.asarray(speeds, dtype=float)
        rising = given.ndim == 1 and len(given) > 1 and (np.diff(given) > 0).all()
        if not rising or given[0] < 0 or not np.isfinite(given).all():
            shown = described(f"an array of shape {given.shape}")
            raise invalid("speeds", shown, "rising speeds of at least 0 rad/s", "Sort them.")
        rows = self.assembly.ports(self.assembly.mesh.nodes.tolist())
        eigenvalues, whirl = followed(self.assembly.system, rows, given, count)
        critical = self.critical_speeds()
        within = (critical >= given[0]) & (critical <= given[-1])
        return Campbell(given, eigenvalues, whirl, critical[within])

    def critical_speeds(self) -> Vector:
        """Return where the undamped rotor whirls, either way, as fast as it spins, in rad/s.

        Only forward whirl is excited by unbalance where the bearings are alike in x and y; then
        only forward speeds are returned. A disc that is thin enough stiffens forward whirl so
        much that it never meets the spin. Damping and cross-coupling of bearings are left out.

        Returns
        -------
        ndarray, shape (speeds,)
            Rising.

        Raises
        ------
        InvalidInputError
            If nothing holds the rotor.

        Examples
        --------
        >>> import robustpolish as rp
        >>> point = rp.RotorDisc(1.0, 2.0)
        >>> ends = [rp.RotorBearing(0.0, 1e5), rp.RotorBearing(2.0, 1e5)]
        >>> weightless = rp.ShaftSegment(2.0, 0.5, density=0.0)
        >>> rp.RotorModel([weightless], [point], ends).critical_speeds().round(1)
        array([316.2])
        """
        return critical_speeds(self.assembly.system)

    def static_stiffness(self, position: float) -> Array:
        """Return the stiffness that a force at a place meets, at rest.

        Parameters
        ----------
        position : float
            In m.

        Returns
        -------
        ndarray, shape (2, 2)
            In N/m, forces in x and y by displacements.

        Examples
        --------
        >>> import math
        >>> import robustpolish as rp
        >>> clamp = rp.RotorBearing(0.0, math.inf, tilting_stiffness=math.inf)
        >>> rod = rp.ShaftSegment(0.02, 0.003, young_modulus=2e11, shear_modulus=7.7e10)
        >>> beam = rp.RotorModel([rod], bearings=[clamp], theory="euler")
        >>> round(float(beam.static_stiffness(0.02)[0, 0]))  # 3 E I / l^3
        298206
        """
        rows = self.assembly.ports([position])
        compliance = rows @ np.linalg.solve(self.assembly.system.stiffness, rows.T)
        found: Any = np.linalg.inv(compliance)
        return found

    def reduced(
        self,
        modes: int | None,
        ports: Sequence[float],
        method: Method = "static",
        speed: float = 0.0,
    ) -> ReducedRotor:
        """Return the rotor with few coordinates, as some places see it.

        Parameters
        ----------
        modes : int or None
            How many modes of each of x and y to keep; None for all, nothing reduced.
        ports : sequence of float
            Where forces act and displacements are seen, in m.
        method : {"static", "craig_bampton", "modal"}, optional
            The lowest modes with the deflections under forces at the ports, so that steady
            forces have exactly their effect; the lowest modes of the rotor at rest and held at its
            ports with the same deflections (Craig and Bampton); or the modes alone.
        speed : float, optional
            At which the modes are taken, in rad/s. Where it is not 0, forward and backward whirl
            have shapes of their own, and there are up to twice as many coordinates.

        Returns
        -------
        ReducedRotor
            Whose ``error()`` states what is lost.

        Raises
        ------
        InvalidInputError

        Examples
        --------
        >>> import robustpolish as rp
        >>> few = rp.spindle_rotor().reduced(2, [-0.0445, 0.025])
        >>> few.error().response < 1e-6
        True
        """
        places = list(named_places("ports", {str(i): p for i, p in enumerate(ports)}).values())
        one_of("method", method, METHODS)
        system, speed = self.assembly.system, _speed("speed", speed)
        if modes is None:
            count = len(system.normal_modes[0]) // 2
            return ReducedRotor(self.assembly, system, None, tuple(places), method, count, speed)
        if not is_whole(modes) or modes < 1:
            raise invalid("modes", modes, "a whole number above 0, or None", "Take 3.")
        bases = reduction_basis(system, self.assembly.ports(places), int(modes), method, speed)
        own = system.projected(*bases)
        return ReducedRotor(self.assembly, own, bases, tuple(places), method, int(modes), speed)

    def plant(
        self,
        speed: float = 0.0,
        *,
        loads: Mapping[str, float],
        actuators: Mapping[str, float],
        sensors: Mapping[str, float] | None = None,
        performance: Mapping[str, float] | None = None,
    ) -> GeneralizedPlant:
        """Return the whole rotor as a plant; :meth:`reduced` gives one with fewer states.

        Parameters
        ----------
        speed, loads, actuators, sensors, performance
            As in :meth:`ReducedRotor.plant`.

        Returns
        -------
        GeneralizedPlant

        Examples
        --------
        >>> import robustpolish as rp
        >>> rp.spindle_rotor(elements=2).plant(loads={"tip": 0.02}, actuators={"tip": 0.02}).nx
        40
        """
        whole = self.reduced(None, [0.0], speed=speed)
        return whole.plant(
            loads=loads, actuators=actuators, sensors=sensors, performance=performance
        )

    def _card(self) -> Card:
        shaft = tuple((part.length, part.diameter, part.bore, part.elements) for part in self.shaft)
        discs = tuple(
            (part.position, part.mass, part.diametral_inertia, part.polar_inertia)
            for part in self.discs
        )
        bearings = tuple(
            (part.position, part.stiffness, part.damping, part.tilting_stiffness)
            for part in self.bearings
        )
        tables = [
            Table("", ("shaft [m]", "diameter [m]", "bore [m]", "elements"), shaft),
            Table("", ("disc at [m]", "mass [kg]", "diametral [kg m^2]", "polar [kg m^2]"), discs),
            Table("", ("bearing at [m]", "[N/m]", "[N s/m]", "tilting [N m/rad]"), bearings),
        ]
        lowest = self.modes(count=1)
        first = lowest[0].frequency_hz if len(lowest) else math.nan
        tables.append(quantities(("lowest frequency at rest [Hz]", first)))
        kept = tuple(table for table in tables if table.rows)
        return Card(f"Rotor ({self.theory})", kept)


def _speed(name: str, value: float) -> float:
    try:
        speed = float(value)
    except (TypeError, ValueError):
        speed = math.nan
    if not math.isfinite(speed):
        raise invalid(name, value, "a finite speed in rad/s", "Multiply rev/min by pi/30.")
    return speed
