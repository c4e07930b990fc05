"""Polishing spindle as a rotor of finite beam elements, and its plant."""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
from scipy.linalg import block_diag

from robustpolish.base.checks import one_of, positive
from robustpolish.machines.rotor.assembly import RotorBearing, RotorDisc, ShaftSegment
from robustpolish.machines.rotor.rotor import RotorModel, Theory, mode_names, state_space
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.polishing.air_bearing import (
    COORDINATES,
    FORCES,
    AirBearingParameters,
    air_bearing,
)
from robustpolish.polishing.quantities import or_default

POISSON_RATIO = 0.3
"""Of steel; the thesis gives Young's modulus alone."""


def spindle_rotor(
    parameters: AirBearingParameters | None = None,
    dissipation: float = 0.001,
    *,
    theory: Theory = "timoshenko",
    brush: Literal["disc", "point"] = "disc",
    bearing: Literal["rigid", "reduced"] = "rigid",
    density: float = 7850.0,
    elements: int = 10,
) -> RotorModel:
    """Build brush, rod and air bearing as a rotor.

    The rod reaches from 0 to its length, the bearing's body lies before it, the brush behind it.

    Parameters
    ----------
    parameters : AirBearingParameters, optional
        :meth:`AirBearingParameters.as_published` by default.
    dissipation : float, optional
        Share of the energy lost per cycle, (8.23), with the frequencies of the lumped model, so
        that rod and film have the damping that :func:`robustpolish.air_bearing` gives them. That of
        the rod turns with it.
    theory : {"timoshenko", "euler"}, optional
        With or without shear.
    brush : {"disc", "point"}, optional
        A cylinder whose middle lies half its height behind the rod, or a point mass at its end, as
        in (8.4).
    bearing : {"rigid", "reduced"}, optional
        A cylinder of the bearing's height and width that moves and tilts on its film, or the mass
        m_x (8.9) on the spring k_t (8.18), which cannot tilt.
    density : float, optional
        Of the rod, in kg/m^3; used where `parameters` neglects the rod's mass. 0 for no mass.
    elements : int, optional
        Of the rod.

    Returns
    -------
    RotorModel

    Raises
    ------
    InvalidInputError
        If an option is unknown or a value is not physical.

    References
    ----------
    M.L. Postma, Polishing robot: vibrations due to impact, sections 8.1, 8.2 and 8.4, and chapter
    13, which asks for this model.

    Examples
    --------
    >>> import robustpolish as rp
    >>> thesis = rp.polishing.spindle_rotor(
    ...     theory="euler", brush="point", bearing="reduced", density=0.0
    ... )
    >>> [round(mode.frequency_hz, 4) for mode in thesis.modes(count=4)]  # (8.35)
    [194.0691, 194.0691, 2069.5764, 2069.5764]
    >>> round(rp.polishing.spindle_rotor().modes(count=1)[0].frequency_hz, 1)
    131.8
    """
    p = or_default("parameters", parameters, AirBearingParameters)
    one_of("brush", brush, ("disc", "point"))
    one_of("bearing", bearing, ("rigid", "reduced"))
    own_density = positive("density", density, "kg/m^3", zero=True)
    if p.rod_mass:
        own_density = p.rod_mass / (math.pi * p.rod_radius**2 * p.rod_length)
    E = p.young_modulus
    steel: dict[str, Any] = {"young_modulus": E, "shear_modulus": E / (2 * (1 + POISSON_RATIO))}
    rod = ShaftSegment(
        p.rod_length, 2 * p.rod_radius, **steel, density=own_density, elements=elements
    )
    damping = p.damping(dissipation)
    middle, tip = _places(p, brush, bearing)
    if bearing == "reduced":
        body = RotorDisc(middle, p.m_x)
        film = RotorBearing(middle, p.k_t, damping.c_A, tilting_stiffness=math.inf)
    else:
        wide, high, k_r = p.bearing_width, p.bearing_height, p.bearing_torsional_stiffness
        body = RotorDisc.cylinder(middle, diameter=wide, width=high, mass=p.bearing_mass)
        per_stiffness = damping.c_A / p.k_t
        tilting = {"tilting_stiffness": k_r, "tilting_damping": per_stiffness * k_r}
        k_tr = p.bearing_stiffness
        film = RotorBearing(middle, k_tr, per_stiffness * k_tr, **tilting)
    tool = RotorDisc(tip, p.m_t)
    if brush == "disc":
        size: dict[str, Any] = {"diameter": 2 * p.brush_radius, "width": p.brush_height}
        tool = RotorDisc.cylinder(tip, **size, mass=p.m_t)
    return RotorModel([rod], [body, tool], [film], theory, damping.c_D / p.k_x)


