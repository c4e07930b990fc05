"""What bounds and witness of a loop say in the units of its system, and in a word."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import control

from robustpolish.analysis.poles.stability import stability
from robustpolish.models.uncertain.elements import ComplexElement, RealElement
from robustpolish.models.uncertain.system import UncertainSystem
from robustpolish.robust.all_pass import all_pass
from robustpolish.robust.coverage import Coverage
from robustpolish.robust.loop_model import LoopModel
from robustpolish.robust.search import Bounds
from robustpolish.robust.witness import Witness

Nominal = Literal["stable", "unstable", "marginal"]
Outcome = Literal["bracketed", "wide", "no witness", "incomplete"]
Status = Literal[Outcome, "unstable", "marginal", "unaffected"]

# Of the gap, which is a difference of nearly equal numbers.
_ROUNDING = 1e-9

_SAYS = {
    "bracketed": "proven {side}, and reached by the witness",
    "wide": "proven {side}, and reached by the witness, but farther apart than was asked for",
    "no witness": "proven {side}; no search found a machine that is worse than that",
    "incomplete": "not proven: the intervals do not cover the axis",
    "unstable": "the nominal loop is unstable",
    "marginal": "the nominal loop has a pole on the boundary of stability",
    "unaffected": "nothing that is uncertain acts back on itself: stable whatever it is",
}


@dataclass(frozen=True, eq=False)
class Reached:
    """A witness in the units of its system.

    Attributes
    ----------
    size : float
        Of the largest delta, where 1 is what was said to be possible; infinite without a witness.
    values : mapping of str to float, complex or control.StateSpace
        Of all that is uncertain; empty without a witness.
    frequency : float
        In rad/s; nan without a witness.
    """

    size: float
    values: Mapping[str, Any]
    frequency: float


def reached(system: UncertainSystem, loop: LoopModel, witness: Witness | None) -> Reached:
    """Return what a witness of a loop means for its system."""
    if witness is None:
        return Reached(math.inf, {}, math.nan)
    frequency = loop.omega(loop.frequency(witness.at))
    return Reached(witness.size / loop.gain, _named_values(system, loop, witness), frequency)


def _named_values(system: UncertainSystem, loop: LoopModel, witness: Witness) -> dict[str, Any]:
    """Return the values of the elements of a system that a witness stands for."""
    omega = loop.omega(loop.frequency(witness.at))
    values: dict[str, Any] = {}
    for block, delta in zip(system.blocks, witness.deltas, strict=False):
        own = loop.at_positive(delta, witness.at) / loop.gain
        element = block.element
        if isinstance(element, RealElement):
            values[element.name] = element.value(float(own[0, 0].real))
        elif isinstance(element, ComplexElement):
            values[element.name] = element.value(complex(own[0, 0]))
        else:
            values[element.name] = all_pass(own, omega, loop.step)
    return values


def nominal_status(system: control.StateSpace) -> Nominal:
    """Say whether a certain system is stable; without states it is."""
    return stability(system).verdict if system.nstates else "stable"


def outcome(found: Bounds, gap: float) -> Outcome:
    """Say which bounds there are, and whether they are as near to each other as asked."""
    if not found.coverage.complete:
        return "incomplete"
    if found.witness is None:
        return "no witness"
    return "bracketed" if found.gap <= gap * (1 + _ROUNDING) else "wide"


def critical(loop: LoopModel, found: Bounds) -> float:
    """Return the frequency of a loop's model where its bounds are reached; nan if none is known."""
    if found.witness is not None:
        return loop.frequency(found.witness.at)
    return found.coverage.peaks[0][0] if found.coverage.peaks else math.nan


def inverse(value: float) -> float:
    """Return one over a number of at least 0."""
    return math.inf if value == 0 else 1 / value


def says(status: Status, side: Literal["below", "above"] = "below") -> str:
    """Return a status in a sentence; on the given side of the value is what is proven."""
    return _SAYS[status].format(side=side)


def proven_margin(coverage: Coverage, gain: float) -> float:
    """Return the size below which a level proves something: 0 if it is not proven."""
    if not coverage.complete:
        return 0.0
    return down(1 / (coverage.level * gain)) if coverage.level else math.inf


def down(value: float) -> float:
    """Return the next smaller double but one: what was divided is rounded."""
    return math.nextafter(math.nextafter(value, 0.0), 0.0)


def up(value: float) -> float:
    """Return the next larger double but one: what was multiplied is rounded."""
    return math.nextafter(math.nextafter(value, math.inf), math.inf)
