"""Dynamic output feedback for every machine within the bounds of an uncertain plant."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray

from robustpolish.deadline import OutOfTimeError, ends_with
from robustpolish.errors import InfeasibleError, SolverError
from robustpolish.long_calls import Budget, same_bits, working
from robustpolish.models.plant.sorting import sorted_signals
from robustpolish.models.uncertain.system import UncertainSystem
from robustpolish.robust.performance import robust_performance, worst_case_gain
from robustpolish.synthesis.methods.fixed_order import checked_order
from robustpolish.synthesis.methods.static_output_feedback import checked_structure
from robustpolish.synthesis.problem.preflight import diagnose, refuse
from robustpolish.synthesis.uncertain.problem import RobustProblem
from robustpolish.synthesis.uncertain.robust_design import Candidate, RobustDesign, judged
from robustpolish.synthesis.uncertain.scenarios.by_scenarios import FreeSearch, with_structure
from robustpolish.synthesis.uncertain.scenarios.machines import Machines
from robustpolish.synthesis.uncertain.search import POLICY, Search
from robustpolish.validation import described, instance_of, invalid, positive

Chosen = int | str | Sequence[str]


@same_bits
def robust_output_feedback(
    plant: UncertainSystem,
    measurements: Chosen,
    controls: Chosen,
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
    >>> b = rp.uncertain_real("b", 1.0, percent=20)
    >>> plant = rp.uncertain_system(
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
    budget = Budget(effort * POLICY.work, positive("time_limit", time_limit, "s"))
    most = None if order is None else checked_order(order)
    mask = None if structure is None else _mask(structure, most or 0, ny, nu)
    problem = RobustProblem.of(system, ny, nu, gamma)
    unmoved = [mode for mode in diagnose(problem.plant).fixed_modes if mode.exact]
    if unmoved:
        return _none(system, gamma, str(refuse(unmoved)), budget)
    machines = Machines(system, ny, nu)
    with working("Designing a robust controller"):
        try:
            with ends_with(budget, grace=0.0):
                if mask is not None:
                    found, history = with_structure(machines, most or 0, mask, budget)
                    chosen = None if found is None else Candidate.by_scenarios(system, found, gamma)
                else:
                    chosen, history = _without_structure(problem, machines, most, gamma, budget)
        except (InfeasibleError, SolverError) as error:
            advice = "" if budget.late else " Weigh u and add noise to y."
            return _none(system, gamma, f"{error}{advice}", budget)
        if chosen is None:
            what = "stable on all machines of the set" if mask is not None else "well-posed"
            reason = f"No controller was found whose loop is {what}. Ask for less, or free more."
            return _none(system, gamma, reason, budget)
        with ends_with(budget):
            return judged(machines, chosen, history, gamma, budget)


def _without_structure(
    problem: RobustProblem,
    machines: Machines,
    order: int | None,
    gamma: float,
    budget: Budget,
) -> tuple[Candidate | None, list[dict[str, Any]]]:
    """Search in two ways and keep the best that is proven, of those there was time for."""
    free = FreeSearch(machines, order, budget.share(POLICY.scenarios))
    search, offered = Search(problem, order, budget), list[Candidate]()
    try:
        for candidate in _candidates(problem, machines, free, search, gamma):
            offered.append(candidate)
    except OutOfTimeError:
        if not offered:
            raise
    best = max(offered, key=lambda one: one.rank(gamma), default=None)
    bound = max((one.lower_bound for one in offered), default=0.0)
    history = [*free.history, *search.history]
    return None if best is None else replace(best, lower_bound=bound), history


def _candidates(
    problem: RobustProblem, machines: Machines, free: FreeSearch, search: Search, gamma: float
) -> Iterator[Candidate]:
    """Yield what a search by scenarios finds, where there are real numbers, and by scalings."""
    system, first = machines.system, None
    found = free.from_nominal() if machines.numbers else None
    if found is not None:
        first = Candidate.by_scenarios(system, found, gamma)
        yield first
        if found.best_possible and first.is_robust(gamma):
            return
    try:
        scaled = _by_scalings(system, problem, search, gamma)
    except SolverError:
        if first is None:
            raise
        return
    if scaled is None:
        return
    if machines.numbers:
        scaled = replace(scaled, worst=worst_case_gain(system.lft(scaled.controller)))
    yield scaled
    if machines.numbers and (first is None or scaled.rank(gamma) > first.rank(gamma)):
        again = free.from_controller(scaled.controller)
        if again is not None:
            yield Candidate.by_scenarios(system, again, gamma)


def _by_scalings(
    system: UncertainSystem, problem: RobustProblem, search: Search, gamma: float
) -> Candidate | None:
    """Search by scalings, and prove until the proof and the search agree."""
    found = search.run()
    best: Candidate | None = None
    for count in range(POLICY.proofs):
        controller = problem.controller(found.controller)
        if controller is None:
            break
        performance = robust_performance(system.lft(controller), gamma)
        if best is None or performance.lower > best.performance.lower:
            best = Candidate(controller, performance)
        agreed = found.level * (1 + POLICY.agrees)
        if performance.mu[1] <= agreed or search.budget.over or count + 1 == POLICY.proofs:
            break
        found = search.mended(found)
    return best


def _none(system: UncertainSystem, gamma: float, reason: str, budget: Budget) -> RobustDesign:
    return RobustDesign(system, None, None, gamma, "no controller", reason, elapsed=budget.elapsed)


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
    for what, count in (
        ("disturbances w", plant.ninputs - nu),
        ("performance z", plant.noutputs - ny),
    ):
        if not count:
            shown = described(f"a plant without {what}")
            remedy = "Add weights: what disturbs the machine, and what is to stay small."
            raise invalid("plant", shown, "signals from w to z besides u and y", remedy)
    rows = [plant.output_labels.index(name) for name in ordered.output_labels]
    columns = [plant.input_labels.index(name) for name in ordered.input_labels]
    return plant[rows, columns], ny, nu


def _mask(structure: ArrayLike, order: int, ny: int, nu: int) -> NDArray[np.bool_]:
    mask = checked_structure(structure, order, nu, ny)
    if not mask.any():
        raise invalid("structure", described("no free entry"), "one at least", "Mark some entries.")
    return mask
