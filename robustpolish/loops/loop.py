"""Plant and controller as a loop that can be opened anywhere; the plant may be measured."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import control
import numpy as np

from robustpolish.base.arrays import EPS, SAME, AnyArray, AnyVector, Matrix, Vector
from robustpolish.base.checks import instance_of, invalid, matrix, misfit, whole_number
from robustpolish.linear.delay_stability import delay_stability
from robustpolish.linear.norms.hinf import HinfNorm
from robustpolish.linear.stability import Stability, stability
from robustpolish.linear.systems import DelayedSystem, is_system, resolvent_response
from robustpolish.loops.response import (
    DelayedLoop,
    DelayedResponse,
    LineResponse,
    Matrices,
    Ports,
    SystemResponse,
    connected,
    line_values,
)
from robustpolish.plants import blocks
from robustpolish.plants.blocks import closed_loop as plant_loop
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.plants.wired import NOISE_PREFIX, Wiring
from robustpolish.synthesis.design import Design

Place = Literal["input", "output"]
PLACES: tuple[Place, ...] = ("input", "output")


class BreakableLoop:
    """What loops of models and of measured plants have in common: signals, and peaks of S and T."""

    plant: GeneralizedPlant
    controller: control.StateSpace

    def _wired(self, ports: Ports, inputs: Sequence[str], outputs: Sequence[str]) -> Any:
        """Return the loop from where signals enter to where they leave, by their names."""
        raise NotImplementedError

    def _responding(self, ports: Ports, names: Sequence[str]) -> SystemResponse | LineResponse:
        """Return it over frequency."""
        raise NotImplementedError

    def names(self, place: Place) -> tuple[str, ...]:
        """Return the signals at which the loop can be broken: controls or measurements.

        Parameters
        ----------
        place : {"input", "output"}

        Returns
        -------
        tuple of str
        """
        own = self.plant
        return own.control_names if place == "input" else own.measurement_names

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of the controls and of the measurements, in the order of :meth:`at`."""
        return (*self.plant.control_names, *self.plant.measurement_names)

    def at(self, place: Place, signals: Sequence[int] | None = None) -> list[int]:
        """Return where signals of a place stand in :attr:`closed`.

        Parameters
        ----------
        place : {"input", "output"}
        signals : sequence of int, optional
            All of the place by default.

        Returns
        -------
        list of int
        """
        first = 0 if place == "input" else self.plant.nu
        return [first + i for i in (range(len(self.names(place))) if signals is None else signals)]

    def _named(self, at: Sequence[int]) -> list[str]:
        return [self.signals[i] for i in at]

    @cached_property
    def closed(self) -> Any:
        """From (disturbance at u, noise at y) to (u, y): S and KS above, GS and S below."""
        every = range(len(self.signals))
        return self.between(every, every)

    def between(self, inputs: Sequence[int], outputs: Sequence[int]) -> Any:
        """Return :attr:`closed` between some of its inputs and outputs.

        Parameters
        ----------
        inputs, outputs : sequence of int
            Positions in :attr:`closed`.

        Returns
        -------
        control.StateSpace or control.FrequencyResponseData
        """
        ports = Ports.closed(len(self.signals), inputs, outputs)
        return self._wired(ports, self._named(inputs), self._named(outputs))

    def around(self, at: Sequence[int], weight: float = 1.0, less: float = 0.0) -> Any:
        """Return weight * S - less * 1 at some signals, such as S - T = 2 S - 1.

        Parameters
        ----------
        at : sequence of int
            Positions in :attr:`closed`.
        weight, less : float, optional

        Returns
        -------
        control.StateSpace or control.FrequencyResponseData
        """
        names = self._named(at)
        return self._wired(Ports.closed(len(self.signals), at, at, weight, less), names, names)

    def opened(self, place: Place | None, signals: Sequence[int] | None = None) -> Any:
        """Return the loop transfer function where it is broken, the rest being closed.

        Parameters
        ----------
        place : {"input", "output"} or None
            Of the plant; None for both, which opens everything: from (u, y) to (-K y, -G u).
        signals : sequence of int, optional
            Where it is broken; at all signals of the place by default.

        Returns
        -------
        control.StateSpace or control.FrequencyResponseData
            L with S = 1/(1 + L): -K G or -G K if everything is broken.
        """
        broken = self.broken(place, signals)
        names = self._named(broken)
        return self._wired(Ports.opened(len(self.signals), broken), names, names)

    def broken(self, place: Place | None, signals: Sequence[int] | None = None) -> list[int]:
        """Return the signals that :meth:`opened` breaks."""
        return list(range(len(self.signals))) if place is None else self.at(place, signals)

    def response(self, place: Place, signals: Sequence[int] | None = None) -> Any:
        """Return :meth:`opened` over frequency, delays as they are.

        Parameters
        ----------
        place : {"input", "output"}
        signals : sequence of int, optional

        Returns
        -------
        SystemResponse or LineResponse
        """
        broken = self.at(place, signals)
        return self._responding(Ports.opened(len(self.signals), broken), self._named(broken))

    def response_around(self, at: Sequence[int], weight: float = 1.0, less: float = 0.0) -> Any:
        """Return :meth:`around` over frequency, delays as they are.

        Parameters
        ----------
        at : sequence of int
        weight, less : float, optional

        Returns
        -------
        SystemResponse or LineResponse
        """
        ports = Ports.closed(len(self.signals), at, at, weight, less)
        return self._responding(ports, self._named(at))

    def peak(self, at: Sequence[int], weight: float = 1.0, less: float = 0.0) -> HinfNorm:
        """Return the norm of :meth:`around`, proven if that is affordable, and remember it.

        Parameters
        ----------
        at : sequence of int
        weight, less : float, optional

        Returns
        -------
        HinfNorm
        """
        key = (*at, weight, less)
        if key not in self._peaks:
            self._peaks[key] = self.response_around(at, weight, less).peak()
        return self._peaks[key]

    def balanced_peak(self, at: Sequence[int]) -> HinfNorm:
        """Return the norm of S - T, whose inverse is half the disk margin of one loop.

        Parameters
        ----------
        at : sequence of int

        Returns
        -------
        HinfNorm
        """
        return self.peak(at, 2.0, 1.0)

    @cached_property
    def _peaks(self) -> dict[tuple[float, ...], HinfNorm]:
        return {}


