"""The controller of one axis that can be built: the fastest that keeps its margins."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import control
import numpy as np

from robustpolish.errors import InfeasibleError, RobustPolishError
from robustpolish.implementation import SampledDesign, emulated, plant_at_samples
from robustpolish.loops import DiskMargin, LoopRequirements
from robustpolish.loops.given_loop import loop_of
from robustpolish.loops.loop import Loop
from robustpolish.loops.margins.disk import disk_of
from robustpolish.models import (
    AirBearingParameters,
    GeneralizedPlant,
    PolishingHardware,
    polishing_plant,
)
from robustpolish.synthesis import Design, given_controller, output_feedback


@dataclass(frozen=True)
class BuildPolicy:
    """Weights, trials and what a trial has to survive.

    Attributes
    ----------
    fastest, ratio, trials : float, float, int
        Bandwidths that are tried: times the lag of the hardware 1.3 rad first, where no loop keeps
        its margins any more, then 7 % slower each time, down to a tenth.
    noise : float
        Error of the measurement that the loop has to bear, in units of the deflection by the
        force that it has to bear. 12 gives margins of 6 to 7 dB at every bandwidth; with 1 they
        are 4 to 5 dB.
    bearing : float
        Weight of the bearing's motion over that of the brush. 1.4 turns the bearing's own mode, at
        2 kHz with hardly any damping, where it would only be ridden out with a notch, into one
        that is damped: the loop then bears errors of its frequency.
    integral_share, integral_leak : float
        Integral action begins at a fiftieth of the bandwidth and ends at a hundredth of that: it
        takes the slow part of the load and costs a degree of phase.
    actuator_loss : float
        Part of the actuator's bandwidth that may be missing: 30 %.
    stiffness_error : float
        Error of the bearing's stiffness that the loop has to survive: 5 %, 2.5 % of a frequency, as
        good as a model of a modal test is.
    delay_order : int
        Order of the Pade model of the delay in synthesis: right to a phase of 3 rad.
    deviation_window : float
        Seconds over which limits of hardware are compared: the landing is over after 0.1 s, and it
        makes the largest deviations.
    """

    fastest: float = 1.3
    ratio: float = 0.93
    trials: int = 33
    noise: float = 12.0
    bearing: float = 1.4
    integral_share: float = 0.02
    integral_leak: float = 0.01
    actuator_loss: float = 0.3
    stiffness_error: float = 0.05
    delay_order: int = 3
    deviation_window: float = 0.1


POLICY = BuildPolicy()


@dataclass(frozen=True)
class AxisProblem:
    """One axis of the machine with its hardware.

    Attributes
    ----------
    axis : str
    hardware : PolishingHardware
    parameters : AirBearingParameters
    dissipation : float
    """

    axis: str
    hardware: PolishingHardware
    parameters: AirBearingParameters
    dissipation: float

    def plant(self) -> GeneralizedPlant:
        """Return the axis with actuator and sensor, without the computer's delay."""
        return polishing_plant(self.hardware, self.parameters, self.dissipation, self.axis)

    def frequencies(self) -> tuple[float, float]:
        """Return the axis's own frequencies in Hz, upper and lower."""
        upper, lower = self.parameters.natural_frequencies()["x"]
        return upper / (2 * math.pi), lower / (2 * math.pi)

    @property
    def prewarp_hz(self) -> float | None:
        """Where the sampled controller is right exactly: at the upper mode, if samples show it."""
        upper = self.frequencies()[0]
        return upper if upper < 0.4 * self.hardware.sample_rate_hz else None


@dataclass(frozen=True, eq=False)
class AxisDesign:
    """The controller of an axis, continuous and sampled.

    Attributes
    ----------
    problem : AxisProblem
    stiffness : float
        The stiffness against which the weights were set, in N/m.
    weighted : Design
        What the synthesis returned, on the weighted plant.
    continuous : Design
        The controller on the axis itself, its delay included.
    sampled : SampledDesign
    disk : DiskMargin
        Of the sampled loop.
    """

    problem: AxisProblem
    stiffness: float
    weighted: Design
    continuous: Design
    sampled: SampledDesign
    disk: DiskMargin


def weighted_plant(
    problem: AxisProblem, stiffness: float, integral: control.StateSpace
) -> GeneralizedPlant:
    """Return the plant that the synthesis sees.

    A force at the command and an error of the measurement come in; deflection of brush and
    bearing, as forces by the wanted stiffness, and the command go out. So its norm bounds S, T,
    K S and G S at once, from which margins come, and the bearing's motion besides. The integral
    action stands in the plant and goes to the controller afterwards.
    """
    hardware, gap = problem.hardware, f"gap_{problem.axis}"
    bare = replace(hardware, sensor_noise=0.0, actuator_limit=math.inf)
    plant = AxisProblem(problem.axis, bare, problem.parameters, problem.dissipation).plant()
    command, (name,) = f"u_{problem.axis}", plant.control_names
    bearing = np.zeros((1, plant.nx))
    bearing[0, plant.states.index(f"{problem.axis}_m")] = 1.0
    push = np.zeros((plant.nx, 1))
    push[plant.states.index(f"d{problem.axis}_m"), 0] = -1 / problem.parameters.m_x
    plant = plant.with_filter(command, integral)
    grown = plant.nx - len(push)
    push = np.vstack([push, np.zeros((grown, 1))])
    bearing = np.hstack([bearing, np.zeros((1, grown))])
    plant = plant.replace(
        B1=np.hstack([plant.B2, push, np.zeros((plant.nx, 1))]),
        C1=stiffness * np.vstack([plant.C1, POLICY.bearing * bearing, np.zeros((1, plant.nx))]),
        D11=np.zeros((3, 3)),
        D12=np.array([[0.0], [0.0], [1.0]]),
        D21=np.array([[0.0, 0.0, POLICY.noise / stiffness]]),
        disturbances=["at_command", "at_bearing", f"error_{gap}"],
        performance=["brush", "bearing", "command"],
    )
    if not hardware.loop_delay:
        return plant
    return plant.with_delay(name, hardware.loop_delay, order=POLICY.delay_order)


