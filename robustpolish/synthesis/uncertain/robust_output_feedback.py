"""Dynamic output feedback for every machine within the bounds of an uncertain plant."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

import control
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from robustpolish.base import budget as budgets
from robustpolish.base.checks import described, instance_of, invalid, misfit, positive
from robustpolish.base.results import Card, Displayed, quantities
from robustpolish.errors import InfeasibleError, SolverError
from robustpolish.plants.blocks import sorted_signals
from robustpolish.plants.uncertain.system import UncertainSystem
from robustpolish.robust.questions import RobustPerformance, WorstCaseGain, worst_case_gain
from robustpolish.synthesis.certificate import Certificate, certify
from robustpolish.synthesis.problem.preflight import check_solvability, infeasible_modes_error
from robustpolish.synthesis.structured.methods import checked_order, checked_structure
from robustpolish.synthesis.uncertain.scaled_gain import RobustProblem
from robustpolish.synthesis.uncertain.scenarios import (
    RobustCandidate,
    ScenarioSearch,
    UncertainSamples,
)
from robustpolish.synthesis.uncertain.search import (
    AGREES,
    PROOFS,
    SCENARIO_SHARE,
    WORK,
    ScalingSearch,
)

# The result: a controller with its proof, or the reason why there is none.

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
    >>> b = rp.uncertain.real("b", 1.0, percent=20)
    >>> plant = rp.uncertain.system([[-1.0]], [[1.0, b]], [[1.0], [1.0]])
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
        >>> b = rp.uncertain.real("b", 1.0, percent=20)
        >>> plant = rp.uncertain.system([[-1.0]], [[1.0, b]], [[1.0], [1.0]])
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


def _design(
    samples: UncertainSamples,
    chosen: RobustCandidate,
    history: Sequence[Mapping[str, Any]],
    budget: budgets.Budget,
) -> RobustDesign:
    """Say what a proof means; without one there is no controller."""
    system, gamma, performance = chosen.system, chosen.gamma, chosen.performance
    certificate = certify(samples.nominal, chosen.controller)
    told: Any = {"history": tuple(history), "elapsed": budget.elapsed}
    if not certificate.valid or not performance.proven:
        why = "; ".join(certificate.reasons) or performance.status
        reason = f"The best controller found could not be proven ({why}). Price u and add noise."
        return RobustDesign(system, None, None, gamma, "not proven", reason, **told)
    status: Status = "robust" if chosen.is_robust else "limited"
    if budget.late and status == "limited":
        status = "time_limit"
    return RobustDesign(
        system, chosen.controller, system.lft(chosen.controller), gamma, status,
        _reason(chosen, budget.late), certificate, performance, method=chosen.method,
        lower_bound=chosen.lower_bound, _worst=chosen.worst, **told,
    )  # fmt: skip


def _reason(chosen: RobustCandidate, late: bool) -> str:
    """Say in a sentence what is proven, and what to try."""
    performance, gamma, lower_bound = chosen.performance, chosen.gamma, chosen.lower_bound
    share = performance.lower
    more = " The safety net of time was reached." if late else ""
    beaten = f"No controller has a worst gain below {lower_bound:.4g}"
    if chosen.is_robust:
        gain = chosen.worst.upper if chosen.worst is not None else gamma / share
        text = f"Every machine within the bounds is stable with a gain below {gain:.4g}."
        return f"{text} {beaten}.{more}" if lower_bound else text + more
    proven = f"Proven for {share:.3g} times the uncertainty only"
    text = f"{proven}, with a gain below {gamma / share:.4g}"
    if performance.witness:
        values = {k: v for k, v in performance.witness.items() if isinstance(v, float)}
        named = ", ".join(f"{name} = {value:.4g}" for name, value in values.items())
        text += f"; at {performance.upper:.3g} times it a machine has no less"
        text += f" ({named})" if named else ""
    advice = "Ask for less (gamma, weights, smaller bounds), or allow more states (order)."
    if lower_bound >= gamma:
        advice = f"{beaten}: raise gamma."
    return f"{text}. {advice}{more}"


SignalChoice = int | str | Sequence[str]


@budgets.single_threaded_blas
def robust_output_feedback(
    plant: UncertainSystem,
    measurements: SignalChoice,
    controls: SignalChoice,
    *,
    gamma: float = 1.0,
    structure: ArrayLike | None = None,
    order: int | None = None,
    effort: float = 1.0,
    time_limit: float = 600.0,
) -> RobustDesign:
    r"""Design u = K y for all machines within the bounds of an uncertain plant.

    It makes the structured singular value mu of the loop small, with the gain from w to z as one
    more block, and where real numbers are uncertain also the largest gain over the worst machines
    that can be found. Below `gamma` for all machines within the bounds the design is robust. What
    is returned is proven over all frequencies, in ball arithmetic, by :func:`robust_performance`
    and :func:`worst_case_gain`; no grid, no sample and no solver is believed.

    Parameters
    ----------
    plant : UncertainSystem
        Open loop, continuous or discrete, with its weights: disturbances w and controls u to
        performance z and measurements y.
    measurements, controls : int, str or sequence of str
        The measurements y among the outputs and the controls u among the inputs: names, or the
        number of the last ones, as of :class:`GeneralizedPlant`.
    gamma : float, optional
        The gain from w to z that is asked for; 1 by default, as weights are usually made.
    structure : array_like of bool, optional
        True where the controller may differ from zero, as of :func:`static_output_feedback`: of
        shape (nu, ny) for u = K y, or (order + nu, order + ny) for [[Ak, Bk], [Ck, Dk]].
    order : int, optional
        The most states that the controller may have. By default as few as cost next to nothing;
        with a `structure` the number of its states, 0 by default.
    effort : float
        Factor on the work that the search may do, counted in steps: every machine, busy or idle,
        gives the same answer.
    time_limit : float
        A safety net, in seconds. If it is reached the status is "time_limit".

    Returns
    -------
    RobustDesign
        Its `controller` is None if none is proven; then `reason` says why.

    Raises
    ------
    InvalidInputError
        If an argument does not fit.

    Notes
    -----
    A K step designs an H-infinity controller of full order for the plant with scalings around it;
    a D step fits them with stable systems of low order [1]_. Between these the controller is
    shortened and polished without fits: its numbers and the scalings D and, for real numbers, G
    of a set of frequencies [2]_ are free at once in a descent on sums of high powers of the
    scaled gain. Frequencies at which the proof finds more join the set.

    These scalings take a number as complex in part. So where there are real numbers, or a
    `structure`, another search goes without [3]_: the largest norm over a set of machines is
    lowered by nonsmooth descents, the worst corner of the numbers joins the set, and when none is
    worse the proof is asked, whose worst machine joins, too. It ends when the proof finds nothing
    worse, and the better one of both searches is returned. The search by scenarios comes first, and
    alone where nothing is left to gain: `lower_bound` of the result is the smallest gain that one
    of the machines allows, proven. Uncertain dynamics enter its set only by the witnesses of
    proofs. Of a structure more than one start is tried.

    The problem is not convex: what is found is a local minimum.

    References
    ----------
    .. [1] J. C. Doyle, "Structured uncertainty in control system design", CDC 1985.
    .. [2] M. K. H. Fan, A. L. Tits, J. C. Doyle, "Robustness in the presence of mixed parametric
       uncertainty and unmodeled dynamics", IEEE Transactions on Automatic Control 36 (1991) 25-38.
    .. [3] P. Apkarian, M. N. Dao, D. Noll, "Parametric robust structured control design", IEEE
       Transactions on Automatic Control 60 (2015) 1857-1869.

    Examples
    --------
    A lag whose gain is known to 20 %, with a disturbance on its input and a price on u:

    >>> import robustpolish as rp
    >>> b = rp.uncertain.real("b", 1.0, percent=20)
    >>> plant = rp.uncertain.system(
    ...     [[-0.1]], [[1.0, 0.0, b]], [[1.0], [0.0], [1.0]],
    ...     [[0, 0, 0], [0, 0, 0.5], [0, 0.1, 0]],
    ...     inputs=["push", "noise", "u"], outputs=["x", "price", "y"])
    >>> design = rp.robust_output_feedback(plant, "y", "u", gamma=1.5)
    >>> design.status, design.controller.input_labels, design.controller.output_labels
    ('robust', ['y'], ['u'])
    >>> bool(design.worst_case.upper < 1.5)
    True

    No controller does noticeably better, and a static one is enough:

    >>> bool(design.worst_case.upper < 1.01 * design.lower_bound), design.order
    (True, 0)
    """
    system, ny, nu = _sorted(plant, measurements, controls)
    gamma, effort = positive("gamma", gamma), positive("effort", effort)
    budget = budgets.Budget(effort * WORK, positive("time_limit", time_limit, "s"))
    most = None if order is None else checked_order(order)
    mask = None if structure is None else checked_structure(structure, most or 0, nu, ny)
    if mask is not None and not mask.any():
        raise misfit("structure", "no free entry", "one at least", "Mark some entries.")
    problem = RobustProblem.of(system, ny, nu, gamma)

    def none(reason: str) -> RobustDesign:
        elapsed = budget.elapsed
        return RobustDesign(system, None, None, gamma, "no controller", reason, elapsed=elapsed)

    unmoved = [mode for mode in check_solvability(problem.plant).fixed_modes if mode.exact]
    if unmoved:
        return none(str(infeasible_modes_error(unmoved)))
    samples = UncertainSamples(system, ny, nu)
    with budgets.progress_bar("Designing a robust controller"):
        try:
            with budgets.enforce_deadline(budget, grace=0.0):
                if mask is None:
                    chosen, history = _without_structure(problem, samples, most, gamma, budget)
                else:
                    search = ScenarioSearch(samples, gamma, budget)
                    chosen, history = search.with_structure(most or 0, mask), search.history
        except (InfeasibleError, SolverError) as error:
            return none(f"{error}{'' if budget.late else ' Weigh u and add noise to y.'}")
        if chosen is None:
            what = "stable on all machines of the set" if mask is not None else "well-posed"
            reason = f"No controller was found whose loop is {what}. Ask for less, or free more."
            return none(reason)
        with budgets.enforce_deadline(budget):
            return _design(samples, chosen, history, budget)


def _without_structure(
    problem: RobustProblem,
    samples: UncertainSamples,
    order: int | None,
    gamma: float,
    budget: budgets.Budget,
) -> tuple[RobustCandidate | None, list[dict[str, Any]]]:
    """Search in two ways and keep the best that is proven, of those there was time for."""
    scenarios = ScenarioSearch(samples, gamma, budget.share(SCENARIO_SHARE))
    scalings, offered = ScalingSearch(problem, order, budget), list[RobustCandidate]()
    try:
        for candidate in _candidates(problem, scenarios, scalings):
            if candidate.performance:  # it counts if there was time for its proof
                offered.append(candidate)
    except budgets.DeadlineError:
        if not offered:
            raise
    best = max(offered, key=lambda one: one.rank, default=None)
    if best is not None:
        best.lower_bound = max(one.lower_bound for one in offered)
    return best, [*scenarios.history, *scalings.history]


def _candidates(
    problem: RobustProblem, scenarios: ScenarioSearch, scalings: ScalingSearch
) -> Iterator[RobustCandidate]:
    """Yield what a search by scenarios finds, where there are real numbers, and by scalings."""
    system, numbers, order = scenarios.samples.system, scenarios.samples.numbers, scalings.order
    first = scenarios.from_nominal(order) if numbers else None
    if first is not None:
        yield first
        if first.is_best_possible and first.is_robust:
            return
    try:
        found = _by_scalings(problem, scalings, system, scenarios.gamma)
    except SolverError:
        if first is None:
            raise
        return
    if found is None:
        return
    if numbers:
        found.worst = worst_case_gain(system.lft(found.controller))
    yield found
    if numbers and (first is None or found.rank > first.rank):
        again = scenarios.from_controller(found.controller, order)
        if again is not None:
            yield again


def _by_scalings(
    problem: RobustProblem, search: ScalingSearch, system: UncertainSystem, gamma: float
) -> RobustCandidate | None:
    """Search by scalings, and prove until the proof and the search agree."""
    found = search.run()
    best: RobustCandidate | None = None
    for count in range(PROOFS):
        controller = problem.controller(found.controller)
        if controller is None:
            break
        one = RobustCandidate(controller, system, gamma, "scalings")
        if best is None or one.performance.lower > best.performance.lower:
            best = one
        agreed = one.performance.mu[1] <= found.level * (1 + AGREES)
        if agreed or search.budget.over or count + 1 == PROOFS:
            break
        found = search.with_refined_frequencies(found)
    return best


def _sorted(plant: Any, measurements: Any, controls: Any) -> tuple[UncertainSystem, int, int]:
    """Return the plant with its measurements and controls last, and their numbers."""
    remedy = "Make it with uncertain_real and the like; for a certain plant use output_feedback."
    instance_of("plant", plant, UncertainSystem, "an UncertainSystem", remedy)
    if not plant.blocks:
        shown = described("a plant in which nothing is uncertain")
        raise invalid("plant", shown, "an uncertain plant", "Use output_feedback for this one.")
    named = control.StateSpace(
        [], [], [], np.zeros(plant.shape), 0, inputs=plant.input_labels, outputs=plant.output_labels
    )
    ordered, ny, nu = sorted_signals(named, measurements, controls)
    for argument, count, what in (("measurements", ny, "y"), ("controls", nu, "u")):
        if not count:
            raise invalid(argument, described("none"), f"at least one {what}", "Name one.")
    counts = {"disturbances w": plant.ninputs - nu, "performance z": plant.noutputs - ny}
    for what, count in counts.items():
        if not count:
            shown = described(f"a plant without {what}")
            remedy = "Add weights: what disturbs the machine, and what is to stay small."
            raise invalid("plant", shown, "signals from w to z besides u and y", remedy)
    rows = [plant.output_labels.index(name) for name in ordered.output_labels]
    columns = [plant.input_labels.index(name) for name in ordered.input_labels]
    return plant[rows, columns], ny, nu
