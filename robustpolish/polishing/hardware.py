"""Hardware of the polishing controller, and the air bearing with actuators and gap sensors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robustpolish.base.checks import invalid
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.polishing.air_bearing import AirBearingParameters, air_bearing
from robustpolish.polishing.quantities import Quantities, check_quantities, or_default, quantity

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