@dataclass(frozen=True, eq=False)
class Loop(BreakableLoop):
    """A plant from u to y and a controller u = K y, with what lies outside the loop left out.

    Delays that a plant keeps beside its state-space system are in ``response``,
    ``peak`` and ``stability`` as they are. The systems ``opened`` and ``closed``
    have Padé approximations of them, as the plant's ``system`` has.

    Attributes
    ----------
    plant : GeneralizedPlant
        As given; its lower block is the plant of the loop.
    controller : control.StateSpace
        K, with positive sign.
    """

    plant: GeneralizedPlant
    controller: control.StateSpace

    @property
    def approximated_delays(self) -> dict[str, float]:
        """Delays in s that the plant keeps beside its system, by signal; Padé's in systems."""
        return dict(self.plant.delays)

    @cached_property
    def delayed(self) -> DelayedLoop | None:
        """The loop with its delays as they are; None without delays and in discrete time."""
        if self.is_discrete or not self._inner.lines:
            return None
        return DelayedLoop(self._inner.with_ports_last(), self.controller_matrices)

    @cached_property
    def _inner(self) -> Wiring:
        """The wiring from u to y, of states and delay lines those that lie between."""
        wiring = self.plant.wiring
        whole = wiring.chosen([], range(wiring.nu), [], range(wiring.ny))
        A, B, C, D = whole.arrays()
        n, k = len(A), len(whole.lines)
        nodes: Any = np.block([[A, B[:, :k]], [C[:k], D[:k, :k]]])
        into, out = np.vstack([B[:, k:], D[:k, k:]]), np.hstack([C[k:], D[k:, :k]])
        kept = _between(nodes, into, out)
        states, ports = [i for i in kept if i < n], [i - n for i in kept if i >= n]
        ins, outs = ([*ports, *range(k, k + m)] for m in (whole.nu, whole.ny))
        matrices = A[np.ix_(states, states)], B[np.ix_(states, ins)], C[np.ix_(outs, states)]
        labels = [whole.system.input_labels[i] for i in ins]
        named = [whole.system.output_labels[i] for i in outs], [whole.states[i] for i in states]
        system = blocks.named_system((*matrices, D[np.ix_(outs, ins)]), self.dt, labels, *named)
        lines = tuple(whole.lines[i] for i in ports)
        return Wiring(system, whole.ny, whole.nu, lines)

    @property
    def dt(self) -> float | bool:
        """Sampling time in s; 0 in continuous time."""
        return self.plant.dt

    @property
    def is_discrete(self) -> bool:
        """Whether it is a loop in discrete time."""
        return self.plant.is_discrete

    def unit(self, name: str) -> str:
        """Return the unit of a signal if the plant knows it; that of a measured state is its own.

        Parameters
        ----------
        name : str

        Returns
        -------
        str
        """
        units = self.plant.units
        bare = name.removeprefix(NOISE_PREFIX)
        return units.get(name) or units.get(bare) or units.get(bare.removeprefix("measured_"), "")

    @cached_property
    def inside(self) -> tuple[int, ...]:
        """The plant's states that lie between u and y; weights and the like do not."""
        return _between(self.plant.A, self.plant.B2, self.plant.C2)

    @property
    def outside(self) -> tuple[str, ...]:
        """Names of the plant's states that no controller of this loop can change."""
        return tuple(name for i, name in enumerate(self.plant.states) if i not in self.inside)

    @cached_property
    def outside_stability(self) -> Stability:
        """Whether these are stable by themselves."""
        names = self.outside
        rest = [self.plant.states.index(name) for name in names]
        one = np.eye(len(rest))
        matrices = (self.plant.A[np.ix_(rest, rest)], one, one, 0 * one)
        return stability(blocks.named_system(matrices, self.dt, names, names, names))

    @cached_property
    def plant_matrices(self) -> Matrices:
        """A, B, C and D from u to y, of the states inside the loop."""
        own, kept = self.plant, list(self.inside)
        return own.A[np.ix_(kept, kept)], own.B2[kept], own.C2[:, kept], own.D22

    @cached_property
    def controller_matrices(self) -> Matrices:
        """A, B, C and D of K."""
        return blocks.matrices_of(self.controller)

    def _wired(
        self, ports: Ports, inputs: Sequence[str], outputs: Sequence[str]
    ) -> control.StateSpace:
        """Return the loop from where signals enter to where they leave, by their names."""
        own = [self.plant.states[i] for i in self.inside]
        others = [
            f"{'controller_' if name in own else ''}{name}" for name in self.controller.state_labels
        ]
        matrices = connected(self.plant_matrices, self.controller_matrices, ports)
        return blocks.named_system(matrices, self.dt, inputs, outputs, [*own, *others])

    def _responding(self, ports: Ports, names: Sequence[str]) -> SystemResponse:
        """Return it over frequency, delays as they are."""
        system, exact = self._wired(ports, names, names), self.delayed
        if exact is None:
            return SystemResponse(system, self.rates)
        values = functools.partial(exact.values, ports)
        return DelayedResponse(system, self.rates, exact=values, seconds=exact.seconds)

    @cached_property
    def stability(self) -> Stability:
        """Whether the closed loop is stable, with its delays as they are."""
        found = stability(self.closed)
        if self.delayed is None:
            return found
        inner = self._inner
        exact = delay_stability(DelayedSystem(plant_loop(inner, self.controller), inner.lines))
        if exact and found:
            return replace(found, reason=f"{exact.reason}; with Padé models all poles are stable")
        if exact:
            reason = (
                "stable with exact delays, but not with the Padé models that the plant has of "
                "them: give with_delay a higher order="
            )
            return replace(found, reason=reason)
        verdict = "unstable" if exact.verdict == "unstable" else "marginal"
        reason = f"with exact delays {exact.verdict}: {exact.reason}"
        return replace(found, verdict=verdict, reason=reason, pole=exact.rightmost)

    @cached_property
    def rates(self) -> AnyVector:
        """Poles of the closed loop as complex rates in rad/s, those at z = 0 left out."""
        poles = np.asarray(self.stability.poles, dtype=complex)
        return np.log(poles[poles != 0]) / sample_step(self.dt) if self.is_discrete else poles

    @cached_property
    def opposite_stability(self) -> Stability:
        """Whether the loop with the opposite sign, u = -K y, is stable."""
        return stability(Loop(self.plant, -self.controller).closed)

    def well_posed(self) -> bool:
        """Tell whether the algebraic part of the loop has a solution."""
        D, Dk = self.plant_matrices[3], self.controller_matrices[3]
        return bool(np.linalg.cond(np.eye(D.shape[1]) - Dk @ D) < 1 / EPS)


