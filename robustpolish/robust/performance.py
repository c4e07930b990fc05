"""What uncertainty costs: robust performance, and the worst gain of all machines within bounds."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from robustpolish.analysis.norms.hinf_norm import hinf_norm
from robustpolish.display import Card, quantities
from robustpolish.long_calls import same_bits
from robustpolish.models.uncertain.elements import RealElement
from robustpolish.models.uncertain.lft import constant, product
from robustpolish.models.uncertain.system import UncertainSystem
from robustpolish.robust.loop_model import LoopModel
from robustpolish.robust.over_frequency import Asked, Witnessed, machine_at
from robustpolish.robust.reached import (
    Status,
    critical,
    inverse,
    nominal_status,
    outcome,
    proven_margin,
    reached,
    says,
)
from robustpolish.robust.search import GAP, bounds
from robustpolish.robust.stability import checked, robust_stability
from robustpolish.robust.structure import DeltaBlock
from robustpolish.validation import described, invalid, positive


@dataclass(frozen=True, eq=False, repr=False)
class RobustPerformance(Witnessed):
    """How far the uncertainty may grow while the gain stays in proportion below a bound.

    Attributes
    ----------
    lower, upper : float
        The margin lies between. For all uncertainty of size below m = `lower` the gain stays below
        ``gamma / m``; and for the witness, of size `upper`, it is ``gamma / upper``.
    gamma : float
        The bound on the gain that a margin of 1 stands for.
    critical_frequency : float
        In rad/s, where the witness has this gain; nan without a witness.
    witness : mapping of str to float, complex or control.StateSpace
        Values of all that is uncertain, as of :class:`RobustStability`.
    intervals : tuple of (float, float)
        Frequencies in rad/s over each of which the lower bound was proven; they cover the axis.
    status : {"bracketed", "wide", "no witness", "incomplete", "unstable", "marginal", "unaffected"}
        Whether both bounds are there, and why not.
    proven : bool
        Whether the lower bound is proven, in ball arithmetic, for all frequencies.
    reason : str
        The status in a sentence.
    mu : (float, float)
        Bounds of the structured singular value with the performance block: one over the margin.

    Examples
    --------
    >>> import robustpolish as rp
    >>> c = rp.uncertain_real("c", 1, range=(0, 2))
    >>> mass = rp.uncertain_system([[0, 1], [-1, -c]], [[0], [1]], [[1, 0]])
    >>> margin = rp.robust_performance(mass, gamma=5.0)
    >>> margin.proven, margin.upper / margin.lower < 1.002
    (True, True)
    """

    lower: float
    upper: float
    gamma: float
    critical_frequency: float
    witness: Mapping[str, Any] = field(default_factory=dict)
    intervals: tuple[tuple[float, float], ...] = ()
    status: Status = "bracketed"
    proven: bool = False

    @property
    def reason(self) -> str:
        """The status in a sentence."""
        return says(self.status)

    @property
    def mu(self) -> tuple[float, float]:
        """Bounds of the structured singular value with the performance block."""
        return inverse(self.upper), inverse(self.lower)

    def _shown(self) -> tuple[str, tuple[float, float], float]:
        return self._drawn, self.mu, self.critical_frequency

    def _card(self) -> Card:
        rows = (
            ("margin at least", self.lower),
            ("margin at most", self.upper),
            ("gain that 1 stands for", self.gamma),
            ("critical frequency [rad/s]", self.critical_frequency),
            ("proven", self.proven),
        )
        verdict = "met" if self.proven and self.lower >= 1 else "not proven"
        title = f"Robust performance: {'not met' if self.upper < 1 else verdict}"
        return Card(title, (quantities(*rows),), (self.reason,))


@dataclass(frozen=True, eq=False, repr=False)
class WorstCaseGain(Witnessed):
    """The largest gain of all machines within the bounds.

    Attributes
    ----------
    lower, upper : float
        It lies between: the witness has the gain `lower`, and no machine has one above `upper`.
        Infinite if some machine within the bounds is unstable.
    nominal : float
        The gain of the nominal machine.
    critical_frequency : float
        In rad/s, where the witness has its gain.
    witness : mapping of str to float, complex or control.StateSpace
        Values of all that is uncertain, within the bounds, as of :class:`RobustStability`.
    intervals : tuple of (float, float)
        Frequencies in rad/s over each of which the upper bound was proven; they cover the axis.
    status : {"bracketed", "wide", "no witness", "incomplete", "unstable", "marginal", "unaffected"}
        As of :class:`RobustStability`; "unstable" also if a machine within the bounds is.
    proven : bool
        Whether the upper bound is proven, in ball arithmetic, for all frequencies.
    reason : str
        The status in a sentence.

    Examples
    --------
    >>> import robustpolish as rp
    >>> c = rp.uncertain_real("c", 1, range=(0.5, 2))
    >>> mass = rp.uncertain_system([[0, 1], [-1, -c]], [[0], [1]], [[1, 0]])
    >>> rp.worst_case_gain(mass).proven
    True
    """

    lower: float
    upper: float
    nominal: float
    critical_frequency: float
    witness: Mapping[str, Any] = field(default_factory=dict)
    intervals: tuple[tuple[float, float], ...] = ()
    status: Status = "bracketed"
    proven: bool = False

    @property
    def reason(self) -> str:
        """The status in a sentence."""
        if self.status == "unstable" and math.isfinite(self.nominal):
            return "a machine within the bounds is unstable: the witness"
        return says(self.status, "above")

    def _shown(self) -> tuple[str, tuple[float, float], float]:
        return "worst-case gain", (self.lower, self.upper), self.critical_frequency

    def _card(self) -> Card:
        rows = (
            ("gain at least", self.lower),
            ("gain at most", self.upper),
            ("nominal gain", self.nominal),
            ("critical frequency [rad/s]", self.critical_frequency),
            ("proven", self.proven),
        )
        return Card("Worst-case gain", (quantities(*rows),), (self.reason,))


@same_bits
def robust_performance(
    system: UncertainSystem, gamma: float = 1.0, *, gap: float = GAP
) -> RobustPerformance:
    """Bound the margin of performance of an uncertain system over all frequencies.

    Parameters
    ----------
    system : UncertainSystem
        A closed loop with weights, whose largest gain is to stay below `gamma`.
    gamma : float, optional
        The bound; 1 by default.
    gap : float, optional
        Relative distance of both bounds that is small enough, as of :func:`robust_stability`.

    Returns
    -------
    RobustPerformance
        A margin m: the gain stays below ``gamma / m`` for all uncertainty of size up to m.

    Raises
    ------
    InvalidInputError
        If it is not an uncertain system, or gamma or the gap not positive.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> error = rp.uncertain_dynamics("error", bound=0.2)
    >>> loop = rp.feedback(control.ss([[-1.0]], [[2.0]], [[1.0]], 0) * (1 + error))
    >>> margin = rp.robust_performance(loop, gamma=1.0)
    >>> round(margin.lower, 3), round(margin.upper, 3)
    (1.39, 1.391)
    """
    checked(system)
    gamma, gap = positive("gamma", gamma), positive("gap", gap)
    status = nominal_status(system.interconnection)
    if status != "stable":
        return RobustPerformance(0.0, 0.0, gamma, math.nan, status=status)
    scaled = UncertainSystem(product(constant(np.eye(system.noutputs) / gamma), system.matrices))
    loop = LoopModel.of(scaled, _performance(system))
    found = bounds(loop, gap=gap)
    coverage, at = found.coverage, reached(system, loop, found.witness)
    return RobustPerformance(
        proven_margin(coverage, loop.gain),
        at.size,
        gamma,
        at.frequency,
        at.values,
        loop.in_rad_per_s(coverage.intervals),
        outcome(found, gap),
        coverage.complete,
        _asked=Asked(
            loop, loop.gain, (False,) * (len(system.blocks) + 1), critical(loop, found), system
        ),
    )


@same_bits
def worst_case_gain(system: UncertainSystem, *, gap: float = GAP) -> WorstCaseGain:
    """Bound the largest gain of all machines within the bounds of an uncertain system.

    Parameters
    ----------
    system : UncertainSystem
        Continuous or discrete; the gain is the H-infinity norm from its inputs to its outputs.
    gap : float, optional
        Relative distance of both bounds that is small enough, as of :func:`robust_stability`.

    Returns
    -------
    WorstCaseGain

    Raises
    ------
    InvalidInputError
        If it is not an uncertain system, or the gap not positive.

    Examples
    --------
    >>> import robustpolish as rp
    >>> c = rp.uncertain_real("c", 0.4, percent=50)
    >>> mass = rp.uncertain_system([[0, 1], [-1, -c]], [[0], [1]], [[1, 0]])
    >>> worst = rp.worst_case_gain(mass)
    >>> round(worst.nominal, 2), round(worst.lower, 2), round(worst.witness["c"], 6)
    (2.55, 5.03, 0.2)
    """
    margin = robust_stability(system, gap=gap)
    status = "marginal" if margin.status == "marginal" else "unstable"
    if margin.upper <= 1:
        gain = math.inf if margin.upper == 0 else _nominal_gain(system)
        return WorstCaseGain(
            math.inf, math.inf, gain, margin.critical_frequency, margin.witness, (), status
        )
    nominal = _nominal_gain(system)
    loop = LoopModel.of(system, _performance(system))
    unit = nominal or 1.0
    loop = loop.in_unit_of_gain(unit)
    fixed = (True,) * len(system.blocks) + (False,)
    found = bounds(loop, fixed, gap)
    coverage, at = found.coverage, reached(system, loop, found.witness)
    lower, values = nominal, {}
    if found.witness is not None:
        values = _within(system, at.values)
        lower = max(
            lower, _gain_at(machine_at(system, values, at.frequency, loop.step), at.frequency)
        )
    upper = coverage.level * unit if coverage.complete else math.inf
    return WorstCaseGain(
        lower,
        max(math.nextafter(upper, math.inf), lower),
        nominal,
        at.frequency,
        values,
        loop.in_rad_per_s(coverage.intervals),
        outcome(found, gap),
        coverage.complete,
        _asked=Asked(loop, unit, fixed, critical(loop, found), system),
    )


def _performance(system: UncertainSystem) -> DeltaBlock:
    """Return the block from the outputs back to the inputs that stands for a bound on the gain."""
    ny, nu = system.shape
    if not (ny and nu):
        shown = described(f"{ny} outputs and {nu} inputs")
        raise invalid("system", shown, "at least one of each", "Choose the signals to be judged.")
    return DeltaBlock("complex" if ny == nu == 1 else "full", 1, nu, ny, "performance")


def _within(system: UncertainSystem, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return values with numbers that rounding has put just outside their range at its end."""
    real = {n: e for n, e in system.elements.items() if isinstance(e, RealElement)}
    inside = {n: float(np.clip(values[n], e.low, e.high)) for n, e in real.items()}
    for group in {element.group for element in real.values() if element.group}:
        names = [name for name, element in real.items() if element.group == group]
        size = math.hypot(*(inside[name] for name in names))
        inside.update({name: inside[name] / max(size, 1.0) for name in names})
    return {**values, **inside}


def _gain_at(machine: Any, omega: float) -> float:
    """Return the largest singular value at a frequency."""
    if not hasattr(machine, "dt"):
        return float(np.linalg.norm(np.atleast_2d(machine), 2))
    if math.isinf(omega):
        return float(np.linalg.norm(machine.D, 2))
    z = np.exp(1j * omega * (1 if machine.dt is True else machine.dt)) if machine.dt else 1j * omega
    return float(np.linalg.norm(np.atleast_2d(machine(z)), 2))


def _nominal_gain(system: UncertainSystem) -> float:
    machine: Any = system.nominal
    if isinstance(machine, float | np.ndarray):
        return float(np.linalg.norm(np.atleast_2d(machine), 2))
    return hinf_norm(machine).value
