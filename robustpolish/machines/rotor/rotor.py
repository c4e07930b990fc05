"""A shaft that spins with its discs in its bearings."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from operator import attrgetter
from typing import Any, Literal

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import ArrayLike
from scipy.linalg import null_space

from robustpolish.base.arrays import Array, Matrix, Vector
from robustpolish.base.checks import described, instance_of, invalid, one_of, positive, whole_number
from robustpolish.base.results import Card, Displayed, Table, quantities
from robustpolish.machines.rotor.assembly import (
    Assembly,
    Mesh,
    RotorBearing,
    RotorDisc,
    SecondOrder,
    ShaftSegment,
    assembled,
)
from robustpolish.machines.rotor.modes import (
    Campbell,
    RotorModes,
    critical_speeds,
    eigen_whirl,
    track_modes,
    whirl_modes,
)
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.plots.frequency import plot_gains

# A rotor with named forces and displacements, as a plant that every synthesis takes.

AXES = ("x", "y")


def state_space(
    system: SecondOrder, speed: float, forces: Matrix, seen: Matrix
) -> tuple[Matrix, Matrix, Matrix]:
    """Return A, B and C from forces at some places to displacements at others.

    Parameters
    ----------
    system : SecondOrder
    speed : float
        In rad/s.
    forces, seen : ndarray, shapes (inputs, n) and (outputs, n)
        Rows of displacements.

    Returns
    -------
    A, B, C : ndarray
    """
    A = system.state_matrix(speed)
    shapes, m = system.normal_modes[1], len(A) // 2
    B, C = np.zeros((len(A), len(forces))), np.zeros((len(seen), len(A)))
    B[m:] = (forces @ shapes).T
    C[:, :m] = seen @ (shapes / system.state_scale)
    return A, B, C


def mode_names(system: SecondOrder) -> list[str]:
    """Return names of the states: displacement and rate of each normal coordinate."""
    count = len(system.state_scale)
    return [f"{prefix}mode{k + 1}" for prefix in ("", "d") for k in range(count)]


def named_places(argument: str, given: Mapping[str, float]) -> dict[str, float]:
    """Return places by name, checked.

    Parameters
    ----------
    argument : str
    given : mapping of str to float

    Returns
    -------
    dict

    Raises
    ------
    InvalidInputError
    """
    instance_of(argument, given, Mapping, "places by name", "Write {'tip': 0.02}.")
    if not given:
        raise invalid(argument, given, "at least one place", "Write {'tip': 0.02}.")
    found: dict[str, float] = {}
    for name, place in given.items():
        try:
            found[str(name)] = float(place)
        except (TypeError, ValueError):
            raise invalid((argument, str(name)), place, "a place in m", "Write 0.02.") from None
        if not np.isfinite(found[str(name)]):
            raise invalid((argument, str(name)), place, "a finite place in m", "Check it.")
    return found


# Bases of few motions that describe a rotor as its ports see it.

Method = Literal["modal", "static", "craig_bampton"]
METHODS: tuple[Method, ...] = ("modal", "static", "craig_bampton")
_NEW = 1e-9
"""A deflection that adds less than this to the motions before it, as a share, is left out."""
_SAME_SHAPE = 1e-6
"""The same of modes: the two halves of a round orbit are one shape, up to rounding."""


def reduction_basis(
    system: SecondOrder, ports: Matrix, modes: int, method: Method, speed: float
) -> tuple[Matrix, ...]:
    """Return a basis for each plane, shape (coordinates, kept).

    Parameters
    ----------
    system : SecondOrder
    ports : ndarray, shape (ports, coordinates)
        Rows of the displacements at which forces act and motion is seen.
    modes : int
        How many dynamic shapes of each of x and y to keep.
    method : {"modal", "static", "craig_bampton"}
        The lowest modes alone; with the deflections under a force at each port, which makes
        the static gain exact; or these with the lowest modes of the rotor held at its ports.
    speed : float
        At which the modes are taken, in rad/s: gyroscopic moments bend forward whirl otherwise
        than backward, so that a rotor that spins needs twice as many shapes.

    Returns
    -------
    tuple of ndarray

    Raises
    ------
    InvalidInputError
        If deflections are asked for where nothing holds the rotor.

    References
    ----------
    Craig and Bampton (1968), Coupling of substructures for dynamic analyses, AIAA Journal 6,
    1313-1319; Rubin (1975), AIAA Journal 13, 995-1006, for modes with static deflections.
    """
    each, whirling = modes * 2 // len(system.planes), np.zeros((len(system.mass), 0))
    if speed:  # motions in and out of phase of the lowest undamped whirl modes
        none, K = np.zeros_like(system.mass), (system.stiffness + system.stiffness.T) / 2
        undamped = replace(system, damping=none, circulatory=none, stiffness=K)
        vectors = eigen_whirl(undamped, speed)[1][: len(system.state_scale), : 2 * modes]
        motions = (system.normal_modes[1] / system.state_scale) @ vectors
        whirling = np.hstack([motions.real, motions.imag])
    bases: list[Matrix] = []
    for part in system.parts:
        own = ports[:, part][np.abs(ports[:, part]).max(axis=1) > 0]
        plane = system.projected(np.eye(len(system.mass))[:, part])
        size = len(plane.mass)
        if method == "craig_bampton":
            held = null_space(own) if len(own) else np.eye(size)
            dynamic = held @ plane.projected(held).normal_modes[1][:, :each]
        else:
            dynamic = whirling[part] if speed else plane.normal_modes[1][:, :each]
        if method != "modal" and plane.normal_modes[0].min(initial=np.inf) == 0:
            shown = described("deflections under steady forces")
            remedy = "Add a bearing, or write method='modal'."
            raise invalid("method", shown, "'modal' for a rotor that nothing holds", remedy)
        static: Any = np.zeros((size, 0))
        if method != "modal":
            static = np.linalg.solve(plane.stiffness, own.T)
        kept = _independent(plane.mass, dynamic, np.zeros((size, 0)), _SAME_SHAPE)
        bases.append(_independent(plane.mass, static, kept, _NEW))
    return tuple(bases)


def _independent(mass: Matrix, motions: Matrix, before: Matrix, least: float) -> Matrix:
    """Return `before` and the motions, made orthogonal and of unit mass (Gram and Schmidt)."""
    kept = list(before.T)
    sizes = np.sqrt(np.einsum("ij,ij->j", motions, mass @ motions))
    for motion, size in zip(motions.T, sizes, strict=True):
        if size <= least * sizes.max():
            continue
        own = motion / size
        for _ in range(2):  # the second time takes out what rounding left
            for other in kept:
                own = own - other * (other @ mass @ own)
        left = np.sqrt(own @ mass @ own)
        if left > least:
            kept.append(own / left)
    return np.column_stack(kept)


# A rotor with few coordinates: its plant, and what it lacks.

_GRID = 400
_DECADES = 4
_DAMPED = 0.01
"""Damping ratio that is added to both rotors before their responses are compared: without any, the
response at a resonance has no size, and the error there none either."""


@dataclass(frozen=True)
class ReductionError:
    """What a reduced rotor lacks below a frequency.

    Attributes
    ----------
    response : float
        Largest difference of the responses between all ports (largest singular value) over the
        response itself, over frequency, with a damping ratio of 0.01 added to both.
    response_hz : float
        Where that is.
    frequency : float
        Largest relative difference of the whirl frequencies.
    steady : float
        The relative difference of the responses to steady forces.
    band_hz, speed : float
        For which band from 0 Hz and which speed in rad/s this holds.

    Examples
    --------
    >>> import robustpolish as rp
    >>> lost = rp.polishing.spindle_rotor().reduced(1, [-0.0445, 0.025], "modal").error()
    >>> round(lost.steady, 3), lost.frequency < 1e-9  # one mode bends too little under steady loads
    (0.002, True)
    """

    response: float
    response_hz: float
    frequency: float
    steady: float
    band_hz: float
    speed: float


@dataclass(frozen=True, eq=False, repr=False)
class ReducedRotor(Displayed):
    """A rotor with few coordinates, as its ports see it.

    Attributes
    ----------
    assembly : Assembly
        The whole rotor.
    system : SecondOrder
        The reduced equations of motion, with gyroscopic terms for every speed.
    bases : tuple of ndarray, or None
        Motions that are kept, by plane; None if all are.
    ports : tuple of float
        In m.
    method : str
    modes : int
        Dynamic shapes of each of x and y.
    speed : float
        In rad/s, at which these were taken.

    Examples
    --------
    >>> import robustpolish as rp
    >>> few = rp.polishing.spindle_rotor().reduced(2, [-0.0445, 0.025])
    >>> len(few.system.state_scale), len(few.assembly.system.state_scale), few.modes
    (8, 84, 2)
    """

    assembly: Assembly
    system: SecondOrder = field(repr=False)
    bases: tuple[Matrix, ...] | None
    ports: tuple[float, ...]
    method: Method
    modes: int
    speed: float = 0.0

    @property
    def band_hz(self) -> float:
        """The highest of the whole rotor's normal modes that are kept, in Hz."""
        known = self.assembly.system.normal_modes[0]
        return float(known[min(2 * self.modes, len(known)) - 1]) / (2 * math.pi)

    def rows(self, place: float) -> Matrix:
        """Return rows that give x and y at a place from the reduced coordinates.

        Parameters
        ----------
        place : float
            In m.

        Returns
        -------
        ndarray, shape (2, n)

        Examples
        --------
        >>> import robustpolish as rp
        >>> rp.polishing.spindle_rotor().reduced(2, [0.02]).rows(0.02).shape
        (2, 6)
        """
        rows = self.assembly.ports([place])
        if self.bases is None:
            return rows
        parts = zip(self.assembly.system.parts, self.bases, strict=True)
        return np.hstack([rows[:, part] @ basis for part, basis in parts])

    def plant(
        self,
        speed: float | None = None,
        *,
        loads: Mapping[str, float],
        actuators: Mapping[str, float],
        sensors: Mapping[str, float] | None = None,
        performance: Mapping[str, float] | None = None,
    ) -> GeneralizedPlant:
        """Return a plant with named forces and displacements.

        Parameters
        ----------
        speed : float, optional
            Of the spin, in rad/s; by default that at which the modes were taken.
        loads : mapping of str to float
            Places of the disturbing forces by name, in m: "tip" becomes F_tip_x and F_tip_y in N.
        actuators : mapping of str to float
            Places of the controls: "magnet" becomes u_magnet_x and u_magnet_y in N.
        sensors : mapping of str to float, optional
            Places of the measurements, measured_magnet_x and measured_magnet_y in m; those of the
            actuators by default.
        performance : mapping of str to float, optional
            Places of the performance outputs, tip_x and tip_y in m; those of the loads by default.

        Returns
        -------
        GeneralizedPlant
            Its states are displacements and rates of the normal modes at rest.

        Raises
        ------
        InvalidInputError
            If a place is none.

        Examples
        --------
        >>> import robustpolish as rp
        >>> few = rp.polishing.spindle_rotor().reduced(2, [-0.0445, 0.025])
        >>> few.plant(loads={"brush": 0.025}, actuators={"film": -0.0445}).disturbance_names
        ('F_brush_x', 'F_brush_y')
        """
        given = {
            "loads": ("F_", loads),
            "actuators": ("u_", actuators),
            "performance": ("", loads if performance is None else performance),
            "sensors": ("measured_", actuators if sensors is None else sensors),
        }
        names: dict[str, list[str]] = {}
        rows: dict[str, Matrix] = {}
        for role, (prefix, places) in given.items():
            found = named_places(role, places)
            names[role] = [f"{prefix}{name}_{axis}" for name in found for axis in AXES]
            rows[role] = np.vstack([self.rows(place) for place in found.values()])
        forces = np.vstack([rows["loads"], rows["actuators"]])
        seen = np.vstack([rows["performance"], rows["sensors"]])
        speed = self.speed if speed is None else speed
        A, B, C = state_space(self.system, speed, forces, seen)
        nw, nz = len(names["loads"]), len(names["performance"])
        units = dict.fromkeys(names["loads"] + names["actuators"], "N")
        units |= dict.fromkeys(names["performance"] + names["sensors"], "m")
        return GeneralizedPlant.from_matrices(
            A, B[:, :nw], B[:, nw:], C[:nz], C[nz:], states=mode_names(self.system),
            disturbances=names["loads"], controls=names["actuators"],
            performance=names["performance"], measurements=names["sensors"], units=units,
        )  # fmt: skip

    def error(self, speed: float | None = None, band_hz: float | None = None) -> ReductionError:
        """Compare with the whole rotor between the ports.

        Parameters
        ----------
        speed : float, optional
            In rad/s; by default that at which the modes were taken.
        band_hz : float, optional
            Up to which frequency; by default to the highest normal mode that is kept.

        Returns
        -------
        ReductionError

        Raises
        ------
        InvalidInputError
            If the band is not positive.

        Examples
        --------
        >>> import robustpolish as rp
        >>> few = rp.polishing.spindle_rotor().reduced(2, [-0.0445, 0.025])
        >>> few.error(speed=314.0).response < 0.1, few.error().response < 1e-6
        (True, True)
        """
        speed = self.speed if speed is None else speed
        band, share, response, lost = self._compared(speed, band_hz)
        shares = lost / response
        worst = int(shares.argmax())
        systems = self.system, self.assembly.system
        found, known = (np.imag(eigen_whirl(system, speed)[0]) for system in systems)
        count = min(int((known <= 2 * math.pi * band * (1 + 1e-9)).sum()), len(found))
        gaps = np.abs(found[:count] / known[:count] - 1)
        return ReductionError(
            response=float(shares[worst]),
            response_hz=float(band * share[worst]),
            frequency=float(gaps.max(initial=0.0)),
            steady=float(shares[0]),
            band_hz=band,
            speed=speed,
        )

    def _compared(
        self, speed: float, band_hz: float | None
    ) -> tuple[float, Vector, Vector, Vector]:
        """Return the band in Hz, shares of it, and gains there of the rotor and of what is lost."""
        band = self.band_hz if band_hz is None else positive("band_hz", band_hz, "Hz")
        share = np.r_[0.0, np.geomspace(10.0**-_DECADES, 1, _GRID)]
        s = 2 * math.pi * band * share * (1j + _DAMPED)
        rows = self.assembly.ports(self.ports)
        response = self.assembly.system.response(speed, s, rows, rows)
        rows = np.vstack([self.rows(place)[axis] for axis in (0, 1) for place in self.ports])
        lost = response - self.system.response(speed, s, rows, rows)
        gains = [np.linalg.norm(each, 2, axis=(1, 2)) for each in (response, lost)]
        return band, share, gains[0], gains[1]

    def plot(self, ax: Axes | None = None, *, band_hz: float | None = None) -> Axes:
        """Draw the gain between the ports over frequency, and that of what is lost.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.
        band_hz : float, optional
            As for :meth:`error`.

        Returns
        -------
        matplotlib.axes.Axes

        Examples
        --------
        >>> import robustpolish as rp
        >>> rp.polishing.spindle_rotor().reduced(2, [0.025]).plot().get_xlabel()
        'frequency'
        """
        band, share, *gains = self._compared(self.speed, band_hz)
        frequency = {"frequency": band * share[1:]}
        names = ("the whole rotor, 1 % damping added", "what is lost")
        curves = {
            name: xr.DataArray(gain[1:], frequency, attrs={"units": "m/N"})
            for name, gain in zip(names, gains, strict=True)
        }
        return plot_gains(curves, ax=ax)

    def _card(self) -> Card:
        lost = self.error()
        rows = (
            ("states", 2 * len(self.system.state_scale)),
            ("states of the whole rotor", 2 * len(self.assembly.system.state_scale)),
            ("band [Hz]", lost.band_hz),
            ("largest relative error within", lost.response),
            ("largest relative error of a frequency", lost.frequency),
            ("relative error for steady forces", lost.steady),
        )
        return Card(f"Reduced rotor ({self.method})", (quantities(*rows),))


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
    >>> shaft = [rp.rotor.ShaftSegment(1.5, 0.05, elements=6)]
    >>> discs = [
    ...     rp.rotor.RotorDisc.cylinder(0.5, diameter=0.28, width=0.07, bore=0.05),
    ...     rp.rotor.RotorDisc.cylinder(1.0, diameter=0.35, width=0.07, bore=0.05),
    ... ]
    >>> bearings = [rp.rotor.RotorBearing(0.0, 1e6), rp.rotor.RotorBearing(1.5, 1e6)]
    >>> rotor = rp.rotor.RotorModel(shaft, discs, bearings)
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

    shaft: Sequence[ShaftSegment]
    discs: Sequence[RotorDisc] = ()
    bearings: Sequence[RotorBearing] = ()
    theory: Theory = "timoshenko"
    internal_damping: float = 0.0

    def __post_init__(self) -> None:
        for name, kind in (
            ("shaft", ShaftSegment),
            ("discs", RotorDisc),
            ("bearings", RotorBearing),
        ):
            given, remedy = getattr(self, name), f"Write [{kind.__name__}(...)]."
            instance_of(name, given, Sequence, f"a list of {kind.__name__}", remedy)
            for i, part in enumerate(given):
                instance_of((name, i), part, kind, f"a {kind.__name__}", remedy)
            object.__setattr__(self, name, tuple(given))
        if not self.shaft:
            raise invalid("shaft", self.shaft, "at least one segment", "Write [ShaftSegment(...)].")
        one_of("theory", self.theory, ("timoshenko", "euler"))
        beta = positive("internal_damping", self.internal_damping, "s", zero=True)
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
        >>> rp.polishing.spindle_rotor().modes(314.0, count=4).frequencies_hz.round(1)
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
        >>> rp.polishing.spindle_rotor().campbell([0.0, 314.0], count=2).whirl[-1].round(6)
        array([-1.,  1.])
        """
        given: Vector = np.asarray(speeds, dtype=float)
        rising = given.ndim == 1 and len(given) > 1 and (np.diff(given) > 0).all()
        if not rising or given[0] < 0 or not np.isfinite(given).all():
            shown = described(f"an array of shape {given.shape}")
            raise invalid("speeds", shown, "rising speeds of at least 0 rad/s", "Sort them.")
        rows = self.assembly.ports(self.assembly.mesh.nodes.tolist())
        eigenvalues, whirl = track_modes(self.assembly.system, rows, given, count)
        critical = self.critical_speeds()
        within = (critical >= given[0]) & (critical <= given[-1])
        return Campbell(given, eigenvalues, whirl, critical[within])

    def critical_speeds(self, resolution: float | None = 0.01) -> Vector:
        """Return where the undamped rotor whirls, either way, as fast as it spins, in rad/s.

        Only forward whirl is excited by unbalance where the bearings are alike in x and y; then
        only forward speeds are returned. A disc that is thin enough stiffens forward whirl so
        much that it never meets the spin. Damping and cross-coupling of bearings are left out.

        Parameters
        ----------
        resolution : float, optional
            Largest relative change of a speed on a mesh of twice the elements. The list ends before
            the first that changes more. Errors fall with the fourth power of the elements' length,
            so the change is 15/16 of the error; 1 % takes some three elements per wave. None lists
            all that the mesh has, the highest of them wrong by a third.

        Returns
        -------
        ndarray, shape (speeds,)
            Rising.

        Raises
        ------
        InvalidInputError
            If nothing holds the rotor, or the resolution is not positive.

        References
        ----------
        G. Strang and G. J. Fix (1973), An analysis of the finite element method, chapter 6.

        Examples
        --------
        >>> import robustpolish as rp
        >>> point = rp.rotor.RotorDisc(1.0, 2.0)
        >>> ends = [rp.rotor.RotorBearing(0.0, 1e5), rp.rotor.RotorBearing(2.0, 1e5)]
        >>> weightless = rp.rotor.ShaftSegment(2.0, 0.5, density=0.0)
        >>> rp.rotor.RotorModel([weightless], [point], ends).critical_speeds().round(1)
        array([316.2])
        """
        speeds = critical_speeds(self.assembly.system)
        if resolution is None:
            return speeds
        limit = positive("resolution", resolution)
        shaft = [replace(segment, elements=2 * segment.elements) for segment in self.shaft]
        # Both lists rise, and speeds of a space within another are the higher ones, one by one.
        finer = critical_speeds(replace(self, shaft=shaft).assembly.system)[: len(speeds)]
        within = np.abs(speeds[: len(finer)] / finer - 1) <= limit
        return speeds[: np.logical_and.accumulate(within).sum()]

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
        >>> clamp = rp.rotor.RotorBearing(0.0, math.inf, tilting_stiffness=math.inf)
        >>> rod = rp.rotor.ShaftSegment(0.02, 0.003, young_modulus=2e11, shear_modulus=7.7e10)
        >>> beam = rp.rotor.RotorModel([rod], bearings=[clamp], theory="euler")
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
        >>> few = rp.polishing.spindle_rotor().reduced(2, [-0.0445, 0.025])
        >>> few.error().response < 1e-6
        True
        """
        places = list(named_places("ports", {str(i): p for i, p in enumerate(ports)}).values())
        one_of("method", method, METHODS)
        system, speed = self.assembly.system, _speed("speed", speed)
        if modes is None:
            count = len(system.normal_modes[0]) // 2
            return ReducedRotor(self.assembly, system, None, tuple(places), method, count, speed)
        modes = whole_number("modes", modes, 1, remedy="Take 3, or None for all.")
        bases = reduction_basis(system, self.assembly.ports(places), modes, method, speed)
        own = system.projected(*bases)
        return ReducedRotor(self.assembly, own, bases, tuple(places), method, modes, speed)

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
        >>> rp.polishing.spindle_rotor(
        ...     elements=2).plant(loads={"tip": 0.02}, actuators={"tip": 0.02}
        ... ).nx
        40
        """
        whole = self.reduced(None, [0.0], speed=speed)
        return whole.plant(
            loads=loads, actuators=actuators, sensors=sensors, performance=performance
        )

    def _card(self) -> Card:
        inertias = ("mass", "diametral_inertia", "polar_inertia")
        listed = (
            (self.shaft, ("shaft [m]", "diameter [m]", "bore [m]", "elements"),
             attrgetter("length", "diameter", "bore", "elements")),
            (self.discs, ("disc at [m]", "mass [kg]", "diametral [kg m^2]", "polar [kg m^2]"),
             attrgetter("position", *inertias)),
            (self.bearings, ("bearing at [m]", "[N/m]", "[N s/m]", "tilting [N m/rad]"),
             attrgetter("position", "stiffness", "damping", "tilting_stiffness")),
        )  # fmt: skip
        tables = [Table("", head, tuple(map(row, parts))) for parts, head, row in listed if parts]
        lowest = self.modes(count=1)
        first = lowest[0].frequency_hz if len(lowest) else math.nan
        return Card(
            f"Rotor ({self.theory})",
            (*tables, quantities(("lowest frequency at rest [Hz]", first))),
        )


def _speed(name: str, value: float) -> float:
    try:
        speed = float(value)
    except (TypeError, ValueError):
        speed = math.nan
    if not math.isfinite(speed):
        raise invalid(name, value, "a finite speed in rad/s", "Multiply rev/min by pi/30.")
    return speed