def from_to(
    system: control.StateSpace, inputs: Sequence[int], outputs: Sequence[int]
) -> control.StateSpace:
    """Return a system between some of its inputs and outputs."""
    A, B, C, D = blocks.matrices_of(system)
    into, out = list(inputs), list(outputs)
    return blocks.named_system(
        (A, B[:, into], C[out], D[np.ix_(out, into)]),
        0 if system.dt is None else system.dt,
        [system.input_labels[i] for i in into],
        [system.output_labels[i] for i in out],
        system.state_labels,
    )


def sample_step(dt: float | bool | None) -> float:
    """Return the sampling time in s, 1 if it is not told; 0 in continuous time."""
    return 1.0 if dt is True else float(dt or 0)


def _between(A: Matrix, B: Matrix, C: Matrix) -> tuple[int, ...]:
    """Return the states that inputs reach and outputs see."""
    moved: Any = _reached(A != 0, (B != 0).any(axis=1))
    seen = _reached(A.T != 0, (C != 0).any(axis=0))
    return tuple(int(i) for i in np.flatnonzero(moved & seen))


def _reached(edges: Any, start: Any) -> Any:
    """Return which states can be reached; ``edges[i, j]`` leads from j to i."""
    found = start.copy()
    while True:
        further = found | (edges & found).any(axis=1)
        if (further == found).all():
            return found
        found = further


