"""What robust synthesis returns: a controller with its proof, or the reason why there is none."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

import control
from matplotlib.axes import Axes

from robustpolish.display import Card, Displayed, quantities
from robustpolish.long_calls import Budget
from robustpolish.models.uncertain.system import UncertainSystem
from robustpolish.robust.performance import (
    RobustPerformance,
    WorstCaseGain,
    robust_performance,
    worst_case_gain,
)
from robustpolish.synthesis.certificate.certificate import Certificate, certify
from robustpolish.synthesis.uncertain.scenarios.by_scenarios import ByScenarios
from robustpolish.synthesis.uncertain.scenarios.machines import Machines
from robustpolish.validation import described, invalid

Status = Literal["robust", "limited", "time_limit", "not proven", "no controller"]
Method = Literal["scalings", "scenarios"]


@dataclass(frozen=True, eq=False, repr=False)
class RobustDesign(Displayed):
    """A controller that is proven for every machine within bounds.

    Attributes
    ----------
    plant : UncertainSystem
        The plant, open, its measurements and controls last.
    controller : control.StateSpace or None
        K in u = K y; None if there is none that is proven.
    closed_loop : UncertainSystem or None
        The loop from w to z, with what is uncertain in it.
    gamma : float
        The gain that was asked for.
    status : {"robust", "limited", "time_limit", "not proven", "no controller"}
        "robust": proven that every machine within the bounds is stable with a gain below `gamma`.
        "limited": proven for a part of the uncertainty, `margin`. "time_limit": the same, when
        the safety net in seconds stopped the search. "not proven": a controller was found, but
        no proof, so that it is not given away. "no controller": none was found; see `reason`.
    reason : str
        What happened, and what to try next.
    certificate : Certificate or None
        Of the nominal loop, computed afresh: stability and norm from w to z.
    performance : RobustPerformance or None
        The proof over all frequencies, and the machine that is worst.
    history : tuple of mapping
        One entry per step of the search, with the states of the controller and the work so far: of
        scalings the mu at a set of frequencies and the states of the scalings, of scenarios the
        largest gain over a set of machines and their number.
    elapsed : float
        Seconds.
    method : {"scalings", "scenarios"}
        Which search the controller comes from.
    lower_bound : float
        A worst-case gain that no controller beats, whatever its order and structure, because one of
        the machines within the bounds does not allow less; 0 if none is known.

    Examples
    --------
    >>> import robustpolish as rp
    >>> b = rp.uncertain_real("b", 1.0, percent=20)
    >>> plant = rp.uncertain_system([[-1.0]], [[1.0, b]], [[1.0], [1.0]])
    >>> design = rp.robust_output_feedback(plant, measurements=1, controls=1, gamma=0.9, order=0)
    >>> design.status, design.mu[1] < 1, design.performance.proven
    ('robust', True, True)
    >>> design.margin > 1, design.order
    (True, 0)
    """

    plant: UncertainSystem
    controller: control.StateSpace | None
    closed_loop: UncertainSystem | None
    gamma: float
    status: Status
    reason: str
    certificate: Certificate | None = None
    performance: RobustPerformance | None = None
    history: tuple[Mapping[str, Any], ...] = ()
    elapsed: float = 0.0
    method: Method = "scalings"
    lower_bound: float = 0.0
    _worst: WorstCaseGain | None = field(default=None, kw_only=True)

    @property
    def mu(self) -> tuple[float, float]:
        """Bounds of the structured singular value of the loop; infinite without a controller."""
        return (math.inf, math.inf) if self.performance is None else self.performance.mu

    @property
    def margin(self) -> float:
        """The share of the uncertainty for which stability and performance are proven."""
        return 0.0 if self.performance is None else self.performance.lower

    @property
    def order(self) -> int | None:
        """Number of states of the controller."""
        return None if self.controller is None else int(self.controller.nstates)

    @cached_property
    def worst_case(self) -> WorstCaseGain | None:
        """The largest gain of all machines within the bounds, proven; computed when asked for."""
        if self._worst is not None:
            return self._worst
        return None if self.closed_loop is None else worst_case_gain(self.closed_loop)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw both bounds of the structured singular value of the loop over frequency.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        InvalidInputError
            If there is no controller.

        Examples
        --------
        >>> import robustpolish as rp
        >>> b = rp.uncertain_real("b", 1.0, percent=20)
        >>> plant = rp.uncertain_system([[-1.0]], [[1.0, b]], [[1.0], [1.0]])
        >>> design = rp.robust_output_feedback(plant, 1, 1, gamma=0.9, order=0)
        >>> design.plot().get_xlabel()
        'frequency'
        """
        if self.performance is None:
            expected = "a design with a controller"
            raise invalid("design", described(self.status), expected, self.reason)
        return self.performance.plot(ax)

    def _card(self) -> Card:
        title = f"Robust design: {self.status}"
        if self.performance is None or self.certificate is None:
            return Card(title, (), (self.reason,))
        low, high = self.mu
        rows = (
            ("controller", f"{self.order} states"),
            ("mu at most", high),
            ("mu at least", low),
            ("share of the uncertainty that is proven", self.margin),
            ("gain that 1 stands for", self.gamma),
            *((("gain that none beats", self.lower_bound),) if self.lower_bound else ()),
            ("nominal H-infinity norm", self.certificate.achieved),
            ("proven", self.performance.proven),
            ("seconds", round(self.elapsed, 1)),
        )
        return Card(title, (quantities(*rows),), (self.reason,))