def rotating_beam(
    parameters: AirBearingParameters | None = None,
    dissipation: float = 0.001,
    speed: float = 0.0,
    modes: int | None = 2,
    *,
    theory: Theory = "timoshenko",
    brush: Literal["disc", "point"] = "disc",
    bearing: Literal["rigid", "reduced"] = "rigid",
    density: float = 7850.0,
    elements: int = 10,
) -> GeneralizedPlant:
    """Build the spindle as a rotating beam, with the signals of :func:`robustpolish.air_bearing`.

    x and y come from :func:`spindle_rotor`, whose gyroscopic moments couple them as soon as it
    spins; z is that of the lumped model with forces as controls.

    Parameters
    ----------
    parameters, dissipation, theory, brush, bearing, density, elements
        As in :func:`spindle_rotor`.
    speed : float, optional
        Of the spin, in rad/s.
    modes : int or None, optional
        Normal modes of each of x and y to keep, beside the deflections under steady forces on
        bearing and brush; None for all of the beam's. What is lost says
        ``spindle_rotor(...).reduced(...).error()``.

    Returns
    -------
    GeneralizedPlant
        w = (F_x, F_y, F_z, F_p), u = forces in N on bearing and brush (u_x_m, u_x, ...), z and y =
        the six displacements in m; x_m and y_m are those of the bearing's middle. F_x, F_y and
        F_p act against their coordinate, F_z along it.

    Raises
    ------
    InvalidInputError
        If an option is unknown or a value is not physical.

    Examples
    --------
    >>> import robustpolish as rp
    >>> beam, lumped = rp.polishing.rotating_beam(speed=314.0), rp.air_bearing(actuation="force")
    >>> beam.control_names == lumped.control_names, lumped.nx, lumped.nx < beam.nx < 30
    (True, 12, True)
    """
    p = AirBearingParameters() if parameters is None else parameters
    shape: dict[str, Any] = {"theory": theory, "brush": brush, "bearing": bearing}
    rotor = spindle_rotor(p, dissipation, **shape, density=density, elements=elements)
    places = _places(p, brush, bearing)
    lumped = air_bearing(p, dissipation, "force", "displacement")
    # x and y from the rotor, and z from the lumped plant.
    few = rotor.reduced(modes, places, speed=speed)
    rows = np.vstack([few.rows(place)[axis] for axis in (0, 1) for place in places])
    A, B, C = state_space(few.system, few.speed, rows, rows)
    across = len(C)
    vertical = lumped.part(states=range(8, 12))
    loads = np.zeros((len(A), len(FORCES)))
    for force, name in (("F_x", "x"), ("F_y", "y")):
        loads[:, FORCES.index(force)] = -B[:, COORDINATES.index(name)]
    seen = np.asarray(block_diag(C, vertical.C1[across:]))
    return lumped.replace(
        A=np.asarray(block_diag(A, vertical.A)),
        B1=np.vstack([loads, vertical.B1]),
        B2=np.asarray(block_diag(B, vertical.B2[:, across:])),
        C1=seen,
        C2=seen,
        states=[*mode_names(few.system), *(f"state_{name}" for name in lumped.states[8:])],
    )


def _places(p: AirBearingParameters, brush: str, bearing: str) -> tuple[float, float]:
    """Return where the middles of bearing and brush are, in m from the rod's first end."""
    middle = 0.0 if bearing == "reduced" else -p.bearing_height / 2
    return middle, p.rod_length + (p.brush_height / 2 if brush == "disc" else 0.0)