# The loop that users give: a design, or a plant and a controller of many kinds, checked.


def loop_of(
    plant: Design | GeneralizedPlant | control.StateSpace | control.TransferFunction,
    controller: Design | blocks.GivenController | None,
) -> Loop:
    """Return the loop of a design, or of a plant and a controller.

    Raises
    ------
    InvalidInputError
        If it is no plant, if the controller is missing or does not fit, or if the loop has no
        solution.
    """
    if isinstance(plant, Design):
        if controller is not None:
            found, want = "a design and a controller besides", "a design alone, or a plant and a "
            remedy = "Pass design.plant to try another controller on its plant."
            raise misfit("controller", found, f"{want}controller", remedy)
        plant, controller = plant.plant, plant.controller
    whole, given = _as_plant(plant), controller_of(controller)
    # A gain of a state feedback, given with a plant that measures something else, is told.
    gain: Any = matrix("controller", given) if isinstance(given, list | tuple) else given
    if isinstance(given, control.StateSpace) and given.nstates == 0:
        gain = given.D
    shape = np.shape(gain) if isinstance(gain, np.ndarray) else ()
    if shape == (whole.nu, whole.nx) and whole.nx != whole.ny:
        found = f"a gain of shape {shape} for {whole.ny} measurements"
        remedy = "For a state feedback pass plant.with_full_state()."
        raise misfit("controller", found, f"a gain of shape ({whole.nu}, {whole.ny})", remedy)
    K = blocks.controller_system(whole, given)
    if K.nstates and K.dt is not None and K.dt != whole.dt and not _same_step(K.dt, whole.dt):
        found = f"{_timing(K.dt)} for a plant in {_timing(whole.dt)}"
        remedy = "Discretise the plant or the controller first, such as with control.c2d."
        raise misfit("controller", found, "the same time as the plant", remedy)
    check_signals(whole, K)
    loop = Loop(whole, K)
    if not loop.well_posed():
        remedy = "Change the controller's feedthrough or the plant's D22."
        found = "a loop matrix I - Dk D22 that is singular"
        raise misfit("controller", found, "a well-posed loop", remedy)
    return loop


