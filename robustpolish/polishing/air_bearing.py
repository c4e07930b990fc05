"""Air bearing with its brush: parameters, plant, mechanical model; with actuators and sensors.

The lumped model of chapter 8 of the thesis: two masses in series in each of three decoupled axes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from robustpolish.base.checks import invalid, one_of, positive
from robustpolish.machines.effects.effect import share_damping
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import Damper, Dof, Input, Output, Spring
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.polishing.quantities import Quantities, check_quantities, or_default, quantity

# Parameters: dimensions, masses and stiffnesses.

Reading = Literal["listing", "physical"]
_NEEDED = "listing D.2 line 33, which the published modes need"
_READING = {"unit": "", "symbol": "", "source": _NEEDED}


@dataclass(frozen=True)
class DampingCoefficients:
    """Viscous damping of the air bearing model, all in N s/m.

    Attributes
    ----------
    c_A : float
        Air bearing to ground, in x and y.
    c_D : float
        Rod between air bearing and brush, in x and y.
    c_R : float
        Rod between air bearing and brush, in z.
    c_Z : float
        Brush to mould, in z.
    """

    c_A: float
    c_D: float
    c_R: float
    c_Z: float


@dataclass(frozen=True, repr=False)
class AirBearingParameters(Quantities):
    """Dimensions, masses and stiffnesses of brush, rod and air bearing.

    The field's unit, symbol in the thesis and source stand in its metadata, see
    ``table``. Three readings of the thesis are offered as constructors, because its
    text, its table and its listings contradict each other:
    :meth:`as_published` (also ``AirBearingParameters()``), :meth:`as_printed` and
    :meth:`corrected`.

    Parameters
    ----------
    brush_radius, brush_height : float
        In m.
    brush_mass : float
        In kg.
    rod_radius, rod_length : float
        In m.
    rod_mass : float
        In kg; the listings neglect it.
    young_modulus : float
        Of the rod, in N/m^2.
    bearing_mass : float
        In kg.
    bearing_height, bearing_width : float
        In m.
    bearing_stiffness : float
        Transverse, in N/m.
    bearing_torsional_stiffness : float
        In N m/rad.
    holder_stiffness : float
        In N/m.
    mould_damping : float
        In N s/m.
    inertia_reading : {"listing", "physical"}
        As in listing D.2, or that of rigid bodies.

    Raises
    ------
    InvalidInputError
        If a length, mass or stiffness is not positive (the rod's mass and the damping of
        the mould may be zero), or if the reduced mass m_x is not positive.

    Examples
    --------
    >>> import robustpolish as rp
    >>> parameters = rp.polishing.AirBearingParameters.as_published()
    >>> round(parameters.m_x, 4), round(parameters.k_t / 1e8, 4)
    (0.6376, 1.0752)
    >>> upper, lower = parameters.natural_frequencies()["x"]  # in rad/s
    >>> round(lower / 6.283185307, 1), parameters.damping(0.001).c_D > 0
    (194.1, True)
    >>> rp.polishing.AirBearingParameters.as_printed().bearing_mass, parameters.table()[0][:3]
    (0.337, ('brush_radius', 0.01, 'm'))
    >>> round(rp.polishing.AirBearingParameters.corrected().m_x, 3)
    0.242
    """

    _caption = ("Air bearing", "parameter")
    brush_radius: float = quantity(0.010, "m", "table 9.1", symbol="r_d")
    brush_height: float = quantity(0.010, "m", "table 9.1", symbol="h")
    brush_mass: float = quantity(0.2, "kg", "table 9.1", symbol="m_t")
    rod_radius: float = quantity(0.0015, "m", "table 9.1", symbol="r_b")
    rod_length: float = quantity(0.020, "m", "table 9.1", symbol="l")
    rod_mass: float = quantity(0.0, "kg", "listing D.2 line 31: neglected", symbol="m_rod")
    young_modulus: float = quantity(2e11, "N/m^2", "table 9.1, steel", symbol="E")
    bearing_mass: float = quantity(
        1.337,
        "kg",
        "the value that gives the published modes; table 9.1 has 0.337",
        symbol="m_bearing",
    )
    bearing_height: float = quantity(0.089, "m", "table 9.1", symbol="h_b")
    bearing_width: float = quantity(0.05, "m", "listing D.2 line 21", symbol="b")
    bearing_stiffness: float = quantity(110e6, "N/m", "table 9.1, transverse", symbol="k_tr")
    bearing_torsional_stiffness: float = quantity(23e6, "N m/rad", "table 9.1", symbol="k_r")
    holder_stiffness: float = quantity(
        1e9, "N/m", "section 9.4.1 and the published modes; table 9.1 has 1e10", symbol="k_A"
    )
    mould_damping: float = quantity(1e-8, "N s/m", "table 9.1", symbol="c_Z")
    inertia_reading: Reading = field(default="listing", metadata=_READING)

    def __post_init__(self) -> None:
        """Check every field."""
        one_of("inertia_reading", self.inertia_reading, ("listing", "physical"))
        check_quantities(self, zero=("rod_mass", "mould_damping"))
        if self.m_x <= 0:
            expected = f"enough inertia for a positive reduced mass (8.9), not {self.m_x:.4g} kg"
            remedy = "Increase the mass or the size of the bearing."
            raise invalid("bearing_mass", self.bearing_mass, expected, remedy)

    @classmethod
    def as_published(cls) -> AirBearingParameters:
        """Return the reading that reproduces the thesis's frequencies and norms (the default).

        The bearing has 1.337 kg, the holder 1e9 N/m, and the inertia is that of the listing.
        """
        return cls()

    @classmethod
    def as_printed(cls) -> AirBearingParameters:
        """Return table 9.1 to the letter: a bearing of 0.337 kg and a holder of 1e10 N/m.

        It gives modes at 5271.9 Hz in x and y, not the published 2069.6 Hz.
        """
        return cls(bearing_mass=0.337, holder_stiffness=1e10)

    @classmethod
    def corrected(cls) -> AirBearingParameters:
        """Return the published values with the moment of inertia of rigid-body mechanics.

        The reduced mass m_x falls to 0.242 kg and the upper mode rises to 3361 Hz.
        """
        return cls(inertia_reading="physical")

    @property
    def arm(self) -> float:
        """Distance r_b of (8.7) from the bearing's centre to the brush's centre, in m."""
        return self.bearing_height / 2 + self.rod_length + self.brush_height / 2

    @property
    def bearing_inertia(self) -> float:
        """Moment of inertia about the bearing's centre, in kg m^2, (8.10) to (8.13).

        The reading "listing" is line 33 of listing D.2. The reading "physical" takes a box for
        the bearing, a cylinder for the brush and a slender rod, each moved by Steiner's theorem.
        """
        half, rod, height = self.bearing_height / 2, self.rod_length, self.brush_height
        if self.inertia_reading == "listing":
            bearing = self.bearing_mass * (half**2 + (self.bearing_width / 2) ** 2)
            rods = self.rod_mass * (rod**2 / 12 + half**2)
            brush = 4 / 3 * (height / 2) ** 2 + 4 * self.brush_radius**2 + half**2 + rod**2
        else:
            bearing = self.bearing_mass / 12 * (self.bearing_height**2 + self.bearing_width**2)
            rods = self.rod_mass * (rod**2 / 12 + (half + rod / 2) ** 2)
            brush = (3 * self.brush_radius**2 + height**2) / 12 + self.arm**2
        return bearing + rods + self.brush_mass * brush

    @property
    def m_x(self) -> float:
        """Reduced mass of the bearing in x and y, in kg, (8.9)."""
        return self.bearing_inertia / self.arm**2 - self.brush_mass - self.rod_mass

    @property
    def m_z(self) -> float:
        """Mass of the bearing in z, in kg."""
        return self.bearing_mass

    @property
    def m_t(self) -> float:
        """Mass of the brush, in kg."""
        return self.brush_mass

    @property
    def k_t(self) -> float:
        """Stiffness of the bearing at the brush, in N/m, (8.18)."""
        k_tr, k_r = self.bearing_stiffness, self.bearing_torsional_stiffness
        return k_tr * k_r / (k_r + k_tr * self.arm**2)

    @property
    def k_x(self) -> float:
        """Bending stiffness of the rod, in N/m, (8.1) and (8.2)."""
        area_moment = math.pi / 4 * self.rod_radius**4
        return 3 * self.young_modulus * area_moment / self.rod_length**3

    @property
    def k_z(self) -> float:
        """Axial stiffness of the rod, in N/m, (8.19)."""
        return self.young_modulus * math.pi * self.rod_radius**2 / self.rod_length

    @property
    def k_A(self) -> float:
        """Stiffness of the holder in z, in N/m."""
        return self.holder_stiffness

    def natural_frequencies(self) -> dict[str, tuple[float, float]]:
        """Undamped natural frequencies in rad/s, upper and lower, per direction.

        Returns
        -------
        dict
            "x" (also y, (8.35)), "z" (8.37) and "z_free", z without the holder.
        """
        return {
            "x": _two_mass_frequencies(self.m_x, self.m_t, self.k_t, self.k_x),
            "z": _two_mass_frequencies(self.m_z, self.m_t, self.k_A, self.k_z),
            "z_free": _two_mass_frequencies(self.m_z, self.m_t, 0.0, self.k_z),
        }

    def damping(self, dissipation: float) -> DampingCoefficients:
        """Viscous coefficients from the share of the energy that is lost, (8.23).

        Each spring takes the frequency of the mode that it dominates: c_A and c_D those in x,
        c_R the free-free frequency of the z axis, which is what the published 0.5581 N s/m
        needs (with the listed omega_R it would be 0.3883).

        Parameters
        ----------
        dissipation : float
            Share n of the maximum energy lost per cycle; 0.001 in the thesis. At 0 the model
            is undamped, and c_Z is zero too.

        Returns
        -------
        DampingCoefficients
        """
        n = positive("dissipation", dissipation, zero=True)
        if n == 0:
            return DampingCoefficients(0.0, 0.0, 0.0, 0.0)
        frequency = self.natural_frequencies()
        springs = zip(
            (self.k_t, self.k_x, self.k_z), (*frequency["x"], frequency["z_free"][0]), strict=True
        )
        c_A, c_D, c_R = (share_damping(n, stiffness, omega) for stiffness, omega in springs)
        return DampingCoefficients(c_A, c_D, c_R, self.mould_damping)


def _two_mass_frequencies(
    mass_1: float, mass_2: float, to_ground: float, between: float
) -> tuple[float, float]:
    """Roots of the quartic (8.35), upper then lower, in rad/s.

    The lower root comes from the product of the roots, so that it does not suffer from
    cancellation when one spring is far stiffer than the other.
    """
    total = mass_2 * (to_ground + between) + mass_1 * between
    product = between * to_ground * mass_1 * mass_2
    upper = (total + math.sqrt(total**2 - 4 * product)) / (2 * mass_1 * mass_2)
    return math.sqrt(upper), math.sqrt(product / upper) / (mass_1 * mass_2)


COORDINATES = ("x_m", "x", "y_m", "y", "z_m", "z")
FORCES = ("F_x", "F_y", "F_z", "F_p")


def air_bearing(
    parameters: AirBearingParameters | None = None,
    dissipation: float = 0.001,
    actuation: Literal["displacement", "force"] = "displacement",
    measured: Literal["state", "displacement"] = "state",
    load: Literal["corrected", "printed"] = "corrected",
) -> GeneralizedPlant:
    """Build the thesis's air-bearing model, (8.46), as a generalised plant.

    Each direction is a chain ground, bearing (x_m, y_m, z_m), brush (x, y, z); the states are
    (x_m, dx_m, x, dx, y_m, ...), displacements in m and velocities in m/s.

    Parameters
    ----------
    parameters : AirBearingParameters, optional
        :meth:`AirBearingParameters.as_published` by default.
    dissipation : float, optional
        Share of the energy lost per cycle, (8.23); 0 gives the undamped model (8.45).
    actuation : {"displacement", "force"}, optional
        Where u enters: into the six displacement equations, in m/s (10.40), or as six forces
        on bearing and brush, in N (10.41).
    measured : {"state", "displacement"}, optional
        y: the twelve states, C = I, or the six displacements (10.75).
    load : {"corrected", "printed"}, optional
        How w enters: (8.47) by default, or (10.39) as printed, where F_x drives y and F_y
        drives x; only for comparison with the thesis's tables.

    Returns
    -------
    GeneralizedPlant
        w = (F_x, F_y, F_z, F_p) in N, z = the six displacements in m. F_x, F_y and F_p act
        against their coordinate, F_z along it.

    Raises
    ------
    InvalidInputError
        If an option is unknown or a value is not physical.

    References
    ----------
    M.L. Postma, Polishing robot: vibrations due to impact, equations (8.45) to (8.47),
    (10.38) to (10.42) and (10.75).

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.air_bearing(actuation="force")
    >>> plant.nx, plant.nw, plant.nu, plant.nz, plant.ny
    (12, 4, 6, 6, 12)
    """
    p = or_default("parameters", parameters, AirBearingParameters)
    one_of("actuation", actuation, ("displacement", "force"))
    one_of("measured", measured, ("state", "displacement"))
    one_of("load", load, ("corrected", "printed"))

    model = air_bearing_model(p, dissipation).matrices
    mass, position, velocity = np.diag(model.M)[:, None], np.eye(12)[::2], np.eye(12)[1::2]
    A = position.T @ velocity
    A[1::2, ::2], A[1::2, 1::2] = -model.K / mass, -model.C / mass
    moves = actuation == "displacement"
    B2 = position.T if moves else velocity.T / mass.T
    B1 = velocity.T @ (model.B / mass)
    if load == "printed":
        B1[:, [0, 1]] = B1[:, [1, 0]]
    states = [name for q in COORDINATES for name in (q, f"d{q}")]
    measurements = states if measured == "state" else COORDINATES
    units = {name: "m/s" if name.startswith("d") else "m" for name in states}
    units |= {f"measured_{name}": units[name] for name in measurements}
    units |= dict.fromkeys(FORCES, "N")
    units |= {f"u_{q}": "m/s" if moves else "N" for q in COORDINATES}
    return GeneralizedPlant.from_matrices(
        A,
        B1,
        B2,
        position,
        np.eye(12) if measured == "state" else position,
        states=states,
        disturbances=FORCES,
        controls=[f"u_{q}" for q in COORDINATES],
        performance=COORDINATES,
        measurements=[f"measured_{name}" for name in measurements],
        units=units,
    )


# Mechanical model: masses, springs and dampers.


def air_bearing_model(
    parameters: AirBearingParameters | None = None, dissipation: float = 0.001
) -> MechanicalModel:
    """Return the air bearing of :func:`robustpolish.air_bearing` as masses and springs.

    Equations (8.46) in the signs of (8.47): inputs are the brush forces F_x, F_y, F_z and F_p,
    outputs the six displacements. With dissipation 0 the dampers are there, with damping 0, so
    that a refit can find them.

    Parameters
    ----------
    parameters : AirBearingParameters, optional
        :meth:`AirBearingParameters.as_published` by default.
    dissipation : float, optional
        Share of the energy lost per cycle, (8.23).

    Returns
    -------
    MechanicalModel

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.polishing.air_bearing_model().free
    ('x_m', 'x', 'y_m', 'y', 'z_m', 'z')
    """
    p = AirBearingParameters() if parameters is None else parameters
    c = p.damping(dissipation)
    # Of each axis: mass, springs to ground and between, and where a damper to ground is and how
    # large it and the one between are.
    across = (p.m_x, p.k_t, p.k_x, "{}_m", c.c_A, c.c_D)
    rows = {"x": across, "y": across, "z": (p.m_z, p.k_A, p.k_z, "{}", c.c_Z, c.c_R)}
    dofs, springs, dampers = [], [], []
    for axis, (mass, k_ground, k, damped, c_ground, c_between) in rows.items():
        bearing = f"{axis}_m"
        dofs += [Dof(bearing, mass, axis=axis), Dof(axis, p.m_t, axis=axis)]
        springs += [Spring((bearing, "ground"), k_ground), Spring((bearing, axis), k)]
        dampers += [
            Damper((damped.format(axis), "ground"), c_ground),
            Damper((bearing, axis), c_between),
        ]
    loads = [("F_x", "x", -1.0), ("F_y", "y", -1.0), ("F_z", "z", 1.0), ("F_p", "z_m", -1.0)]
    return MechanicalModel(
        dofs=tuple(dofs),
        springs=tuple(springs),
        dampers=tuple(dampers),
        inputs=tuple(Input(name, (on, "ground"), gain=gain) for name, on, gain in loads),
        outputs=tuple(Output(dof.name, (dof.name, "ground")) for dof in dofs),
        name="air bearing",
    )


# Sensors, actuators and computer, with their limits.


@dataclass(frozen=True, repr=False)
class PolishingHardware(Quantities):
    """Sensors, actuators and computer of the polishing robot, for x and y each.

    Force control at the brush: a ring of electromagnets in the nose of the air bearing pulls at the
    brush's hub without touching it, and the bearing takes the reaction. Two displacement sensors
    beside them measure the gap between hub and nose. So force and measurement act between the
    same two bodies, at the same place.

    Of the thesis's six forces the other four are left out. A force on the bearing alone would need
    a frame beside the robot and moves the brush by 1/360 of what the same force at the brush
    does. A pair in z could do nothing about the largest deviation: half a period of that mode is
    over within the delays of sensor, computer and actuator.

    The numbers are typical of their kinds of devices and belong to no product; put in those of
    your data sheets. Infinite bandwidths and no noise or delay stand for ideal parts.

    Parameters
    ----------
    sensor_bandwidth_hz : float
        Where a sensor's gain has fallen by 3 dB, in Hz; its low-pass is the anti-aliasing filter.
    sensor_noise : float
        RMS noise of a reading, in m, over the sensor's bandwidth.
    actuator_bandwidth_hz : float
        Where an actuator's gain has fallen by 3 dB, in Hz.
    actuator_limit : float
        Largest force, in N.
    sample_rate_hz : float
        In Hz.
    computation_delay : float
        From a sample until its force is put out, in s.

    Raises
    ------
    InvalidInputError
        If a number is not positive (noise and delay may be zero; bandwidths and limit may be
        infinite), or if the computation takes more than ten periods.

    Examples
    --------
    >>> import robustpolish as rp
    >>> hardware = rp.polishing.PolishingHardware(sample_rate_hz=50e3)
    >>> round(hardware.period * 1e6), round(hardware.lag * 1e6)
    (20, 130)
    >>> hardware.table()[3][:3]
    ('actuator_limit', 20.0, 'N')
    """

    _caption = ("Polishing hardware", "part")
    sensor_bandwidth_hz: float = quantity(
        10e3,
        "Hz",
        "typical of eddy-current displacement sensors: 10 to 100 kHz; set to half the sample rate",
    )
    sensor_noise: float = quantity(
        20e-9,
        "m",
        "typical of eddy-current sensors of 0.5 mm range: some tens of nm RMS at 10 kHz "
        "(capacitive ones: a few nm, but they dislike slurry)",
    )
    actuator_bandwidth_hz: float = quantity(
        2e3,
        "Hz",
        "typical of magnetic-bearing actuators with current amplifiers: 1 to 3 kHz for small ones",
    )
    actuator_limit: float = quantity(
        20.0,
        "N",
        "typical of electromagnets around a hub of 20 mm: some tens of N; twice the brush's peak",
    )
    sample_rate_hz: float = quantity(
        20e3, "Hz", "typical of real-time controller boards with a processor: 10 to 50 kHz"
    )
    computation_delay: float = quantity(
        25e-6,
        "s",
        "typical of such boards: conversion, some hundred multiplications, conversion back",
    )

    def __post_init__(self) -> None:
        """Check every field."""
        endless = ("sensor_bandwidth_hz", "actuator_bandwidth_hz", "actuator_limit")
        zero = ("sensor_noise", "computation_delay")
        check_quantities(self, zero=zero, infinite=endless)
        if self.computation_delay > 10 * self.period:
            remedy = "Check its unit, or sample more slowly."
            want = f"at most ten periods of {self.period:.4g} s"
            raise invalid("computation_delay", self.computation_delay, want, remedy)

    @property
    def period(self) -> float:
        """Time between samples, in s."""
        return 1 / self.sample_rate_hz

    @property
    def loop_delay(self) -> float:
        """Computation and the half period that a hold delays on average, in s."""
        return self.computation_delay + self.period / 2

    @property
    def lag(self) -> float:
        """All delays and time constants of the loop outside the machine, in s."""
        corners = (self.sensor_bandwidth_hz, self.actuator_bandwidth_hz)
        return self.loop_delay + sum(1 / (2 * math.pi * corner) for corner in corners)

    @property
    def noise_density(self) -> float:
        """Two-sided density of the sensor's noise, in m per square root of Hz.

        Of the RMS over the noise bandwidth of a low-pass of first order; of that up to half the
        sample rate if the sensor is ideally fast.
        """
        band = min(math.pi / 2 * self.sensor_bandwidth_hz, self.sample_rate_hz / 2)
        return self.sensor_noise / math.sqrt(2 * band)


CONTROLLED = ("x", "y")
_LOADS = {"x": ("F_x",), "y": ("F_y",), "z": ("F_z", "F_p")}


def polishing_plant(
    hardware: PolishingHardware | None = None,
    parameters: AirBearingParameters | None = None,
    dissipation: float = 0.001,
    axes: Sequence[str] = ("x", "y", "z"),
) -> GeneralizedPlant:
    """Build the air bearing with actuators between bearing and brush and sensors beside them.

    Parameters
    ----------
    hardware : PolishingHardware, optional
    parameters : AirBearingParameters, optional
    dissipation : float, optional
        As in :func:`robustpolish.air_bearing`.
    axes : sequence of str, optional
        Some of x, y and z, which share nothing; z has no actuator.

    Returns
    -------
    GeneralizedPlant
        Continuous, without the computer's sampling and delay, which `Design.discretize` adds. Its
        controls u_x and u_y are commands in N, of forces on the brush whose reaction the
        bearing takes; its measurements gap_x and gap_y are brush minus bearing in m; its
        disturbances the brush's forces and, if the sensors have noise, noise_gap_x and noise_gap_y;
        its performance outputs the displacements x, y and z of the brush.

    Raises
    ------
    InvalidInputError
        If an argument is not physical, or no axis with an actuator is left.

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.polishing.polishing_plant()
    >>> plant.control_names, plant.measurement_names, plant.limits["u_x"]
    (('u_x', 'u_y'), ('gap_x', 'gap_y'), 20.0)
    """
    parts = or_default("hardware", hardware, PolishingHardware)
    whole = air_bearing(parameters, dissipation, "force", "displacement")
    chosen = [axis for axis in _LOADS if axis in axes]
    active = [axis for axis in chosen if axis in CONTROLLED]
    if not active or set(axes) - set(_LOADS):
        raise invalid("axes", axes, "some of 'x', 'y', 'z', one of them x or y", "Name axes.")
    numbers = [list(_LOADS).index(axis) for axis in chosen]
    states = [4 * i + k for i in numbers for k in range(4)]
    columns = [whole.disturbance_names.index(name) for axis in chosen for name in _LOADS[axis]]
    # Rows of the displacements (bearing, brush) of each axis: the pair of a force and its
    # reaction, and the place of the brush.
    pairs = np.kron(np.eye(3), [[-1.0], [1.0]])[:, numbers[: len(active)]]
    brush = np.kron(np.eye(3), [[0.0, 1.0]])[numbers]
    controls, gaps = [f"u_{axis}" for axis in active], [f"gap_{axis}" for axis in active]
    plant = whole.replace(
        B2=whole.B2 @ pairs,
        C1=brush @ whole.C1,
        C2=pairs.T @ whole.C2,
        controls=controls,
        performance=chosen,
        measurements=gaps,
        units=dict.fromkeys(controls, "N") | dict.fromkeys(gaps, "m"),
    ).part(states=states, disturbances=columns)
    if math.isfinite(parts.actuator_bandwidth_hz):
        plant = plant.with_actuator(controls, parts.actuator_bandwidth_hz)
    if math.isfinite(parts.actuator_limit):
        plant = plant.with_actuator(controls, limit=parts.actuator_limit)
    if math.isfinite(parts.sensor_bandwidth_hz):
        plant = plant.with_sensor(gaps, parts.sensor_bandwidth_hz)
    if parts.sensor_noise:
        plant = plant.with_sensor(gaps, noise=parts.noise_density)
        noises = dict.fromkeys((f"noise_{gap}" for gap in gaps), "s^0.5")
        plant = plant.rewired(plant.wiring, units={**plant.units, **noises})
    return plant
