"""What robust synthesis returns: a controller with its proof, or the reason why there is none."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import control
from matplotlib.axes import Axes

from robustpolish.display import Card, Displayed, quantities
from robustpolish.models.uncertain.system import UncertainSystem
from robustpolish.robust.performance import RobustPerformance, WorstCaseGain, worst_case_gain
from robustpolish.synthesis.certificate.certificate import Certificate
from robustpolish.validation import described, invalid

Status = Literal["robust", "limited", "time_limit", "not proven", "no controller"]


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
        One entry per step of the search: its mu at a set of frequencies, the states of the
        controller and of the scalings that it was made for, the work so far.
    elapsed : float
        Seconds.

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
            ("nominal H-infinity norm", self.certificate.achieved),
            ("proven", self.performance.proven),
            ("seconds", round(self.elapsed, 1)),
        )
        return Card(title, (quantities(*rows),), (self.reason,))
