"""How much uncertainty a loop bears before it gets unstable: proven below, witnessed above."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from robustpolish.display import Card, quantities
from robustpolish.long_calls import same_bits
from robustpolish.models.uncertain.system import UncertainSystem
from robustpolish.robust.loop_model import LoopModel
from robustpolish.robust.over_frequency import Asked, Witnessed
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
from robustpolish.robust.search import EVERYWHERE, GAP, bounds
from robustpolish.validation import instance_of, positive


@dataclass(frozen=True, eq=False, repr=False)
class RobustStability(Witnessed):
    """How far the uncertainty of a loop may grow before it gets unstable.

    Attributes
    ----------
    lower, upper : float
        The margin lies between. The loop is stable for all uncertainty of size below `lower`,
        where 1 is what was said to be possible; and `witness` of size `upper` makes it unstable.
    critical_frequency : float
        In rad/s, where the witness puts a pole on the boundary of stability; infinite if the loop
        through it stops being well posed; nan without a witness.
    witness : mapping of str to float, complex or control.StateSpace
        The values of all that is uncertain, in their own units, for which that is so; of dynamics
        the part before their bound. Empty if none was found.
    intervals : tuple of (float, float)
        Frequencies in rad/s over each of which the lower bound was proven; they cover the axis.
    status : {"bracketed", "wide", "no witness", "incomplete", "unstable", "marginal", "unaffected"}
        Whether both bounds are there, and why not.
    proven : bool
        Whether the lower bound is proven, in ball arithmetic, for all frequencies.
    reason : str
        The status in a sentence.

    Examples
    --------
    >>> import robustpolish as rp
    >>> c = rp.uncertain_real("c", 1, range=(0, 2))
    >>> mass = rp.uncertain_system([[0, 1], [-1, -c]], [[0], [1]], [[1, 0]])
    >>> margin = rp.robust_stability(mass)
    >>> round(margin.upper, 6), margin.status, margin.intervals
    (1.0, 'bracketed', ((0.0, inf),))

    The machine at the witness, and what each number has to do with it:

    >>> margin.worst_plant().poles().real.round(6).tolist()
    [0.0, 0.0]
    >>> {name: round(share, 3) for name, share in margin.sensitivity.items()}
    {'c': 1.0}
    """

    lower: float
    upper: float
    critical_frequency: float
    witness: Mapping[str, Any] = field(default_factory=dict)
    intervals: tuple[tuple[float, float], ...] = ()
    status: Status = "bracketed"
    proven: bool = False

    @property
    def reason(self) -> str:
        """The status in a sentence."""
        said = says(self.status)
        if math.isinf(self.critical_frequency):
            said += ", with which the loop is not well posed"
        return said

    @property
    def robust(self) -> bool | None:
        """Whether every machine within the bounds is stable; None if neither is certain."""
        if self.proven and self.lower >= 1:
            return True
        return False if self.upper <= 1 else None

    def _shown(self) -> tuple[str, tuple[float, float], float]:
        bounds_of_mu = inverse(self.upper), inverse(self.lower)
        return self._drawn, bounds_of_mu, self.critical_frequency

    def _card(self) -> Card:
        verdict = {True: "robustly stable", False: "not robustly stable", None: "undecided"}
        rows = (
            ("margin at least", self.lower),
            ("margin at most", self.upper),
            ("critical frequency [rad/s]", self.critical_frequency),
            ("proven", self.proven),
        )
        title = f"Robust stability: {verdict[self.robust]}"
        return Card(title, (quantities(*rows),), (self.reason,))


@same_bits
def robust_stability(system: UncertainSystem, *, gap: float = GAP) -> RobustStability:
    """Bound the margin of stability of an uncertain system over all frequencies.

    Parameters
    ----------
    system : UncertainSystem
        A closed loop, for example ``(plant * controller).feedback()``; continuous or discrete.
    gap : float, optional
        Relative distance of both bounds that is small enough, 0.2 % by default. Where real numbers
        leave a larger one, it is closed by branch and bound if they are few, as far as a few
        seconds of work go.

    Returns
    -------
    RobustStability
        A margin of 1.5 says that the loop is stable even if everything is off by 1.5 times as much
        as was said to be possible.

    Raises
    ------
    InvalidInputError
        If it is not an uncertain system, or the gap not positive.

    Notes
    -----
    Below the lower bound, scalings D and G prove stability over intervals of frequency, whose ends
    are eigenvalues of a Hamiltonian matrix [1]_, all in ball arithmetic. The upper bound is a
    machine: real numbers, and for dynamics all-passes. Dynamics are any stable linear systems; of
    numbers it is assumed that they do not change with time.

    With real numbers the two may be far apart. If there are few of them, and at most one other
    block, their box is halved again and again, together with the axis of frequencies, until the
    Bernstein coefficients of the characteristic polynomial prove each part [2]_. Beside several
    other blocks their box is halved too, and scalings prove each of up to two dozen parts.

    All of it is done in units of states, signals and time that follow from the loop itself: other
    units of the same loop give the same numbers but for rounding.

    References
    ----------
    .. [1] C. Roos, J.-M. Biannic, "A detailed comparison of mu lower and upper bounds for large
       families of uncertain systems", IFAC-PapersOnLine 48 (2015); G. Ferreres, "A practical
       approach to robustness analysis with aeronautical applications", Kluwer (1999).
    .. [2] M. Zettler, J. Garloff, "Robustness analysis of polynomials with polynomial parameter
       dependency using Bernstein expansion", IEEE Trans. Automatic Control 43 (1998) 425-431.

    Examples
    --------
    A spring that is known to 40 %, a gain that is off by 50 % at any frequency, and a PID:

    >>> import control
    >>> import robustpolish as rp
    >>> k = rp.uncertain_real("k", 10, percent=40)
    >>> plant = rp.uncertain_system([[0, 1], [-k, -1.8]], [[0], [18]], [[1, 0]])
    >>> plant = plant * (1 + 0.5 * rp.uncertain_dynamics("delta"))
    >>> s = control.tf("s")
    >>> loop = (plant * (2.3 + 3 / s + 0.38 * s / (0.001 * s + 1))).feedback()
    >>> margin = rp.robust_stability(loop)
    >>> round(margin.lower, 2), round(margin.upper, 2), margin.proven
    (1.6, 1.6, True)
    """
    checked(system)
    gap = positive("gap", gap)
    status = nominal_status(system.interconnection)
    if status != "stable":
        return RobustStability(0.0, 0.0, math.nan, status=status)
    loop = LoopModel.of(system)
    if not system.blocks or not loop.acts_back:
        return RobustStability(math.inf, math.inf, math.nan, {}, EVERYWHERE, "unaffected", True)
    found = bounds(loop, gap=gap)
    coverage, at = found.coverage, reached(system, loop, found.witness)
    lower, proven = proven_margin(coverage, loop.gain), coverage.complete
    intervals = loop.in_rad_per_s(coverage.intervals)
    asked = Asked(loop, loop.gain, (False,) * len(system.blocks), critical(loop, found), system)
    return RobustStability(
        lower,
        at.size,
        at.frequency,
        at.values,
        intervals,
        outcome(found, gap),
        proven,
        _asked=asked,
    )


def checked(system: Any) -> UncertainSystem:
    """Refuse what is not an uncertain system."""
    remedy = "Make it with uncertain_real and the like, or use stability."
    return instance_of("system", system, UncertainSystem, "an UncertainSystem", remedy)
