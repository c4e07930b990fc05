"""Dynamic output feedback for every machine within the bounds of an uncertain plant."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import control
import numpy as np

from robustpolish.errors import SolverError
from robustpolish.long_calls import Budget, same_bits, working
from robustpolish.models import GeneralizedPlant
from robustpolish.models.plant.sorting import sorted_signals
from robustpolish.models.uncertain.system import UncertainSystem
from robustpolish.robust.performance import RobustPerformance, robust_performance
from robustpolish.synthesis.certificate.certificate import certify
from robustpolish.synthesis.problem.preflight import diagnose, refuse
from robustpolish.synthesis.uncertain.problem import RobustProblem
from robustpolish.synthesis.uncertain.robust_design import RobustDesign, Status
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
    order: int | None = None,
    effort: float = 1.0,
    time_limit: float = 600.0,
) -> RobustDesign:
    r"""Design u = K y for all machines within the bounds of an uncertain plant.

    It makes the structured singular value mu of the loop small, with the gain from w to z as one
    more block. Proven below 1, every machine within the bounds is stable with a gain below
    `gamma`. What is returned is proven over all frequencies, in ball arithmetic, by
    :func:`robust_performance`; no grid and no solver is believed.

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
    order : int, optional
        The most states that the controller may have. By default as few as cost next to nothing.
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
    scaled gain. Frequencies at which the proof finds more join the set. The problem is not
    convex: what is found is a local minimum.

    References
    ----------
    .. [1] J. C. Doyle, "Structured uncertainty in control system design", CDC 1985.
    .. [2] M. K. H. Fan, A. L. Tits, J. C. Doyle, "Robustness in the presence of mixed parametric
       uncertainty and unmodeled dynamics", IEEE Transactions on Automatic Control 36 (1991) 25-38.

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
    """
    system, ny, nu = _sorted(plant, measurements, controls)
    gamma, effort = positive("gamma", gamma), positive("effort", effort)
    budget = Budget(effort * POLICY.work, positive("time_limit", time_limit, "s"))
    most = _checked_order(order)
    problem = RobustProblem.of(system, ny, nu, gamma)
    unmoved = [mode for mode in diagnose(problem.plant).fixed_modes if mode.exact]
    if unmoved:
        return _none(system, gamma, str(refuse(unmoved)), budget)
    with working("Designing a robust controller"):
        search = Search(problem, most, budget)
        try:
            found = search.run()
        except SolverError as error:
            return _none(system, gamma, f"{error} Weigh u and add noise to y.", budget)
        best: tuple[control.StateSpace, RobustPerformance] | None = None
        for count in range(POLICY.proofs):
            controller = problem.controller(found.controller)
            if controller is None:
                break
            performance = robust_performance(system.lft(controller), gamma)
            if best is None or performance.lower > best[1].lower:
                best = controller, performance
            agreed = found.level * (1 + POLICY.agrees)
            if performance.mu[1] <= agreed or budget.over or count + 1 == POLICY.proofs:
                break
            found = search.mended(found)
        if best is None:
            return _none(system, gamma, "The loop of the best controller is ill-posed.", budget)
        return _judged(system, problem, *best, search, gamma)


def _judged(
    system: UncertainSystem,
    problem: RobustProblem,
    controller: control.StateSpace,
    performance: RobustPerformance,
    search: Search,
    gamma: float,
) -> RobustDesign:
    """Say what a proof means; without one there is no controller."""
    budget, history = search.budget, tuple(search.history)
    certificate = certify(_nominal(system, problem), controller)
    if not certificate.valid or not performance.proven:
        why = "; ".join(certificate.reasons) or performance.status
        reason = f"The best controller found could not be proven ({why}). Price u and add noise."
        return RobustDesign(
            system, None, None, gamma, "not proven", reason,
            history=history, elapsed=budget.elapsed,
        )  # fmt: skip
    status: Status = "robust" if performance.lower >= 1 else "limited"
    if budget.late and status == "limited":
        status = "time_limit"
    return RobustDesign(
        system, controller, system.lft(controller), gamma, status,
        _reason(performance, gamma, budget), certificate, performance, history, budget.elapsed,
    )  # fmt: skip


def _reason(performance: RobustPerformance, gamma: float, budget: Budget) -> str:
    """Say in a sentence what is proven, and what to try."""
    share = performance.lower
    late = " The safety net of time was reached." if budget.late else ""
    if share >= 1:
        text = f"Every machine within the bounds is stable with a gain below {gamma / share:.4g}."
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
    return f"{text}. {advice}{late}"


def _nominal(system: UncertainSystem, problem: RobustProblem) -> GeneralizedPlant:
    """Return the nominal plant from w and u to z and y."""
    nominal: Any = system.nominal
    if not isinstance(nominal, control.StateSpace):
        gain = np.atleast_2d(nominal)
        nominal = control.StateSpace([], [], [], gain, 0)
    return GeneralizedPlant(nominal, problem.plant.ny, problem.plant.nu)


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


def _checked_order(order: Any) -> int | None:
    if order is None:
        return None
    if isinstance(order, bool) or not isinstance(order, int | np.integer) or order < 0:
        raise invalid("order", order, "a whole number of at least 0", "0 is static feedback.")
    return int(order)
