"""The decisions of the structured searches, each with its reason and the case that needs it."""

from __future__ import annotations

import math
from dataclasses import dataclass

TIME_LIMIT = 300.0
"""Seconds of the safety net, if the caller names none."""


@dataclass(frozen=True)
class Effort:
    """How many descents are enough for one part.

    Attributes
    ----------
    descents : int
        The most. A static gain has few free numbers and many local minima; a dynamic controller
        starts from Riccati designs and has few.
    fewest : int
        Descents before agreement counts: AC3 falls into the same poor minimum four times before a
        better one is found.
    patience : int
        Stop when so many descents in a row have not improved the norm.
    smooth_first : bool
        Whether BFGS goes before the bundle method. Springs and dampers often end at their bounds,
        and on the thesis's plant BFGS only takes their time.
    """

    descents: int = 100
    fewest: int = 9
    patience: int = 16
    smooth_first: bool = True

    @property
    def agreeing(self) -> int:
        """Stop when so many descents have reached the best norm."""
        return min(4, self.fewest)


@dataclass(frozen=True)
class StructuredPolicy:
    """Thresholds of the search for controllers of prescribed structure.

    Attributes
    ----------
    work : float
        Work of one design, in H-infinity norms of small loops (half a millisecond each): within
        a minute on an idle machine. AC3 and the mixed designs of 12 states need most of it.
    search_share, again_share, start_share : float
        Parts of the work that is left: of the first search, of one more under a lower ceiling, and
        of the proposals of starts within each. What one leaves over the next may use.
    again : Effort
        Of a search under a lower ceiling, which starts near the last point.
    static, observer, observer_h2, mixed, passive, blocks : Effort
        Of the structures. Blocks have few numbers, and their descents mostly agree. The H2 problem
        over F and L is smooth and its Riccati start optimal, so that few descents tell.
    ceilings : tuple of float
        Largest entry of a controller in scaled units; an infimum beyond it counts as not attained.
        The next one is used where a controller at the one before cannot be certified, as on
        plants with displacement actuation.
    near_ceiling : float
        Share of the ceiling above which a search pushed against it.
    slack, passive_slack : float
        Share of the norm that is given away for a smaller gain, and for smaller springs and
        dampers, whose norm is flat where several do the same.
    worthwhile : float
        A smaller gain is taken if its largest entry falls below this share.
    zero : float
        A norm of the scaled plant below this is zero up to rounding.
    agreement : float
        Two descents agree if their norms differ by less than this share.
    epsilons, back_offs : tuple of float
        Regularisations of the scaled plant, and back-offs from the smallest gamma, of the
        Riccati designs to start from: nobody knows which one is near the best observer.
    proposals : int
        So many of the Riccati designs are descended from, the best first.
    alike : float
        Starts whose norms differ by less than this share count as the same.
    grown_share, growths : float, int
        Share of the work for a controller of fewer states to start from, and how many draws of
        the states that are added to it.
    grown : Effort
        Of that search: it is only a start.
    rates : pair of float
        Decimal logarithms of the slowest and the fastest added state, in the plant's unit of time.
    modest : float
        Riccati designs with entries above this share of the first ceiling are no starts.
    stabilising_states, shared_states : int
        Semidefinite programs for plants with more states take longer than the descents that they
        would start: at 24 states one of up to fifteen takes seconds, at 14 the change of variables
        of a full-order controller has as many unknowns.
    decay : float
        Decay rate asked of a stabilising gain, relative to the plant's size.
    linearisations : int
        Most semidefinite programs on the way to a stabilising gain.
    output_back_off, state_back_off : float
        How far the norm backs off from the optimum of shared inequalities before the controller
        is made small; a dynamic controller needs more room for its change of variables.
    inside : float
        Poles are asked so far inside their region, relative to the plant's size.
    nothing : float
        Coefficients of springs and dampers, in scaled units, that count as nothing.
    highest : float
        Logarithm of the largest coefficient tried, in scaled units.
    """

    work: float = 1e5
    search_share: float = 0.75
    again_share: float = 0.3
    start_share: float = 0.3
    again: Effort = Effort(descents=3)
    static: Effort = Effort()
    observer: Effort = Effort(descents=14)
    observer_h2: Effort = Effort(descents=14, fewest=3)
    mixed: Effort = Effort(descents=8)
    passive: Effort = Effort(smooth_first=False)
    blocks: Effort = Effort(descents=60, fewest=5, patience=12)
    ceilings: tuple[float, ...] = (1e5, 3e3, 1e2, 1e1)
    near_ceiling: float = 0.5
    slack: float = 5e-5
    passive_slack: float = 1e-3
    worthwhile: float = 0.5
    zero: float = 1e-13
    agreement: float = 1e-4
    epsilons: tuple[float, ...] = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
    back_offs: tuple[float, ...] = (1.001, 1.005, 1.02, 1.2)
    proposals: int = 6
    alike: float = 1e-3
    grown_share: float = 0.35
    growths: int = 3
    grown: Effort = Effort(descents=12, fewest=5, patience=6)
    rates: tuple[float, float] = (-1.0, 1.0)
    modest: float = 0.3
    stabilising_states: int = 24
    shared_states: int = 14
    decay: float = 1e-3
    linearisations: int = 15
    output_back_off: float = 1.05
    state_back_off: float = 1.01
    inside: float = 1e-7
    nothing: float = 1e-9
    highest: float = math.log(3e4)

    def iterations(self, numbers: int) -> int:
        """Return the steps of BFGS: with the 110 free numbers of IH 300 end halfway."""
        return max(300, 15 * numbers)

    @property
    def modest_entry(self) -> float:
        """Largest entry of a Riccati design that is a start."""
        return self.modest * self.ceilings[0]


POLICY = StructuredPolicy()
