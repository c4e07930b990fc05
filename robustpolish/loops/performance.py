"""What noise and disturbances make the controls do: size, peak, and how quickly they move."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import control
import numpy as np
import xarray as xr

from robustpolish.base.arrays import SAME, AnyVector, Array, Vector
from robustpolish.implementation.certify_sampled import last_stable
from robustpolish.implementation.realization import integration_rule
from robustpolish.implementation.run import disturbance_columns
from robustpolish.linear.norms.h2 import h2_norm
from robustpolish.linear.norms.hinf import HinfNorm
from robustpolish.linear.response import first_order_hold, linear_response
from robustpolish.loops.loop import PLACES, Loop, MeasuredLoop, Place, from_to, sample_step
from robustpolish.loops.margins import LoopMargins
from robustpolish.loops.requirements import LoopRequirements
from robustpolish.loops.response import LineResponse, Ports, connected, norm_of
from robustpolish.plants.blocks import matrices_of

# Where in frequency a loop works: bandwidths of S and T, gain crossovers, peaks.


@dataclass(frozen=True)
class LoopBandwidth:
    """Frequencies in Hz at which one loop, or the largest singular value of several, changes sides.

    Attributes
    ----------
    name : str
        The signal at which the loop is broken, the others closed; "all" for the largest singular
        value with all signals of the place.
    place : {"input", "output"}
        Of the plant.
    crossover_hz : float
        Highest frequency at which the gain of L is 1; nan if it never is.
    sensitivity_hz : float
        Where S first crosses -3 dB from below: disturbances below it are reduced; nan if S
        is nowhere below.
    complementary_hz : float
        Where T crosses -3 dB from above for the last time; nan if T is nowhere above, infinite
        if it stays above.
    peak_s, peak_t : float
        Peaks of S and T.
    peak_s_hz, peak_t_hz : float
        Where they are.

    Notes
    -----
    Definitions of S. Skogestad, I. Postlethwaite, Multivariable Feedback Control, 2nd ed.,
    section 2.4.5.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> rows = rp.loop_analysis(control.tf([1], [1, 0]), -6.283185307179586).bandwidths
    >>> round(rows[0].crossover_hz, 6), round(rows[0].complementary_hz, 6)
    (1.0, 1.0)
    """

    name: str
    place: Place
    crossover_hz: float
    sensitivity_hz: float
    complementary_hz: float
    peak_s: float
    peak_t: float
    peak_s_hz: float
    peak_t_hz: float


def bandwidths(
    loop: Loop | MeasuredLoop, margins: Sequence[LoopMargins]
) -> tuple[LoopBandwidth, ...]:
    """Return the bandwidths of a stable loop's single loops, and of all signals of a place.

    Parameters
    ----------
    loop : Loop or MeasuredLoop
    margins : sequence of LoopMargins
        Of its single loops, whose gain crossovers are known.

    Returns
    -------
    tuple of LoopBandwidth
    """
    found = []
    for place in PLACES:
        own = [m for m in margins if m.place == place]
        for i, single in enumerate(own):
            crossovers = [c.frequency_hz for c in single.gain_crossovers]
            found.append(_bandwidth(loop, place, single.name, [i], crossovers))
        if len(own) > 1:
            every = loop.response(place).level_crossings(1.0)
            crossovers = [omega / (2 * math.pi) for omega in every]
            found.append(_bandwidth(loop, place, "all", list(range(len(own))), crossovers))
    return tuple(found)


def _bandwidth(
    loop: Loop | MeasuredLoop, place: Place, name: str, signals: list[int], crossovers: list[float]
) -> LoopBandwidth:
    at = loop.at(place, signals)
    peaks = loop.peak(at), loop.peak(at, -1.0, -1.0)
    below = loop.response_around(at).half_power()[0]
    above = loop.response_around(at, -1.0, -1.0).half_power()[1]
    hertz = (w / (2 * math.pi) for w in (below, above))
    sizes, places = (p.value for p in peaks), (p.frequency / (2 * math.pi) for p in peaks)
    return LoopBandwidth(name, place, max(crossovers, default=math.nan), *hertz, *sizes, *places)


# How fast a loop has to be sampled, and how slowly it may be.

# The search goes down from this many samples per time constant of the fastest pole.
_MOST_SAMPLES = 300.0


@dataclass(frozen=True)
class SampleRate:
    """Sampling rates in Hz that a continuous loop needs, by rule and by exact stability.

    Attributes
    ----------
    needed_hz : float
        The largest of `rules`.
    limited_by : str
        The rule that asks for most.
    rules : mapping of str to float
        Rate by rule; their numbers and sources are those of :class:`LoopRequirements`.
    lowest_stable_hz : float
        Above this rate every sampled loop that was tried is stable: the plant with a zero-order
        hold, exactly, the controller by Tustin's rule, and the delay of computation in whole
        samples; infinite if none is stable that was tried, 0 if all are.
    computation_samples : int
        That delay.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> lag = rp.loop_analysis(control.tf([1], [1, 0]), -10).sample_rate
    >>> round(lag.needed_hz / (10 / 6.283185), 1), lag.limited_by
    (36.0, 'phase at the gain crossover')
    >>> round(lag.lowest_stable_hz, 3)  # with a sample of delay 1/T = K
    10.0
    """

    needed_hz: float
    limited_by: str
    rules: dict[str, float]
    lowest_stable_hz: float
    computation_samples: int


def sample_rate(
    loop: Loop,
    margins: Sequence[LoopMargins],
    delay_s: float,
    widths: Sequence[LoopBandwidth],
    asked: LoopRequirements,
) -> SampleRate:
    """Return the rates that a stable continuous loop needs.

    Parameters
    ----------
    loop : Loop
    margins : sequence of LoopMargins
    delay_s : float
        The smallest delay margin.
    widths : sequence of LoopBandwidth
    asked : LoopRequirements
    """
    late = asked.sampling_delay_samples
    crossover = max((c.frequency_hz for m in margins for c in m.gain_crossovers), default=0.0)
    singles = [row.complementary_hz for row in widths if row.name != "all"]
    width = max(filter(math.isfinite, singles), default=0.0)
    sizes = np.abs(loop.rates)
    if loop.delayed is not None:
        # Beyond a phase of its order in rad, a Padé model is no model of its delay.
        lines = loop.delayed.plant.lines
        sizes = sizes[sizes <= min(line.order / line.seconds for line in lines)]
        sizes = np.append(sizes, np.abs(np.linalg.eigvals(loop.controller_matrices[0])))
    fastest = float(sizes.max(initial=0.0))
    rules = {
        "phase at the gain crossover": late * 360 * crossover / asked.phase_loss_deg,
        "delay margin": late / (asked.delay_share * delay_s) if delay_s else math.inf,
        "bandwidth": asked.samples_per_bandwidth * width,
        "fastest closed-loop pole": asked.samples_per_rise * fastest / 2.2,
    }
    limit = max(rules, key=lambda rule: rules[rule])
    samples = math.ceil(asked.computation_samples)
    return SampleRate(rules[limit], limit, rules, lowest_stable_rate(loop, samples), samples)


def lowest_stable_rate(loop: Loop, computation_samples: int) -> float:
    """Return the rate in Hz above which every sampled loop is stable."""
    rates = np.abs(loop.rates)
    rates = rates[rates > 0]
    if not rates.size:
        return 0.0

    def stable(period: float) -> bool:
        poles = sampled_poles(loop, period, computation_samples)
        # An eigenvalue this far outside the unit circle is rounding.
        return bool(np.abs(poles).max() < 1 + SAME)

    shortest = 1 / (_MOST_SAMPLES * float(rates.max()))
    if not stable(shortest):
        return math.inf
    return 1 / last_stable(stable, shortest, 30 / float(rates.min()))


def sampled_poles(loop: Loop, period: float, computation_samples: int) -> AnyVector:
    """Return the poles of the loop sampled with a period in s.

    Parameters
    ----------
    loop : Loop
        Continuous.
    period : float
    computation_samples : int
        Whole samples by which the controls come late.

    Returns
    -------
    ndarray of complex
    """
    A, B, C, D = loop.plant_matrices
    transition, now, later = first_order_hold(A, B, period)
    controller = integration_rule(*loop.controller_matrices, period, "tustin")
    for _ in range(computation_samples):  # of delay, the last control being the last states
        Ak, Bk, Ck, Dk = controller
        nu, n = len(Ck), len(Ak)
        Ak = np.block([[Ak, np.zeros((n, nu))], [Ck, np.zeros((nu, nu))]])
        controller = Ak, np.vstack([Bk, Dk]), np.eye(nu, n + nu, k=n), np.zeros(Dk.shape)
    every = range(sum(D.shape))
    ports = Ports.closed(len(every), every, every)
    return np.linalg.eigvals(connected((transition, now + later, C, D), controller, ports)[0])


# S, T, KS and GS where a loop is broken, with their peaks.


SHOWN = ("S", "T", "KS", "GS")
"""The closed-loop transfer functions, in the order in which they are drawn."""


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """The transfer functions of a loop at one break point, as named systems.

    With u = K y and y = G u the loop transfer function is L = -K G at the plant's input and
    L = -G K at its output. Peaks are H-infinity norms: for several signals they depend on units,
    as every singular value does.

    Attributes
    ----------
    place : {"input", "output"}
        Of the plant.
    L : control.StateSpace
        Loop transfer function, all signals of the place broken.
    S : control.StateSpace
        Sensitivity, 1/(1 + L): from a disturbance at the place to the signal behind it.
    T : control.StateSpace
        Complementary sensitivity, 1 - S.
    KS : control.StateSpace
        From noise on the measurements to the controls, K (1 - G K)^-1; the same at both places.
    GS : control.StateSpace
        From disturbances at the controls to the measurements, G (1 - K G)^-1; the same at both.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> loop = rp.loop_analysis(control.tf([2], [1, 1]), -4).output
    >>> [round(complex(system(0)).real, 4) for system in (loop.S, loop.T, loop.KS, loop.GS)]
    [0.1111, 0.8889, -0.4444, 0.2222]
    >>> round(loop.peaks["S"].value, 6)
    1.0
    """

    place: Place
    L: control.StateSpace
    S: control.StateSpace
    T: control.StateSpace
    KS: control.StateSpace
    GS: control.StateSpace

    @cached_property
    def peaks(self) -> dict[str, HinfNorm]:
        """Largest singular values over all frequencies of S, T, KS and GS, proven if affordable."""
        return {name: norm_of(getattr(self, name)) for name in SHOWN}


@dataclass(frozen=True, eq=False)
class MeasuredSensitivities(Sensitivities):
    """L, S, T, KS and GS at the measured frequencies, each a `control.FrequencyResponseData`.

    Attributes
    ----------
    place : {"input", "output"}
    L, S, T, KS, GS : control.FrequencyResponseData
    """

    @cached_property
    def peaks(self) -> dict[str, HinfNorm]:
        """Largest singular values of the lines; what lies between them is not known."""
        return {name: LineResponse(getattr(self, name)).peak() for name in SHOWN}  # type: ignore


def sensitivities(loop: Loop | MeasuredLoop, place: Place) -> Sensitivities:
    """Return the transfer functions of a loop at a place."""
    at, u, y = loop.at(place), loop.at("input"), loop.at("output")
    kind: Any = MeasuredSensitivities if isinstance(loop, MeasuredLoop) else Sensitivities
    return kind(
        place=place,
        L=loop.opened(place),
        S=loop.around(at),
        T=loop.around(at, -1.0, -1.0),
        KS=loop.between(y, u),
        GS=loop.between(u, y),
    )


# Each scale of time takes so many steps, of a twentieth of the fastest pole's time at first.
_STEPS = 400
_FINEST = 0.05
_SETTLED = 8.0
_MOST_SCALES = 60
_MOST_EFFORT_SAMPLES = 100_000


@dataclass(frozen=True)
class Effort:
    """What one source makes one control do.

    Attributes
    ----------
    source, control : str
        A measurement with noise, or a disturbance; and the control.
    rms : float
        Root mean square of the control per unit of the source's density: the H2 norm. In
        continuous time for white noise of one unit per root hertz, negative frequencies counted
        too (divide a data sheet's one-sided density by root 2); infinite where the control follows
        at once, for white noise has no finite power. In discrete time for noise of standard
        deviation 1 in every sample.
    peak_gain : float
        Largest gain over all frequencies, the H-infinity norm.
    peak_gain_hz : float
        Where it is.
    step_peak : float
        Largest size of the control after a unit step of the source.
    step_rate : float
        Largest rate of the control in units per second after that step; infinite where the
        control jumps. In discrete time the largest change from one sample to the next, over the
        sampling time.
    unit, source_unit : str
        Of the control and of the source, where the plant knows them.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> noise = rp.loop_analysis(control.tf([1], [1, 1]), control.tf([-2], [1, 2])).noise[0]
    >>> noise.source, round(noise.rms, 4), round(noise.step_rate, 4)
    ('y[0]', 0.9129, 2.0)
    """

    source: str
    control: str
    rms: float
    peak_gain: float
    peak_gain_hz: float
    step_peak: float
    step_rate: float
    unit: str = ""
    source_unit: str = ""

    @property
    def _unit_per_source(self) -> str:
        """Unit of the control for a unit of its source, where both are known."""
        return f"{self.unit}/{self.source_unit}" if self.unit and self.source_unit else ""


@dataclass(frozen=True)
class GivenEffort:
    """What one control does under given signals.

    Attributes
    ----------
    control : str
    peak, rms : float
        Its largest size and its root mean square.
    peak_rate : float
        Its largest rate in units per second, from sample to sample.
    unit : str
        Of the control, where the plant knows it.

    Examples
    --------
    >>> from robustpolish.loops import GivenEffort
    >>> GivenEffort("F", peak=2.0, rms=1.0, peak_rate=50.0).peak
    2.0
    """

    control: str
    peak: float
    rms: float
    peak_rate: float
    unit: str = ""


def noise_effort(loop: Loop) -> tuple[Effort, ...]:
    """Return what noise on every measurement makes every control do."""
    return _efforts(loop, loop.between(loop.at("output"), loop.at("input")))


def disturbance_effort(loop: Loop) -> tuple[Effort, ...]:
    """Return what every disturbance of the plant makes every control do.

    A plant without disturbances of its own is disturbed at its controls.
    """
    return _efforts(loop, disturbed(loop))


def disturbed(loop: Loop) -> control.StateSpace:
    """Return the system from the disturbances to the controls."""
    plant = loop.plant
    if plant.nw == 0:
        return loop.around(loop.at("input"), 1.0, 1.0)  # K y = u - d
    closed = plant.with_control_outputs().closed_loop(loop.controller)
    found = from_to(closed, range(plant.nw), range(plant.nz, plant.nz + plant.nu))
    # An output of the plant that has a control's name already would have turned it into "u_2".
    found.update_names(outputs=list(plant.control_names))
    return found


def given_effort(loop: Loop, disturbance: xr.Dataset) -> tuple[GivenEffort, ...]:
    """Return what every control does under given disturbances, the loop starting at rest.

    Raises
    ------
    InvalidInputError
        If the dataset has no disturbance of the plant, or one that is not over `time` alone.
    """
    system = disturbed(loop)
    time, inputs = disturbance_columns(disturbance, system.input_labels, {})
    outputs = linear_response(system, time, inputs).outputs
    rates = np.abs(np.diff(outputs, axis=0)) / np.diff(time)[:, None]
    return tuple(
        GivenEffort(
            name,
            float(np.abs(u).max(initial=0.0)),
            float(np.sqrt(np.mean(u**2))),
            float(rate.max(initial=0.0)),
            loop.unit(name),
        )
        for name, u, rate in zip(system.output_labels, outputs.T, rates.T, strict=True)
    )


def _efforts(loop: Loop, system: control.StateSpace) -> tuple[Effort, ...]:
    found = []
    steps = np.stack(_step_sizes(system), axis=2)
    for j, source in enumerate(system.input_labels):
        for i, name in enumerate(system.output_labels):
            part = from_to(system, [j], [i])
            peak, rms = norm_of(part), h2_norm(part, tolerance=1e-6).value
            gain = peak.value, peak.frequency / (2 * math.pi)
            units = loop.unit(name), loop.unit(source)
            rest: tuple[Any, ...] = (*gain, *steps[i, j].tolist(), *units)
            found.append(Effort(source, name, rms, *rest))
    return tuple(found)


def _step_sizes(system: control.StateSpace) -> tuple[Array, Array]:
    """Return the largest sizes of the step response and of its rate, outputs by inputs."""
    _, B, _, D = matrices_of(system)
    peaks, rates = np.abs(D), np.where(D != 0, np.inf, 0.0)
    if system.nstates == 0:
        return peaks, rates
    step = sample_step(system.dt)
    if step:
        rates = peaks / step
    for time in _time_scales(system):
        for j in range(D.shape[1]):
            unit = np.zeros((time.size, D.shape[1]))
            still, unit[:, j] = unit.copy(), 1.0
            outputs = linear_response(system, time, unit).outputs
            peaks[:, j] = np.maximum(peaks[:, j], np.abs(outputs).max(axis=0))
            if step:
                changes = np.diff(outputs, axis=0) / step
            else:  # the impulse response is the rate of the step response
                changes = linear_response(system, time, still, B[:, j]).outputs
            rates[:, j] = np.maximum(rates[:, j], np.abs(changes).max(axis=0, initial=0.0))
    return peaks, rates


def _time_scales(system: control.StateSpace) -> list[Vector]:
    """Return grids of time, each twice as coarse as the one before, until all has settled."""
    poles: Any = np.asarray(system.poles())
    if step := sample_step(system.dt):
        slowest = float(np.abs(poles).max(initial=0.0))
        count = _SETTLED / -math.log(slowest) if 0 < slowest < 1 else len(poles) + 1
        whole: Any = np.arange(int(min(count + len(poles), _MOST_EFFORT_SAMPLES)) + 2) * step
        return [whole]
    if not np.abs(poles).any():
        return []  # integrators that nothing reaches, or of which nothing is seen
    step = _FINEST / float(np.abs(poles).max())
    least = float(np.abs(poles.real).min())
    last = _SETTLED / least if least > 0 else math.inf
    grids: list[Any] = []
    for doublings in range(_MOST_SCALES):
        grids.append(np.arange(_STEPS + 1) * step * 2.0**doublings)
        if grids[-1][-1] >= last:
            break
    return grids