def check_signals(plant: GeneralizedPlant, K: control.StateSpace) -> None:
    """Refuse a controller that does not lead from all measurements to all controls."""
    if (K.noutputs, K.ninputs) != (plant.nu, plant.ny):
        want = f"{plant.ny} inputs (y) and {plant.nu} outputs (u)"
        remedy = "It leads from the measurements y to the controls u."
        raise misfit("controller", f"{K.ninputs} inputs and {K.noutputs} outputs", want, remedy)


def controller_of(controller: Design | blocks.GivenController | None) -> blocks.GivenController:
    """Return the controller that was given, out of its design if it is in one."""
    if isinstance(controller, Design):
        return controller.controller
    if controller is None:
        remedy = "Call loop_analysis(plant, controller), with u = K y."
        raise invalid("controller", None, "a controller beside the plant", remedy)
    return controller


def measured_plant(plant: Any) -> GeneralizedPlant | None:
    """Return a plant that is known by its frequency response; None of others."""
    own = plant.system if isinstance(plant, GeneralizedPlant) else plant
    return None if blocks.as_response("plant", own) is None else _as_plant(plant)


def _as_plant(plant: Any) -> GeneralizedPlant:
    if (response := blocks.as_response("plant", plant)) is not None:
        plant = response
    elif is_system(plant):
        plant = blocks.as_state_space("plant", plant, 0)
    if isinstance(plant, control.StateSpace | control.FrequencyResponseData):
        plant = GeneralizedPlant(plant, plant.noutputs or 0, plant.ninputs or 0)
    expected = "a Design, a GeneralizedPlant, a system of any kind or a frequency response"
    remedy = "Pass what a synthesis returned, or a plant and a controller."
    instance_of("plant", plant, GeneralizedPlant, expected, remedy)
    if plant.nu == 0 or plant.ny == 0:
        found, want = f"{plant.nu} controls and {plant.ny} measurements", "at least one of each"
        raise misfit("plant", found, want, "Name measurements= and controls= of the plant.")
    return plant


def _same_step(one: float | bool, other: float | bool) -> bool:
    """Tell whether two sampling times agree, one of which may be unspecified."""
    if one is True or other is True:
        return bool(one) and bool(other)
    return bool(np.isclose(float(one), float(other), rtol=1e-9, atol=0.0))


def _timing(dt: float | bool | None) -> str:
    if not dt:
        return "continuous time"
    return "discrete time" if dt is True else f"discrete time with a step of {dt:g} s"


# The loop of a plant that is known at measured frequencies only.


