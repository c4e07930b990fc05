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
from robustpolish.base.checks import misfit, whole_number
from robustpolish.linear.delayed_systems import resolvent_response
from robustpolish.linear.stability import Stability
from robustpolish.loops.loop import BreakableLoop, check_signals
from robustpolish.loops.response import LineResponse, Ports, line_values
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
        remedy = "Count the plant's poles in the right half plane; none is 0."
        whole_number("unstable_poles", unstable_poles, 0, remedy=remedy)
        system = controller_system(plant, controller)
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