def design_axis(problem: AxisProblem, requirements: LoopRequirements) -> AxisDesign:
    """Design the controller of an axis: the fastest that keeps what is asked.

    Raises
    ------
    InfeasibleError
        If no bandwidth that was tried keeps the margins.
    """
    lag = problem.hardware.lag
    for wanted in _bandwidths(lag):
        found = _trial(problem, wanted, requirements)
        if found is not None:
            return found
    raise InfeasibleError(
        f"hardware: of {POLICY.trials} controllers with bandwidths from "
        f"{POLICY.fastest / lag / (2 * math.pi):.3g} Hz downwards none keeps "
        f"{requirements.disk_gain_db:g} dB and {requirements.disk_phase_deg:g} deg of disk margin "
        f"with delays and lags of {lag:.3g} s. Choose faster parts."
    )


def _bandwidths(lag: float) -> Iterator[float]:
    for k in range(POLICY.trials):
        yield POLICY.fastest * POLICY.ratio**k / lag


def _trial(
    problem: AxisProblem, bandwidth: float, requirements: LoopRequirements
) -> AxisDesign | None:
    """Design for a bandwidth in rad/s, and return the design if it keeps what is asked."""
    stiffness = problem.parameters.m_t * bandwidth**2
    corner = POLICY.integral_share * bandwidth
    integral: Any = control.ss(control.tf([1.0, corner], [1.0, POLICY.integral_leak * corner]))
    weighted = output_feedback(weighted_plant(problem, stiffness, integral))
    controller: Any = control.series(weighted.controller, integral)
    plant, hardware = problem.plant(), problem.hardware
    delayed = plant
    if hardware.loop_delay:
        order = POLICY.delay_order
        delayed = plant.with_delay(plant.control_names, hardware.loop_delay, order=order)
    if not _keeps(delayed, controller, requirements):
        return None
    # Proofs take longest: they come when all else is known.
    code = emulated(controller, hardware.period, prewarp_hz=problem.prewarp_hz)
    disk = disk_at_samples(plant, code, hardware)
    if disk is None or disk.alpha < requirements.disk or not survives(problem, code):
        return None
    try:
        continuous = given_controller(delayed, controller)
        sampled = given_controller(plant, controller).discretize(
            hardware.period, hardware.computation_delay, prewarp_hz=problem.prewarp_hz
        )
    except RobustPolishError:
        return None
    return AxisDesign(problem, stiffness, weighted, continuous, sampled, disk)


def _keeps(
    plant: GeneralizedPlant, controller: control.StateSpace, asked: LoopRequirements
) -> bool:
    disk = _disk(loop_of(plant, controller))
    return disk is not None and disk.alpha >= asked.disk


def _disk(loop: Loop) -> DiskMargin | None:
    """Return the disk margin at the control, which costs a tenth of all margins."""
    return disk_of(loop.balanced_peak(loop.at("input", [0]))) if loop.stability else None


def _loop_at_samples(
    plant: GeneralizedPlant, controller: control.StateSpace, hardware: PolishingHardware
) -> Loop:
    return loop_of(plant_at_samples(plant, hardware.period, hardware.computation_delay), controller)


def disk_at_samples(
    plant: GeneralizedPlant, controller: control.StateSpace, hardware: PolishingHardware
) -> DiskMargin | None:
    """Return the disk margin at the control of the sampled loop; None if that is unstable."""
    return _disk(_loop_at_samples(plant, controller, hardware))


def changed(problem: AxisProblem) -> dict[str, AxisProblem]:
    """Return the machines, by what is different, on which the loop has to stay stable."""
    slow = (1 - POLICY.actuator_loss) * problem.hardware.actuator_bandwidth_hz
    machines = {}
    if math.isfinite(slow):
        hardware = replace(problem.hardware, actuator_bandwidth_hz=slow)
        what = f"actuator bandwidth {100 * POLICY.actuator_loss:g} % lower"
        machines[what] = replace(problem, hardware=hardware)
    p = problem.parameters
    for sign, word in ((-1, "lower"), (1, "higher")):
        factor = 1 + sign * POLICY.stiffness_error
        stiff = replace(
            p,
            bearing_stiffness=p.bearing_stiffness * factor,
            bearing_torsional_stiffness=p.bearing_torsional_stiffness * factor,
        )
        what = f"bearing's stiffness {100 * POLICY.stiffness_error:g} % {word}"
        machines[what] = replace(problem, parameters=stiff)
    return machines


def survives(problem: AxisProblem, controller: control.StateSpace) -> bool:
    """Tell whether the sampled loop is stable on every changed machine."""
    return all(
        _loop_at_samples(machine.plant(), controller, machine.hardware).stability
        for machine in changed(problem).values()
    )