@dataclass(frozen=True, eq=False)
class MeasuredLoop(BreakableLoop):
    """A plant known at some frequencies, and u = K y.

    Attributes
    ----------
    plant : GeneralizedPlant
        Its system is a frequency response.
    controller : control.StateSpace
    omega : ndarray
        The lines in rad/s, rising, above 0 and below half the sample rate.
    G, K : ndarray of complex, shapes (k, ny, nu) and (k, nu, ny)
    unstable_poles : int
        Of the plant, which its response does not tell.
    """

    plant: GeneralizedPlant
    controller: control.StateSpace
    omega: Vector
    G: AnyArray
    K: AnyArray
    unstable_poles: int

    @classmethod
    def of(
        cls, plant: GeneralizedPlant, controller: blocks.GivenController, unstable_poles: Any
    ) -> MeasuredLoop:
        """Put a measured plant and a controller together.

        Raises
        ------
        InvalidInputError
            If the controller does not fit, or there are fewer than two lines.
        """
        remedy = "Count the plant's poles in the right half plane; none is 0."
        whole_number("unstable_poles", unstable_poles, 0, remedy=remedy)
        system = blocks.controller_system(plant, controller)
        check_signals(plant, system)
        lines: Any = plant.system
        order = np.argsort(lines.omega)
        omega = np.asarray(lines.omega, dtype=float)[order]
        dt = 0 if system.dt is None else system.dt
        kept = (omega > 0) & (omega < (math.pi / float(dt) if dt else math.inf))
        if kept.sum() < 2:
            found = f"{int(kept.sum())} lines above 0 and below half the sample rate"
            raise misfit("plant", found, "two or more", "Measure more of the response.")
        omega = omega[kept]
        G = np.moveaxis(np.asarray(lines.frdata), 2, 0)[order][kept]
        G = G[:, -plant.ny :, G.shape[2] - plant.nu :]
        points = np.exp(1j * omega * float(dt)) if dt else 1j * omega
        K = resolvent_response(*blocks.matrices_of(system), points)
        return cls(plant, system, omega, G, K, int(unstable_poles))

    @property
    def dt(self) -> float | bool:
        """Sampling time of the controller in s; 0 for a continuous one."""
        return 0 if self.controller.dt is None else self.controller.dt

    @property
    def is_discrete(self) -> bool:
        """Whether the controller is discrete."""
        return bool(self.dt)

    def _wired(
        self, ports: Ports, inputs: Sequence[str], outputs: Sequence[str]
    ) -> control.FrequencyResponseData:
        """Return the loop line by line, from where signals enter to where they leave."""
        values = np.moveaxis(line_values(self.G, self.K, ports), 0, 2)
        names = {"inputs": list(inputs), "outputs": list(outputs)}
        return control.FrequencyResponseData(values, self.omega, **names)

    def _responding(self, ports: Ports, names: Sequence[str]) -> LineResponse:
        """Return it with what its lines tell."""
        return LineResponse(self._wired(ports, names, names), self.unstable_poles)

    @cached_property
    def stability(self) -> Stability:
        r"""What Nyquist's criterion says of the lines.

        The phase of det(I - K G) is followed from line to line by the shorter way. Below the first
        line it is closed as that of as many poles at rest as the slope of the first lines shows, or
        the controller has; beyond the last by the shorter way, as where the loop is small.
        """
        poles: Any = np.linalg.eigvals(self.controller.A).astype(complex)
        dt = self.dt
        rates = np.abs(poles) - 1 if dt else poles.real
        # Poles of a controller this near to the boundary, over the first measured frequency, are on
        # it.
        edge = SAME * (1.0 if dt else float(self.omega[0]))
        beyond = int((rates > edge).sum()) + self.unstable_poles
        resting = int((np.abs(poles - (1 if dt else 0)) <= edge).sum())
        one = np.eye(self.K.shape[1])
        determinant = np.linalg.det(one - self.K @ self.G)
        if (determinant == 0).any():
            return Stability("marginal", None, 0.0, False, "a line lies on -1", discrete=bool(dt))
        phases = np.unwrap(np.angle(determinant))
        first = np.log(np.abs(determinant[:2]))
        slope = (first[1] - first[0]) / math.log(self.omega[1] / self.omega[0])
        resting = max(resting, round(-slope))
        low = _nearest(2 * phases[0], -resting * math.pi)
        high = _nearest(-2 * phases[-1], 0.0)
        turns = round((2 * (phases[-1] - phases[0]) + low + high) / (2 * math.pi))
        closed = beyond - turns
        step = float(np.abs(np.diff(phases)).max())
        rest = f", closed below the first line as for {resting} poles at rest" if resting else ""
        reason = (
            f"Nyquist's criterion on {len(self.omega)} lines{rest}: {turns} turns of "
            f"det(I - K G) against the clock, {beyond} unstable poles of the open loop "
            f"({self.unstable_poles} of the plant, as told), {closed} of the closed one"
        )
        if step > math.pi / 2:
            reason += f"; the phase jumps by {math.degrees(step):.0f} deg between lines"
        if closed < 0:
            reason += ": that cannot be, so lines are missing or unstable_poles is wrong"
        verdict = "stable" if closed == 0 else "unstable"
        return Stability(verdict, None, math.nan, False, reason, discrete=bool(dt))

    @property
    def opposite_stability(self) -> Stability:
        """The same with the opposite sign, u = -K y."""
        return replace(self, controller=-self.controller, K=-self.K).stability


def _nearest(angle: float, wanted: float) -> float:
    """Return an angle, turns added, nearest to another."""
    return angle + 2 * math.pi * round((wanted - angle) / (2 * math.pi))
