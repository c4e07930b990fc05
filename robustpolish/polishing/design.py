"""Controller design for the air bearing, and its simulation under the forces of the brush.

What can be built is a sampled output feedback: for each axis an H-infinity design is repeated with
falling bandwidth until the sampled loop keeps its disk margins and stays stable with slower
actuators and other stiffnesses.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any, Literal

import control
import numpy as np
import xarray as xr

from robustpolish.base.checks import described, invalid, one_of
from robustpolish.base.results import Card, Table
from robustpolish.closed_loop.simulate import SAME_LOAD, ControllerComparison, simulate, tabulate
from robustpolish.errors import InfeasibleError, RobustPolishError
from robustpolish.implementation.certify_sampled import certify_sampled, last_stable
from robustpolish.implementation.realization import emulated
from robustpolish.implementation.sampled.certificate import SampledCertificate
from robustpolish.implementation.sampled_design import SampledDesign, plant_at_samples
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.linear.systems import named_system
from robustpolish.loops.analysis import LoopAnalysis, model_analysis
from robustpolish.loops.disk_margins import DiskMargin, disk_of
from robustpolish.loops.loop import Loop, loop_of
from robustpolish.loops.requirements import LoopRequirements
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.polishing.air_bearing import (
    AirBearingParameters,
    PolishingHardware,
    air_bearing,
    polishing_plant,
)
from robustpolish.polishing.ideal import BrushDesign, ideal_against_brush
from robustpolish.polishing.quantities import or_default
from robustpolish.polishing.simulate import simulate_brush
from robustpolish.synthesis.design import Design, given_controller, largest_period
from robustpolish.synthesis.output_feedback.output_feedback import output_feedback

# Controller of one axis: the largest bandwidth that keeps the margins.


# Bandwidths that are tried: times the lag of the hardware 1.3 rad first, where no loop keeps its
# margins any more, then 7 % slower each time, down to a tenth.
FASTEST, RATIO, TRIALS = 1.3, 0.93, 33
# Error of the measurement that the loop has to bear, in units of the deflection by the force that
# it has to bear: 12 gives margins of 6 to 7 dB at every bandwidth; with 1 they are 4 to 5 dB.
NOISE = 12.0
# Weight of the bearing's motion over that of the brush: 1.4 turns the bearing's own mode, at 2 kHz
# with hardly any damping, where it would only be ridden out with a notch, into one that is damped:
# the loop then bears errors of its frequency.
BEARING = 1.4
# Integral action begins at a fiftieth of the bandwidth and ends at a hundredth of that: it takes
# the slow part of the load and costs a degree of phase.
INTEGRAL_SHARE, INTEGRAL_LEAK = 0.02, 0.01
ACTUATOR_LOSS = 0.3  # part of the actuator's bandwidth that may be missing
# Error of the bearing's stiffness that the loop has to survive: 2.5 % of a frequency, as good as a
# model of a modal test is.
STIFFNESS_ERROR = 0.05
DELAY_ORDER = 3  # of the Pade model of the delay in synthesis: right to a phase of 3 rad
# Seconds over which limits of hardware are compared: the landing is over then, and it makes the
# largest deviations.
DEVIATION_WINDOW = 0.1


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

    @property
    def upper_mode_hz(self) -> float:
        """Upper natural frequency, that of the bearing; nothing above it is modelled."""
        return self.parameters.natural_frequencies()["x"][0] / (2 * math.pi)

    @property
    def prewarp_hz(self) -> float | None:
        """Where the sampled controller is right exactly: at the upper mode, if samples show it."""
        upper = self.upper_mode_hz
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
    plant = replace(problem, hardware=bare).plant()
    plant = plant.with_filter(plant.control_names[0], integral)
    nothing = np.zeros((1, plant.nx))
    bearing, push = nothing.copy(), nothing.T.copy()
    bearing[0, plant.states.index(f"{problem.axis}_m")] = 1.0
    push[plant.states.index(f"d{problem.axis}_m"), 0] = -1 / problem.parameters.m_x
    plant = plant.replace(
        B1=np.hstack([plant.B2, push, nothing.T]),
        C1=stiffness * np.vstack([plant.C1, BEARING * bearing, nothing]),
        D12=np.array([[0.0], [0.0], [1.0]]),
        D21=np.array([[0.0, 0.0, NOISE / stiffness]]),
        disturbances=["at_command", "at_bearing", f"error_{gap}"],
        performance=["brush", "bearing", "command"],
    )
    return _with_loop_delay(plant, hardware)


def _with_loop_delay(plant: GeneralizedPlant, hardware: PolishingHardware) -> GeneralizedPlant:
    """Return the plant with the delays of computation and hold at its controls."""
    if not hardware.loop_delay:
        return plant
    return plant.with_delay(plant.control_names, hardware.loop_delay, order=DELAY_ORDER)


def design_axis(problem: AxisProblem, requirements: LoopRequirements) -> AxisDesign:
    """Design the controller of an axis: the fastest that keeps what is asked.

    Raises
    ------
    InfeasibleError
        If no bandwidth that was tried keeps the margins.
    """
    lag = problem.hardware.lag
    trials = (_trial(problem, FASTEST * RATIO**k / lag, requirements) for k in range(TRIALS))
    for found in filter(None, trials):
        return found
    raise InfeasibleError(
        f"hardware: of {TRIALS} controllers with bandwidths from "
        f"{FASTEST / lag / (2 * math.pi):.3g} Hz downwards none keeps "
        f"{requirements.disk_gain_db:g} dB and {requirements.disk_phase_deg:g} deg of disk margin "
        f"with delays and lags of {lag:.3g} s. Choose faster parts."
    )


def _trial(
    problem: AxisProblem, bandwidth: float, requirements: LoopRequirements
) -> AxisDesign | None:
    """Design for a bandwidth in rad/s, and return the design if it keeps what is asked."""
    stiffness = problem.parameters.m_t * bandwidth**2
    corner = INTEGRAL_SHARE * bandwidth
    integral: Any = control.ss(control.tf([1.0, corner], [1.0, INTEGRAL_LEAK * corner]))
    weighted = output_feedback(weighted_plant(problem, stiffness, integral))
    controller: Any = control.series(weighted.controller, integral)
    plant, hardware = problem.plant(), problem.hardware
    delayed = _with_loop_delay(plant, hardware)
    rough = _disk(loop_of(delayed, controller))
    if rough is None or rough.alpha < requirements.disk:
        return None
    # Proofs take longest: they come when all else is known.
    code = emulated(controller, hardware.period, prewarp_hz=problem.prewarp_hz)
    disk = _disk(_loop_at_samples(plant, code, hardware))
    if disk is None or disk.alpha < requirements.disk:
        return None
    machines = [(machine.plant(), machine.hardware) for machine in changed(problem).values()]
    if not all(_loop_at_samples(other, code, parts).stability for other, parts in machines):
        return None
    try:
        continuous = given_controller(delayed, controller)
        sampled = given_controller(plant, controller).discretize(
            hardware.period, hardware.computation_delay, prewarp_hz=problem.prewarp_hz
        )
    except RobustPolishError:
        return None
    return AxisDesign(problem, stiffness, weighted, continuous, sampled, disk)


def _disk(loop: Loop) -> DiskMargin | None:
    """Return the disk margin at the control, which costs a tenth of all margins."""
    return disk_of(loop.balanced_peak(loop.at("input", [0]))) if loop.stability else None


def _loop_at_samples(
    plant: GeneralizedPlant, controller: control.StateSpace, hardware: PolishingHardware
) -> Loop:
    return loop_of(plant_at_samples(plant, hardware.period, hardware.computation_delay), controller)


def changed(problem: AxisProblem) -> dict[str, AxisProblem]:
    """Return the machines, by what is different, on which the loop has to stay stable."""
    slow = (1 - ACTUATOR_LOSS) * problem.hardware.actuator_bandwidth_hz
    machines = {}
    if math.isfinite(slow):
        hardware = replace(problem.hardware, actuator_bandwidth_hz=slow)
        what = f"actuator bandwidth {100 * ACTUATOR_LOSS:g} % lower"
        machines[what] = replace(problem, hardware=hardware)
    for sign, word in ((-1, "lower"), (1, "higher")):
        factor = 1 + sign * STIFFNESS_ERROR
        names = ("bearing_stiffness", "bearing_torsional_stiffness")
        stiff = {name: getattr(problem.parameters, name) * factor for name in names}
        what = f"bearing's stiffness {100 * STIFFNESS_ERROR:g} % {word}"
        machines[what] = replace(problem, parameters=replace(problem.parameters, **stiff))
    return machines


# Sensitivity to hardware limits: each is relaxed alone, and the controller is designed anew.

BUILDABLE = "as it can be built"
IDEAL_HARDWARE = "the thesis's ideal"


@dataclass(frozen=True)
class HardwareLimit:
    """A row of the table of what reality costs.

    Attributes
    ----------
    what : str
        What is relaxed.
    norm : float
        H-infinity norm from the brush's force to its displacement along the axis, in m/N, of
        the sampled loop; nan if no design was found.
    deviation : float
        Largest deviation along the axis during the landing, in m.
    stiffness : float
        That the weights asked for, in N/m; nan where there were none.
    effort : float
        Largest force of the actuator, in N.

    Examples
    --------
    >>> from robustpolish.polishing import HardwareLimit
    >>> HardwareLimit("no delay", 1e-6, 3e-6, 1e7, 8.0).norm
    1e-06
    """

    what: str
    norm: float
    deviation: float
    stiffness: float
    effort: float


def relaxed_hardware(hardware: PolishingHardware) -> Iterator[tuple[str, PolishingHardware]]:
    """Yield the hardware with one limit relaxed at a time, and what that is."""
    for what, changes in {
        "ideal sensors": {"sensor_bandwidth_hz": math.inf, "sensor_noise": 0.0},
        "ideal actuators": {"actuator_bandwidth_hz": math.inf, "actuator_limit": math.inf},
        "no computation delay": {"computation_delay": 0.0},
        "ten times the sampling": {"sample_rate_hz": 10 * hardware.sample_rate_hz},
    }.items():
        yield what, replace(hardware, **changes)


def limits_of_hardware(
    design: AxisDesign, ideal: Design, load: xr.Dataset, requirements: LoopRequirements
) -> tuple[HardwareLimit, ...]:
    """Return the rows: without control, as built, one limit relaxed at a time, the ideal."""
    problem, axis, plant = design.problem, design.problem.axis, ideal.plant
    start = load["time"].values[0]
    landing = load.sel(time=slice(start, start + DEVIATION_WINDOW))
    output = plant.performance_names.index(axis)
    channel = output, plant.disturbance_names.index(f"F_{axis}")

    def row(what: str, found: AxisDesign) -> HardwareLimit:
        run = found.sampled.simulate(landing)
        sizes = _largest(run, axis), found.stiffness, _largest(run, f"u_{axis}")
        return HardwareLimit(what, found.sampled.certificate.achieved, *sizes)

    free = _largest(simulate(plant, landing), axis)
    norm = hinf_norm(plant.open_loop[channel]).value
    rows = [HardwareLimit("without control", norm, free, math.nan, 0.0), row(BUILDABLE, design)]
    for what, hardware in relaxed_hardware(problem.hardware):
        try:
            rows.append(row(what, design_axis(replace(problem, hardware=hardware), requirements)))
        except RobustPolishError:
            rows.append(HardwareLimit(what, math.nan, math.nan, math.nan, math.nan))
    run = simulate(ideal, landing)
    norm = hinf_norm(plant.state_feedback_loop(ideal.controller.D)[channel]).value
    sizes = _largest(run, axis), math.nan, _largest(run, f"u_{axis}")
    return (*rows, HardwareLimit(IDEAL_HARDWARE, norm, *sizes))


def _largest(run: xr.Dataset, name: str) -> float:
    return float(np.abs(run[name]).max())


AXES = ("x", "y")
WITHOUT, WITH, IDEAL = "without control", "with control", "thesis's ideal"


@dataclass(frozen=True, eq=False, repr=False)
class BuildableBrushDesign(BrushDesign):
    """A controller with sensors, actuators, delay and sampling, and the thesis's ideal beside it.

    Of the attributes of :class:`BrushDesign`, `design` is the continuous controller on the plant
    with hardware, the delays of computation and hold included; `comparison` has a row for the
    sampled loop with its limits ("with control") and one for the ideal.

    Attributes
    ----------
    plant, parameters, disturbance, design, control_weight, gain_bound : optional
    open_loop_norm, closed_loop_norm, comparison : optional
        As of :class:`BrushDesign`.
    hardware : PolishingHardware
        What it is built of.
    requirements : LoopRequirements
        What the loop was asked for.
    sampled : SampledDesign
        What runs on the machine, certified with hold and delay as they are.
    loop : LoopAnalysis
        The sampled loop, exact at its samples: margins, noise, words.
    survived : mapping of str to SampledCertificate
        The same code on other machines: slower actuators, a softer and a stiffer bearing.
    axis : AxisDesign
        The axis y, of whose controller x has the same.
    run : xarray.Dataset
        The sampled loop under the brush's load, with the share of samples at the limit.
    ideal : BrushDesign
        The thesis's state feedback under the same load.
    ideal_loop : LoopAnalysis
        What its loop is like.

    Examples
    --------
    >>> import robustpolish as rp
    >>> job = rp.polishing.design_against_brush(duration=0.01)
    >>> job.sampled.certificate.valid, job.loop.buildable
    (True, True)
    >>> bool(job.loop.disk_margin.gain_db > 6), bool(job.ideal_loop.delay_margin < 1e-6)
    (True, True)
    >>> job.verdict().split(":")[0]
    'The controller can be built'
    >>> [table.caption for table in job.tables()]
    ["Built, beside the thesis's ideal", 'The same code on other machines']
    """

    hardware: PolishingHardware
    requirements: LoopRequirements
    sampled: SampledDesign
    loop: LoopAnalysis
    survived: MappingProxyType[str, SampledCertificate]
    axis: AxisDesign
    run: xr.Dataset
    ideal: BrushDesign
    ideal_loop: LoopAnalysis

    @cached_property
    def limits(self) -> tuple[HardwareLimit, ...]:
        """What each limit of the hardware costs in y; designed when it is first asked for."""
        load = self.disturbance
        return limits_of_hardware(self.axis, self.ideal.design, load, self.requirements)

    @cached_property
    def largest_period(self) -> float:
        """Longest period in s at which the loop stays stable, the delay growing with it."""
        share = self.hardware.computation_delay / self.hardware.period
        plain = given_controller(self.axis.problem.plant(), self.axis.continuous.controller)
        return largest_period(plain, delay_periods=share)

    @cached_property
    def slowest_actuator_hz(self) -> float:
        """Bandwidth of the actuators in Hz below which the loop is unstable; 0 if there is none."""
        problem, hardware = self.axis.problem, self.hardware
        nominal = hardware.actuator_bandwidth_hz
        if not math.isfinite(nominal):
            nominal = hardware.sample_rate_hz

        def stable(lag: float) -> bool:
            slow = replace(hardware, actuator_bandwidth_hz=1 / lag)
            plant = replace(problem, hardware=slow).plant()
            return bool(_loop_at_samples(plant, self.axis.sampled.controller, hardware).stability)

        return 1 / last_stable(stable, 1 / nominal, 1e3 / nominal)

    @property
    def noise_effort(self) -> dict[str, float]:
        """RMS of each control in N that the sensors' noise alone makes."""
        power = dict.fromkeys(self.plant.control_names, 0.0)
        for row in self.loop.noise:
            power[row.control] += (row.rms * self.hardware.sensor_noise) ** 2
        return {name: math.sqrt(value) for name, value in power.items()}

    @property
    def static_deflection(self) -> float:
        """What the mean of the load leaves of z in m, over the second half of the time."""
        late = self.disturbance.isel(time=slice(self.disturbance.sizes["time"] // 2, None))
        force = np.array([float(late[name].mean()) for name in self.plant.disturbance_names[:4]])
        gain = np.asarray(control.dcgain(self.ideal.plant.open_loop), dtype=float)
        return float(gain[self.ideal.plant.performance_names.index("z")] @ force)

    def verdict(self) -> str:
        """Say in some sentences what was found.

        Returns
        -------
        str

        Examples
        --------
        See :class:`BuildableBrushDesign`.
        """
        h, c, disk = self.hardware, self.sampled.certificate, self.loop.disk_margin
        can = "can be built" if self.good else "does NOT keep all that is asked of it"
        improvement = self.comparison.table["improvement"].sel(row=WITH)
        gained = " and ".join(
            f"{axis} by {float(improvement.sel(signal=axis)):.1f} %"
            for axis in AXES
            if np.isfinite(improvement.sel(signal=axis))
        )
        most = max(_largest(self.run, name) for name in self.plant.control_names)
        stays = "stable" if c.stable else "unstable"
        others = [what for what, found in self.survived.items() if found.valid]
        return (
            f"The controller {can}: sampled at {h.sample_rate_hz / 1e3:g} kHz with "
            f"{1e6 * h.computation_delay:g} µs of computation its loop is proven {stays}, one "
            f"loop at a time it keeps {disk.gain_db:.2g} dB and {disk.phase_deg:.0f} deg of disk "
            f"margin and bears {1e6 * self.loop.delay_margin:.0f} µs of further delay (the "
            f"thesis's ideal: {1e6 * self.ideal_loop.delay_margin:.2g} µs in all). It is proven "
            f"stable too with {' or with '.join(others) or 'no other machine'}. Under the same "
            f"load it reduces the largest deviation in {gained or 'no axis'}, with forces up to "
            f"{most:.2g} N of {h.actuator_limit:g} N. z has no actuator and stays as it is."
        )

    @property
    def good(self) -> bool:
        """Whether the loop is certified, keeps its margins and survives the other machines."""
        proven = self.design.certificate.valid and self.sampled.certificate.valid
        return proven and self.loop.buildable and all(c.valid for c in self.survived.values())

    def tables(self) -> tuple[Table, ...]:
        """Return what was built beside the ideal, and what it survives, as tables.

        Returns
        -------
        tuple of Table

        Examples
        --------
        See :class:`BuildableBrushDesign`.
        """
        ideal = self.ideal_loop
        slowest = math.nan if ideal.sample_rate is None else ideal.sample_rate.lowest_stable_hz
        figures = {
            "disk margin, one loop at a time [dB]": lambda x: x.disk_margin.gain_db,
            "disk margin, one loop at a time [deg]": lambda x: x.disk_margin.phase_deg,
            "disk margin, all inputs at once [dB]": lambda x: x.at_once["inputs"].disk.gain_db,
            "delay that it bears besides its own [µs]": lambda x: 1e6 * x.delay_margin,
        }
        rows = (
            *((what, figure(self.loop), figure(ideal)) for what, figure in figures.items()),
            ("unstable below a sample rate of [kHz]", 1e-3 / self.largest_period, slowest / 1e3),
            ("measured signals", len(self.plant.measurement_names), self.ideal.plant.ny),
            ("actuators", len(self.plant.control_names), self.ideal.plant.nu),
        )
        survived = tuple((what, c.valid, c.achieved) for what, c in self.survived.items())
        head = ("machine", "proven", "norm of x and y [m/N]")
        return (
            Table("Built, beside the thesis's ideal", ("", "built", "ideal"), rows),
            Table("The same code on other machines", head, survived),
        )

    def _card(self) -> Card:
        tables = (*self.comparison._card().tables, *self.tables())
        return Card("Design against the brush", tables, (self.verdict(), self.loop.explain()))


def build_against_brush(
    ideal: BrushDesign,
    hardware: PolishingHardware,
    dissipation: float,
    requirements: LoopRequirements | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> BuildableBrushDesign:
    """Design what can be built for the machine and load of an ideal design."""
    asked = requirements or LoopRequirements(sample_rate_hz=hardware.sample_rate_hz)
    parameters, load = ideal.parameters, ideal.disturbance
    tell("Designing a controller that can be built ...")
    axis = design_axis(AxisProblem("y", hardware, parameters, dissipation), asked)
    plant = polishing_plant(hardware, parameters, dissipation)
    both: Any = control.append(*[axis.continuous.controller for _ in plant.control_names])
    states = [f"k{i + 1}" for i in range(both.nstates)]
    names = plant.measurement_names, plant.control_names
    controller = named_system((both.A, both.B, both.C, both.D), 0, *names, states)
    delayed, weighted = _with_loop_delay(plant, hardware), axis.weighted
    message = (
        f"x and y share nothing and are of one kind: one H-infinity output feedback serves both, "
        f"set to a stiffness of {axis.stiffness:.3g} N/m, the largest that keeps the margins. On "
        f"the weighted plant of one axis its norm is {weighted.certificate.achieved:.4g} "
        f"({weighted.status})."
    )
    origin = {"method": weighted.method, "backend": weighted.backend}
    design = replace(given_controller(delayed, controller), message=message, **origin)
    tell("Certifying the sampled loop ...")
    sampled = given_controller(plant, controller).discretize(
        hardware.period, hardware.computation_delay, prewarp_hz=axis.problem.prewarp_hz
    )
    at_samples = GeneralizedPlant(
        plant_at_samples(plant, hardware.period, hardware.computation_delay),
        plant.ny,
        plant.nu,
        units={name: plant.units[name] for name in sum(names, ()) if name in plant.units},
    )
    survived = {
        what: certify_sampled(
            polishing_plant(machine.hardware, machine.parameters, dissipation, AXES),
            sampled.controller,
            delay=hardware.computation_delay,
        )
        for what, machine in changed(axis.problem).items()
    }
    tell("Simulating the sampled loop under the brush's forces ...")
    run = sampled.simulate(load)
    closed = delayed.closed_loop(controller)
    forces = [i for i, name in enumerate(delayed.disturbance_names) if name.startswith("F_")]
    return BuildableBrushDesign(
        plant=plant,
        parameters=parameters,
        disturbance=load,
        design=design,
        control_weight=None,
        gain_bound=None,
        open_loop_norm=ideal.open_loop_norm,
        closed_loop_norm=hinf_norm(closed[:, forces]),
        comparison=_compared(ideal, run, load),
        hardware=hardware,
        requirements=asked,
        sampled=sampled,
        loop=model_analysis(at_samples, sampled.controller, asked),
        survived=MappingProxyType(survived),
        axis=axis,
        run=run,
        ideal=ideal,
        ideal_loop=model_analysis(ideal.plant, ideal.design.controller, LoopRequirements()),
    )


def _compared(ideal: BrushDesign, run: xr.Dataset, load: xr.Dataset) -> ControllerComparison:
    """Return the table of deviations, largest values taken between samples too."""
    signals = ("x", "y", "z")
    forces = load[list(ideal.plant.disturbance_names)].interp(
        time=run["time"],
        kwargs={"fill_value": "extrapolate"},  # the last may lie a rounding beyond
    )
    for name in forces:
        forces[name].attrs.update(load[name].attrs)
    fine = {WITHOUT: simulate(ideal.plant, forces), WITH: run}
    fine[IDEAL] = simulate(ideal.design, forces)
    thin = max(1, round((run.sizes["time"] - 1) / (load.sizes["time"] - 1)))
    responses = {row: found.isel(time=slice(None, None, thin)) for row, found in fine.items()}
    largest = {
        row: np.array([_largest(run, axis) for axis in signals]) for row, run in fine.items()
    }
    return tabulate(responses, signals, ideal.plant.control_names, SAME_LOAD, largest)


Realisation = Literal["buildable", "ideal"]


def design_against_brush(
    run: int = 1,
    simulator: Literal["physical", "listing"] = "physical",
    *,
    realisation: Realisation | None = None,
    hardware: PolishingHardware | None = None,
    actuation: Literal["force", "displacement"] | None = None,
    norm: Literal["hinf", "h2"] | None = None,
    method: Literal["lmi", "riccati"] | None = None,
    backend: Literal["cvxpy", "picos"] | None = None,
    control_weight: float | None = None,
    gain_bound: float | None = None,
    parameters: AirBearingParameters | None = None,
    dissipation: float = 0.001,
    duration: float = 5.0,
    tell: Callable[[str], None] = lambda _: None,
) -> BrushDesign:
    """Build the machine, disturb it, design a controller, certify it, compare.

    Parameters
    ----------
    run : {1, 2, 3, 4}, optional
        Contact stiffness of the brush (table 9.2).
    simulator : {"physical", "listing"}, optional
        As in :func:`robustpolish.polishing.simulate_brush`.
    realisation : {"buildable", "ideal"}, optional
        "buildable": two gap sensors, two actuators, a computer with its delay and samples, as
        `hardware` says. "ideal": the thesis's state feedback, which measures twelve states
        without noise and applies six forces without delay. By default what can be built, unless an
        option of the ideal is given.
    hardware : PolishingHardware, optional
        Of the buildable controller.
    actuation, norm, method, backend, control_weight, gain_bound : optional
        Of the ideal: as in :func:`robustpolish.air_bearing`, forces by default, and in
        :func:`robustpolish.state_feedback`. Without weight and bound the infimum would be
        zero, at infinite gain; then a force costs 1e-7 m/N and a velocity 1e-8 m per m/s.
    parameters, dissipation : optional
        As in :func:`robustpolish.air_bearing`.
    duration : float, optional
        Simulated time in s.
    tell : callable, optional
        Is told what is being done.

    Returns
    -------
    BrushDesign
        A :class:`BuildableBrushDesign`, which has the ideal beside it, unless the ideal is asked
        for.

    Raises
    ------
    InvalidInputError, InfeasibleError, SolverError
        As the functions above; also if options of both are given, and if no controller keeps its
        margins with the hardware.

    Examples
    --------
    >>> import robustpolish as rp
    >>> job = rp.polishing.design_against_brush(duration=0.05, realisation="ideal")
    >>> job.design.certificate.valid
    True
    >>> bool(job.comparison.table["improvement"].sel(row="with control", signal="y") > 90)
    True
    """
    given: dict[str, Any] = {"actuation": actuation, "norm": norm, "method": method}
    given |= {"backend": backend, "control_weight": control_weight, "gain_bound": gain_bound}
    options = {name: value for name, value in given.items() if value is not None}
    parts = or_default("hardware", hardware, PolishingHardware)
    if realisation is None:
        realisation = "ideal" if options else "buildable"
    one_of("realisation", realisation, ("buildable", "ideal"))
    if realisation == "ideal" and hardware is not None:
        shown = described("hardware of an ideal controller")
        raise invalid("hardware", shown, "none", "Leave it out, or the options of the ideal.")
    if realisation == "buildable" and options:
        name = next(iter(options))
        remedy = "Pass realisation='ideal', or leave it out and set hardware=."
        raise invalid(name, options[name], "nothing for a controller that can be built", remedy)
    machine = or_default("parameters", parameters, AirBearingParameters)
    entry = options.pop("actuation", "force")
    plant = air_bearing(machine, dissipation, entry)

    def load() -> xr.Dataset:
        tell(f"Simulating the brush for {duration:g} s (run {run}, {simulator}) ...")
        return simulate_brush(simulator, run, duration)

    ideal = ideal_against_brush(plant, machine, load, entry, tell, **options)
    if realisation == "ideal":
        return ideal
    return build_against_brush(ideal, parts, dissipation, tell=tell)
