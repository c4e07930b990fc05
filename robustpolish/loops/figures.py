"""What was found out about a loop, and what follows from it, without words and pictures."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import control

from robustpolish.analysis import Stability
from robustpolish.loops.bandwidth import LoopBandwidth
from robustpolish.loops.effort import Effort, GivenEffort
from robustpolish.loops.loop import PLACES, Loop, Place
from robustpolish.loops.margins.all_loops import MarginsAtOnce, Where
from robustpolish.loops.margins.disk import DiskMargin
from robustpolish.loops.margins.one_loop import LoopMargins
from robustpolish.loops.requirements import LoopRequirements
from robustpolish.loops.sampling import SampleRate
from robustpolish.loops.sensitivities import Sensitivities
from robustpolish.validation import invalid

_MOST_SHOWN = 5
"""So many single loops are drawn in one picture."""


@dataclass(frozen=True, eq=False, repr=False)
class LoopFigures:
    """The fields of :class:`robustpolish.LoopAnalysis`, whose docstring explains them."""

    loop: Loop
    stability: Stability
    input: Sensitivities
    output: Sensitivities
    margins: tuple[LoopMargins, ...]
    at_once: Mapping[Where, MarginsAtOnce]
    bandwidths: tuple[LoopBandwidth, ...]
    noise: tuple[Effort, ...]
    effort: tuple[Effort, ...]
    given: tuple[GivenEffort, ...]
    sample_rate: SampleRate | None
    requirements: LoopRequirements

    @property
    def stable(self) -> bool:
        """Whether the closed loop is strictly stable; there are no margins otherwise."""
        return bool(self.stability)

    @property
    def S(self) -> control.StateSpace:
        """Sensitivity at the plant's output."""
        return self.output.S

    @property
    def T(self) -> control.StateSpace:
        """Complementary sensitivity at the plant's output."""
        return self.output.T

    @property
    def KS(self) -> control.StateSpace:
        """From noise on the measurements to the controls."""
        return self.output.KS

    @property
    def GS(self) -> control.StateSpace:
        """From disturbances at the controls to the measurements."""
        return self.output.GS

    @property
    def gain_margin(self) -> tuple[float, float]:
        """Factors to which the gain of any one loop may fall and rise; nan if unstable."""
        if not self.margins:
            return math.nan, math.nan
        return max(m.gain_down for m in self.margins), min(m.gain_up for m in self.margins)

    @property
    def phase_margin(self) -> float:
        """Degrees by which the phase of any one loop may turn; nan if unstable."""
        return self._least(lambda margins: margins.phase_deg)

    @property
    def delay_margin(self) -> float:
        """Smallest delay in s, in one loop or in all of a place alike, that makes it unstable."""
        common = [found.common_delay_s for found in self.at_once.values()]
        known = [delay for delay in common if not math.isnan(delay)]
        return min([self._least(lambda margins: margins.delay_s), *known])

    @property
    def disk_margin(self) -> DiskMargin:
        """The smallest disk margin of one loop at a time; nan if unstable."""
        if not self.margins:
            return DiskMargin(math.nan, math.nan, False)
        return min((margins.disk for margins in self.margins), key=lambda disk: disk.alpha)

    @property
    def modulus_margin(self) -> float:
        """The smallest distance of any one Nyquist curve from -1; nan if unstable."""
        return self._least(lambda margins: margins.modulus)

    @property
    def largest_rate(self) -> dict[str, float]:
        """Largest rate of each control, in units per second, after a unit step of a disturbance."""
        names = {row.control: 0.0 for row in self.effort}
        for row in self.effort:
            names[row.control] = max(names[row.control], row.step_rate)
        return names

    def _chosen(self, place: Place, signal: str | None) -> list[tuple[Place, int]]:
        """Return where loops are broken to be shown: at one signal, or at those of a place."""
        if signal is None:
            return [(place, i) for i in range(min(len(self.loop.names(place)), _MOST_SHOWN))]
        for where in PLACES:
            if signal in self.loop.names(where):
                return [(where, self.loop.names(where).index(signal))]
        known = ", ".join(name for where in PLACES for name in self.loop.names(where))
        raise invalid("signal", signal, f"one of {known}", "Check its spelling.")

    def _least(self, of: Callable[[LoopMargins], float]) -> float:
        return min((of(margins) for margins in self.margins), default=math.nan)

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain numbers, without systems.

        Returns
        -------
        dict
            Its keys are the names of the attributes.
        """
        disk = self.disk_margin
        return {
            "stable": self.stable,
            "stability": self.stability.reason,
            "gain_margin": list(self.gain_margin),
            "phase_margin_deg": self.phase_margin,
            "delay_margin_s": self.delay_margin,
            "modulus_margin": self.modulus_margin,
            "disk_margin": _disk(disk),
            "margins": [
                {
                    "name": m.name,
                    "place": m.place,
                    "gain_down": m.gain_down,
                    "gain_up": m.gain_up,
                    "phase_deg": m.phase_deg,
                    "delay_s": m.delay_s,
                    "modulus": m.modulus,
                    "disk": _disk(m.disk),
                    "unstable_poles": m.unstable_poles,
                    "gain_crossovers": [dict(vars(c)) for c in m.gain_crossovers],
                    "phase_crossovers": [dict(vars(c)) for c in m.phase_crossovers],
                }
                for m in self.margins
            ],
            "at_once": {
                where: {
                    "signals": list(m.signals),
                    "disk": _disk(m.disk),
                    "common_delay_s": m.common_delay_s,
                    "any_delay_s": m.any_delay_s,
                }
                for where, m in self.at_once.items()
            },
            "bandwidths": [dict(vars(row)) for row in self.bandwidths],
            "noise": [dict(vars(row)) for row in self.noise],
            "effort": [dict(vars(row)) for row in self.effort],
            "given": [dict(vars(row)) for row in self.given],
            "largest_rate": self.largest_rate,
            "sample_rate": None if self.sample_rate is None else dict(vars(self.sample_rate)),
            "requirements": dict(vars(self.requirements)),
        }


def _disk(disk: DiskMargin) -> dict[str, Any]:
    return {
        "alpha": disk.alpha,
        "gain_db": disk.gain_db,
        "phase_deg": disk.phase_deg,
        "frequency_hz": disk.frequency_hz,
        "proven": disk.proven,
    }
