"""The thresholds of output feedback in one place, each with its reason."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SearchPolicy:
    """What the search for an output feedback decides by.

    Attributes
    ----------
    work : float
        Steps that one call may spend before `effort` is applied: about ten times what the
        slowest of 24 COMPleib plants needs, and a few seconds.
    attempts : float
        Steps on the size of the plant that a call may spend at least: a search over gamma of a
        plant of 120 states takes 40, where `work` would leave one of 250 states seven.
    search_share : float
        Share of the work that engines may spend; the rest shortens controllers.
    bound_accuracy : float
        How finely the lower bound is searched, as a share of the tolerance.
    spoilt : float
        A norm this much, relative, below an estimate of the infimum shows that rounding spoilt it.
    near : float
        The ladder ends within this share of the tolerance above the lower bound. The rest of the
        tolerance buys smaller gains and fewer states.
    epsilons : tuple of float
        Rungs of the ladder: half decades, for gamma falls by at most a third from one to the next
        where it settles. Below 3e-9 rounding decides (AC12, ROC10).
    shifts : tuple of float
        By how much the axis is moved, over the plant's unit of frequency, where D12 and D21 have
        full rank and zeros lie on it: as much as the norm allows, for the poles keep this distance.
        It has to be less than that of the slowest weight, whose poles nothing moves.
    back_offs : tuple of float
        How far above the optimal gamma central controllers are made, the most wanted first; nearer
        than 5e-4 they break their promise, and hard plants (NN9, HE1) need 1.01 or 1.03.
    refinements : tuple of float
        Further distances from the optimum, tried on rungs that came close.
    settled : float
        A relative fall of the norm that is none.
    nearby : float
        How far the optimal gamma is expected to move with the axis; looked at first.
    quiet : int
        Rungs without a fall after which a ladder without a lower bound to aim at ends.
    falling : float
        A norm that two decades of the ladder have lowered to less than this share falls on.
    largest_gain : float
        Entries of a controller above it cannot be verified in double precision.
    costly_states : int
        More states than this make every check of a loop take long, so that fewer are made.
    refined_states : int
        Beyond so many states of a plant the first controller that keeps the tolerance ends the
        search, and none at further distances from the optimum is tried: each takes as long as all
        the rest of a rung.
    quick_drop : float
        Where checks are costly, none is made on rungs where gamma falls by more than this.
    lmi_states : int
        Inequalities for more states take longer than a call of "auto" is expected to.
    modal_loop_states : int
        Beyond so many states of a loop its norm comes from its modes, at the expense of a step on
        the plant.
    exact_loop_states : int
        Up to so many states of a loop an exact norm is quick where doubles cannot tell.
    zero_states : int
        Up to so many states of a plant its zeros on the axis are looked for, to explain a result.
    truncated_states : int
        With more states than this the equations take so long that fewer are tried first.
    harmless : float
        A relative change of the norm by states that were left out which is none.
    as_good_as_zero : float
        An infimum that is approached without end counts as zero below this share of the norm at
        the start of the descent; smaller norms would cost gain for nothing (AC1, UWV).
    enough : float
        No part has to be better than this share of the norm of the whole.
    h2_epsilons : tuple of float
        Rungs for singular H2 problems, whose equations bear half a decade less regularisation.
    h2_settled : float
        A relative fall of the H2 norm that is none.
    h2_tolerance : float
        How much of the H2 norm may be given away: the optimum is known exactly, so little.
    certificate_work : float
        Work of one certificate, in steps on the loop's size.
    first_proof : float
        Share of the time left that a certificate may take while a gentler controller could follow.
    slycot_epsilon : float
        Regularisation for SLICOT's routines, which refuse singular plants.
    """

    work: float = 20_000.0
    attempts: float = 80.0
    search_share: float = 0.7
    bound_accuracy: float = 0.03
    spoilt: float = 1e-5
    near: float = 0.25
    epsilons: tuple[float, ...] = tuple(10.0 ** (-k / 2) for k in range(2, 18))
    shifts: tuple[float, ...] = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
    back_offs: tuple[float, ...] = (1.003, 1.0005, 1.01, 1.03)
    refinements: tuple[float, ...] = (1.0005, 1.001, 1.006)
    settled: float = 3e-4
    nearby: float = 0.02
    quiet: int = 3
    falling: float = 0.9
    largest_gain: float = 1e10
    costly_states: int = 24
    refined_states: int = 100
    quick_drop: float = 0.03
    lmi_states: int = 14
    modal_loop_states: int = 100
    exact_loop_states: int = 16
    zero_states: int = 30
    truncated_states: int = 100
    harmless: float = 3e-4
    as_good_as_zero: float = 1e-6
    enough: float = 0.01
    h2_epsilons: tuple[float, ...] = tuple(10.0 ** (-k / 2) for k in range(2, 19))
    h2_settled: float = 1e-6
    h2_tolerance: float = 2e-5
    certificate_work: float = 20.0
    first_proof: float = 2 / 3
    slycot_epsilon: float = 1e-4


POLICY = SearchPolicy()
