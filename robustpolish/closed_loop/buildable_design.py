"""A controller for the brush that an engineer would put on the machine, and what it is like."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any

import control
import numpy as np
import xarray as xr

from robustpolish.analysis import hinf_norm
from robustpolish.closed_loop.brush_design import BrushDesign
from robustpolish.closed_loop.buildable_axis import (
    POLICY,
    AxisDesign,
    AxisProblem,
    changed,
    design_axis,
)
from robustpolish.closed_loop.comparison import SAME_LOAD, ControllerComparison, tabulate
from robustpolish.closed_loop.limits_of_hardware import HardwareLimit, limits_of_hardware
from robustpolish.closed_loop.simulation import simulate
from robustpolish.display import Card, Table
from robustpolish.implementation import (
    SampledCertificate,
    SampledDesign,
    certify_sampled,
    plant_at_samples,
)
from robustpolish.loops import LoopAnalysis, LoopRequirements
from robustpolish.loops.analysis import model_analysis
from robustpolish.models import GeneralizedPlant, PolishingHardware, polishing_plant
from robustpolish.models.plant.blocks import named_system
from robustpolish.synthesis import Design, given_controller, largest_period

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
    >>> job = rp.design_against_brush(duration=0.01)
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
        controller: Any = self.axis.sampled.controller

        def stable(bandwidth: float) -> bool:
            slow = replace(hardware, actuator_bandwidth_hz=bandwidth)
            plant = replace(problem, hardware=slow).plant()
            sampled: Any = plant_at_samples(plant, hardware.period, hardware.computation_delay)
            loop: Any = control.feedback(sampled, controller, sign=1)
            return bool(np.abs(np.linalg.eigvals(loop.A)).max() < 1)

        low = nominal
        while stable(low):
            low *= 0.95
            if low < 1e-3 * nominal:
                return 0.0
        high = low / 0.95
        for _ in range(20):
            middle = (low + high) / 2
            low, high = (low, middle) if stable(middle) else (middle, high)
        return high

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
        open_loop = self.ideal.plant.open_loop
        gain = np.asarray(control.dcgain(open_loop), dtype=float)
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
        most = max(float(np.abs(self.run[name]).max()) for name in self.plant.control_names)
        stays = "stable" if c.stable else "unstable"
        return (
            f"The controller {can}: sampled at {h.sample_rate_hz / 1e3:g} kHz with "
            f"{1e6 * h.computation_delay:g} µs of computation its loop is proven {stays}, one "
            f"loop at a time it keeps {disk.gain_db:.2g} dB and {disk.phase_deg:.0f} deg of disk "
            f"margin and bears {1e6 * self.loop.delay_margin:.0f} µs of further delay (the "
            f"thesis's ideal: {1e6 * self.ideal_loop.delay_margin:.2g} µs in all). Under the same "
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
        disk, ideal = self.loop.disk_margin, self.ideal_loop.disk_margin
        least = self.ideal_loop.sample_rate
        slowest = math.nan if least is None else least.lowest_stable_hz
        delays = self.loop.delay_margin, self.ideal_loop.delay_margin
        rows = (
            ("disk margin, one loop at a time [dB]", disk.gain_db, ideal.gain_db),
            ("disk margin, one loop at a time [deg]", disk.phase_deg, ideal.phase_deg),
            (
                "disk margin, all inputs at once [dB]",
                _at_once(self.loop),
                _at_once(self.ideal_loop),
            ),
            ("delay that it bears besides its own [µs]", 1e6 * delays[0], 1e6 * delays[1]),
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


def _at_once(loop: LoopAnalysis) -> float:
    return loop.at_once["inputs"].disk.gain_db


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
    controller = _for_both(axis.continuous.controller, plant)
    delayed = plant
    if hardware.loop_delay:
        order = POLICY.delay_order
        delayed = plant.with_delay(plant.control_names, hardware.loop_delay, order=order)
    design = _told(given_controller(delayed, controller), axis)
    tell("Certifying the sampled loop ...")
    sampled = given_controller(plant, controller).discretize(
        hardware.period, hardware.computation_delay, prewarp_hz=axis.problem.prewarp_hz
    )
    names = *plant.measurement_names, *plant.control_names
    at_samples = GeneralizedPlant(
        plant_at_samples(plant, hardware.period, hardware.computation_delay),
        plant.ny,
        plant.nu,
        units={name: plant.units[name] for name in names if name in plant.units},
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


def _for_both(controller: control.StateSpace, plant: GeneralizedPlant) -> control.StateSpace:
    """Return the controller once per axis, by the names of the plant."""
    both: Any = control.append(*[controller for _ in plant.control_names])
    states = [f"k{i + 1}" for i in range(both.nstates)]
    names = plant.measurement_names, plant.control_names, states
    return named_system((both.A, both.B, both.C, both.D), 0, *names)


def _told(design: Design, axis: AxisDesign) -> Design:
    """Return the design with words of the synthesis that it comes from."""
    weighted = axis.weighted
    message = (
        f"x and y share nothing and are of one kind: one H-infinity output feedback serves both, "
        f"set to a stiffness of {axis.stiffness:.3g} N/m, the largest that keeps the margins. On "
        f"the weighted plant of one axis its norm is {weighted.certificate.achieved:.4g} "
        f"({weighted.status})."
    )
    return replace(design, message=message, method=weighted.method, backend=weighted.backend)


def _compared(ideal: BrushDesign, run: xr.Dataset, load: xr.Dataset) -> ControllerComparison:
    """Return the table of deviations, largest values taken between samples too."""
    signals = ("x", "y", "z")
    forces = load[list(ideal.plant.disturbance_names)].interp(time=run["time"])
    for name in forces:
        forces[name].attrs.update(load[name].attrs)
    fine = {WITHOUT: simulate(ideal.plant, forces), WITH: run}
    fine |= {IDEAL: simulate(ideal.design, forces)}
    thin = max(1, round((run.sizes["time"] - 1) / (load.sizes["time"] - 1)))
    responses = {row: found.isel(time=slice(None, None, thin)) for row, found in fine.items()}
    largest = {
        row: np.array([float(np.abs(found[name]).max()) for name in signals])
        for row, found in fine.items()
    }
    return tabulate(responses, signals, ideal.plant.control_names, SAME_LOAD, largest)
