"""The loop of a controller and a plant that is known at measured frequencies only."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import control
import numpy as np

from robustpolish.base.arrays import AnyArray, Vector
from robustpolish.base.checks import described, invalid
from robustpolish.linear.delayed_systems import resolvent_response
from robustpolish.linear.stability import Stability
from robustpolish.loops.loop import BreakableLoop, Place
from robustpolish.loops.response import MeasuredResponse, closed_values, opened_values
from robustpolish.plants.blocks import GivenController, controller_system, matrices_of
from robustpolish.plants.plant import GeneralizedPlant

_AT_REST = 1e-9
"""Poles of a controller this near to the boundary, over the first measured frequency, are on it."""


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
        cls, plant: GeneralizedPlant, controller: GivenController, unstable_poles: Any
    ) -> MeasuredLoop:
        """Put a measured plant and a controller together.

        Raises
        ------
        InvalidInputError
            If the controller does not fit, or there are fewer than two lines.
        """
        whole = isinstance(unstable_poles, int | np.integer) and not isinstance(
            unstable_poles, bool
        )
        if not whole or unstable_poles < 0:
            remedy = "Count the plant's poles in the right half plane; none is 0."
            raise invalid("unstable_poles", unstable_poles, "a whole number from 0 on", remedy)
        system = controller_system(plant, controller)
        if (system.noutputs, system.ninputs) != (plant.nu, plant.ny):
            shown = described(f"{system.ninputs} inputs and {system.noutputs} outputs")
            want = f"{plant.ny} inputs (y) and {plant.nu} outputs (u)"
            raise invalid("controller", shown, want, "It leads from y to u.")
        lines: Any = plant.system
        order = np.argsort(lines.omega)
        omega = np.asarray(lines.omega, dtype=float)[order]
        dt = 0 if system.dt is None else system.dt
        kept = (omega > 0) & (omega < (math.pi / float(dt) if dt else math.inf))
        if kept.sum() < 2:
            shown = described(f"{int(kept.sum())} lines above 0 and below half the sample rate")
            raise invalid("plant", shown, "two or more", "Measure more of the response.")
        omega = omega[kept]
        G = np.moveaxis(np.asarray(lines.frdata), 2, 0)[order][kept]
        G = G[:, -plant.ny :, G.shape[2] - plant.nu :]
        points = np.exp(1j * omega * float(dt)) if dt else 1j * omega
        K = resolvent_response(*matrices_of(system), points)
        return cls(plant, system, omega, G, K, int(unstable_poles))

    @property
    def dt(self) -> float | bool:
        """Sampling time of the controller in s; 0 for a continuous one."""
        return 0 if self.controller.dt is None else self.controller.dt

    @property
    def is_discrete(self) -> bool:
        """Whether the controller is discrete."""
        return bool(self.dt)

    @cached_property
    def closed(self) -> AnyArray:
        """From (disturbance at u, noise at y) to (u, y), line by line."""
        return closed_values(self.G, self.K)

    @property
    def side_by_side(self) -> AnyArray:
        """Everything opened: from (u, y) to (-K y, -G u), line by line."""
        nu, ny = self.plant.nu, self.plant.ny
        values = np.zeros((len(self.omega), nu + ny, nu + ny), dtype=complex)
        values[:, :nu, nu:], values[:, nu:, :nu] = -self.K, -self.G
        return values

    def opened(
        self, place: Place, signals: Sequence[int] | None = None
    ) -> control.FrequencyResponseData:
        """Return L where the loop is broken, the rest being closed."""
        names = self.names(place)
        broken = list(range(len(names)) if signals is None else signals)
        labels = [names[i] for i in broken]
        values = opened_values(self.G, self.K, place == "input", broken)
        return self._named(values, labels, labels)

    def around(
        self, at: Sequence[int], weight: float = 1.0, less: float = 0.0
    ) -> control.FrequencyResponseData:
        """Return weight * S - less * 1 at some signals."""
        at = list(at)
        names = [self.signals[i] for i in at]
        own = weight * self.closed[:, at][:, :, at] - less * np.eye(len(at))
        return self._named(own, names, names)

    def between(
        self, inputs: Sequence[int], outputs: Sequence[int]
    ) -> control.FrequencyResponseData:
        """Return :attr:`closed` between some of its inputs and outputs."""
        into, out = ([self.signals[i] for i in at] for at in (inputs, outputs))
        return self._named(self.closed[:, outputs][:, :, inputs], into, out)

    def response(self, place: Place, signals: Sequence[int] | None = None) -> MeasuredResponse:
        """Return :meth:`opened` with what its lines tell."""
        return MeasuredResponse(self.opened(place, signals), self.unstable_poles)

    def response_around(
        self, at: Sequence[int], weight: float = 1.0, less: float = 0.0
    ) -> MeasuredResponse:
        """Return :meth:`around` with what its lines tell."""
        return MeasuredResponse(self.around(at, weight, less))

    def _named(
        self, values: AnyArray, inputs: Sequence[str], outputs: Sequence[str]
    ) -> control.FrequencyResponseData:
        return control.FrequencyResponseData(
            np.moveaxis(values, 0, 2), self.omega, inputs=list(inputs), outputs=list(outputs)
        )

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
        edge = _AT_REST * (1.0 if dt else float(self.omega[0]))
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