@dataclass(frozen=True, eq=False)
class Candidate:
    """A controller with its proof, and what else is known of it."""

    controller: control.StateSpace
    performance: RobustPerformance
    method: Method = "scalings"
    worst: WorstCaseGain | None = None
    lower_bound: float = 0.0

    @classmethod
    def by_scenarios(cls, system: UncertainSystem, found: ByScenarios, gamma: float) -> Candidate:
        """Return what a search over scenarios found, with its margin."""
        performance = robust_performance(system.lft(found.controller), gamma)
        return cls(found.controller, performance, "scenarios", found.worst, found.lower_bound)

    def is_robust(self, gamma: float) -> bool:
        """Whether every machine within the bounds is proven to have a gain below gamma."""
        below = self.worst is not None and self.worst.proven and self.worst.upper < gamma
        return below or (self.performance.proven and self.performance.lower >= 1)

    def rank(self, gamma: float) -> tuple[bool, float]:
        """Return what decides: of robust ones the worst gain, of others the margin."""
        robust = self.is_robust(gamma)
        if robust and self.worst is not None:
            return True, -self.worst.upper
        return robust, self.performance.lower


def judged(
    machines: Machines,
    chosen: Candidate,
    history: Sequence[Mapping[str, Any]],
    gamma: float,
    budget: Budget,
) -> RobustDesign:
    """Say what a proof means; without one there is no controller."""
    system, performance = machines.system, chosen.performance
    certificate = certify(machines.nominal, chosen.controller)
    if not certificate.valid or not performance.proven:
        why = "; ".join(certificate.reasons) or performance.status
        reason = f"The best controller found could not be proven ({why}). Price u and add noise."
        return RobustDesign(
            system, None, None, gamma, "not proven", reason,
            history=tuple(history), elapsed=budget.elapsed,
        )  # fmt: skip
    status: Status = "robust" if chosen.is_robust(gamma) else "limited"
    if budget.late and status == "limited":
        status = "time_limit"
    return RobustDesign(
        system, chosen.controller, system.lft(chosen.controller), gamma, status,
        _reason(chosen, gamma, budget), certificate, performance, tuple(history),
        budget.elapsed, chosen.method, chosen.lower_bound, _worst=chosen.worst,
    )  # fmt: skip


def _reason(chosen: Candidate, gamma: float, budget: Budget) -> str:
    """Say in a sentence what is proven, and what to try."""
    performance = chosen.performance
    share = performance.lower
    late = " The safety net of time was reached." if budget.late else ""
    if chosen.is_robust(gamma):
        gain = chosen.worst.upper if chosen.worst is not None else gamma / share
        text = f"Every machine within the bounds is stable with a gain below {gain:.4g}."
        if chosen.lower_bound:
            text += f" No controller has a worst gain below {chosen.lower_bound:.4g}."
        return text + late
    text = (
        f"Proven for {share:.3g} times the uncertainty only, with a gain below {gamma / share:.4g}"
    )
    if performance.witness:
        named = ", ".join(
            f"{name} = {value:.4g}"
            for name, value in performance.witness.items()
            if isinstance(value, float)
        )
        worst = f"; at {performance.upper:.3g} times it a machine has no less"
        text += worst + (f" ({named})" if named else "")
    advice = "Ask for less (gamma, weights, smaller bounds), or allow more states (order)."
    if chosen.lower_bound >= gamma:
        advice = f"No controller has a worst gain below {chosen.lower_bound:.4g}: raise gamma."
    return f"{text}. {advice}{late}"
