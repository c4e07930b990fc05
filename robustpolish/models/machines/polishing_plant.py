"""The air bearing as an engineer can wire it: a force pair and a gap sensor in x and in y."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from robustpolish.models.machines.air_bearing import air_bearing
from robustpolish.models.machines.air_bearing_parameters import AirBearingParameters
from robustpolish.models.machines.polishing_hardware import PolishingHardware
from robustpolish.models.plant.plant import GeneralizedPlant
from robustpolish.validation import instance_of, invalid

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
    >>> plant = rp.polishing_plant()
    >>> plant.control_names, plant.measurement_names, plant.limits["u_x"]
    (('u_x', 'u_y'), ('gap_x', 'gap_y'), 20.0)
    """
    parts = PolishingHardware() if hardware is None else hardware
    remedy = "Build it with PolishingHardware(...)."
    instance_of("hardware", parts, PolishingHardware, "a PolishingHardware", remedy)
    whole = air_bearing(parameters, dissipation, "force", "displacement")
    chosen = [axis for axis in _LOADS if axis in axes]
    active = [axis for axis in chosen if axis in CONTROLLED]
    if not active or set(axes) - set(_LOADS):
        raise invalid("axes", axes, "some of 'x', 'y', 'z', one of them x or y", "Name axes.")
    places = {axis: 2 * i for i, axis in enumerate(_LOADS)}
    states = [4 * i + k for i, axis in enumerate(_LOADS) if axis in chosen for k in range(4)]
    loads = [name for axis in chosen for name in _LOADS[axis]]
    columns = [whole.disturbance_names.index(name) for name in loads]
    pairs, brush = np.zeros((6, len(active))), np.zeros((len(chosen), 6))
    for k, axis in enumerate(active):
        pairs[places[axis], k], pairs[places[axis] + 1, k] = -1.0, 1.0
    for k, axis in enumerate(chosen):
        brush[k, places[axis] + 1] = 1.0
    controls, gaps = [f"u_{axis}" for axis in active], [f"gap_{axis}" for axis in active]
    names = [whole.states[i] for i in states]
    plant = GeneralizedPlant.from_matrices(
        whole.A[np.ix_(states, states)],
        whole.B1[np.ix_(states, columns)],
        (whole.B2 @ pairs)[states],
        (brush @ whole.C1)[:, states],
        (pairs.T @ whole.C2)[:, states],
        states=names,
        disturbances=loads,
        controls=controls,
        performance=chosen,
        measurements=gaps,
        units={
            **{name: whole.units[name] for name in names},
            **dict.fromkeys((*loads, *controls), "N"),
            **dict.fromkeys((*gaps, *chosen), "m"),
        },
    )
    return _with_hardware(plant, parts)


def _with_hardware(plant: GeneralizedPlant, hardware: PolishingHardware) -> GeneralizedPlant:
    """Return a plant with an actuator at every control and a sensor at every measurement."""
    controls, gaps = plant.control_names, plant.measurement_names
    if math.isfinite(hardware.actuator_bandwidth_hz):
        plant = plant.with_actuator(controls, hardware.actuator_bandwidth_hz)
    if math.isfinite(hardware.actuator_limit):
        plant = plant.with_actuator(controls, limit=hardware.actuator_limit)
    if math.isfinite(hardware.sensor_bandwidth_hz):
        plant = plant.with_sensor(gaps, hardware.sensor_bandwidth_hz)
    if hardware.sensor_noise:
        plant = plant.with_sensor(gaps, noise=hardware.noise_density)
        noises = dict.fromkeys((f"noise_{gap}" for gap in gaps), "s^0.5")
        plant = plant.rewired(plant.wiring, units={**plant.units, **noises})
    return plant
