import importlib

import control
import numpy as np
import pytest
from uncertain_plants import column, lag, two_masses

import robustpolish as rp
from robustpolish.base.budget import DeadlineError


@pytest.fixture(scope="module")
def design():
    return rp.robust_output_feedback(lag(), "y", "u", gamma=1.5)


def test_lag_is_robust_with_named_signals_and_a_proof(design):
    assert design.status == "robust"
    assert design.performance.proven
    assert design.certificate.valid
    assert design.controller.input_labels == ["y"]
    assert design.controller.output_labels == ["u"]
    assert design.mu[0] <= design.mu[1] < 1
    assert design.worst_case.upper < 1.5
    for machine in design.plant.sample(5):
        loop = rp.GeneralizedPlant(machine, 1, 1).closed_loop(design.controller)
        assert rp.hinf_norm(loop).value <= design.worst_case.upper


@pytest.mark.long
def test_signals_may_stand_anywhere():
    plant = lag()
    moved = plant[["y", "x", "price"], ["u", "push", "noise"]]
    design = rp.robust_output_feedback(moved, "y", "u", gamma=1.5, order=1)
    same = rp.robust_output_feedback(plant, 1, 1, gamma=1.5, order=1)
    assert design.mu == same.mu
    assert design.order == same.order <= 1


@pytest.mark.parametrize("asked", [{}, {"structure": [[1]], "effort": 0.02}])
def test_discrete_plants_are_proven_as_they_are(asked):
    b = rp.uncertain.real("b", 0.1, percent=20)
    plant = rp.uncertain.system(
        [[0.99]], [[0.1, 0.0, b]], [[1.0], [0.0], [1.0]], [[0, 0, 0], [0, 0, 0.5], [0, 0.1, 0]],
        0.1,
    )  # fmt: skip
    design = rp.robust_output_feedback(plant, 1, 1, gamma=1.5, **asked)
    assert design.status == "robust"
    assert design.controller.dt == 0.1


def test_uncertainty_that_is_too_large_is_told():
    b = rp.uncertain.real("b", 1.0, range=(-0.5, 2.5))  # some machines cannot be moved at all
    plant = rp.uncertain.system(
        [[0.5]], [[1.0, 0.0, b]], [[1.0], [0.0], [1.0]], [[0, 0, 0], [0, 0, 1], [0, 0.1, 0]]
    )
    design = rp.robust_output_feedback(plant, 1, 1, gamma=100.0, order=1, effort=0.05)
    assert design.status == "limited"
    assert design.margin < 1 / 1.5 + 0.34  # b reaches 0 at two thirds of its way down
    assert "b = " in design.reason


def test_a_mode_that_nothing_moves_is_named():
    k = rp.uncertain.real("k", 1.0, percent=10)
    plant = rp.uncertain.system([[-k, 0], [0, 1.0]], [[1, 1], [1, 0]], [[1, 0], [1, 1]])
    design = rp.robust_output_feedback(plant, 1, 1)
    assert design.status == "no controller"
    assert design.controller is None
    assert design.closed_loop is None
    assert design.worst_case is None
    assert "x[1]" in design.reason


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("z", "u"), "names among"),
        ((1, 3), "disturbances w"),
        ((0, 1), "at least one y"),
        ((1, 1, {"order": -1}), "order"),
        ((1, 1, {"gamma": 0}), "gamma"),
        ((1, 1, {"structure": np.ones((2, 2))}), r"shape \(1, 1\)"),
        ((1, 1, {"structure": [[0]]}), "free entry"),
    ],
)
def test_what_does_not_fit_is_refused(arguments, words):
    y, u, *more = arguments
    with pytest.raises(rp.InvalidInputError, match=words):
        rp.robust_output_feedback(lag(), y, u, **(more[0] if more else {}))


def test_plants_without_uncertainty_are_refused():
    with pytest.raises(rp.InvalidInputError, match="output_feedback"):
        rp.robust_output_feedback(control.ss(-1, [[1, 1]], [[1], [1]], 0), 1, 1)
    with pytest.raises(rp.InvalidInputError, match="UncertainSystem"):
        rp.robust_output_feedback(lag().at({"b": 1.0}), 1, 1)


def test_a_structure_is_kept_and_proven():
    plant = lag()
    free = np.array([[1, 1], [1, 0]], bool)
    design = rp.robust_output_feedback(
        plant, "y", "u", gamma=1.0, structure=free, order=1, effort=0.02
    )
    assert (design.status, design.method, design.order) == ("robust", "scenarios", 1)
    assert design.controller.D[0, 0] == 0
    assert design.worst_case.proven
    assert design.worst_case.upper < 1.0


def test_dynamics_enter_a_structure_by_their_worst_cases():
    error = rp.uncertain.dynamics("error", bound=0.3)
    plant = lag() * rp.uncertain.append(np.eye(2), 1 + error)
    design = rp.robust_output_feedback(plant, 1, 1, gamma=1.0, structure=[[1]], effort=0.05)
    assert design.status == "robust"
    assert design.performance.proven
    known = [step["machines"] for step in design.history]
    assert max(known) > 2  # the nominal machine, a corner, and witnesses of proofs


def test_when_the_time_is_over_what_was_proven_counts(monkeypatch):
    def over(*_):
        raise DeadlineError("The time was over.")

    module = importlib.import_module("robustpolish.synthesis.uncertain.robust_output_feedback")
    monkeypatch.setattr(module, "_by_scalings", over)
    design = rp.robust_output_feedback(lag(), "y", "u", gamma=1.5)
    assert design.status == "robust"
    assert design.performance.proven
    late = rp.robust_output_feedback(lag(), "y", "u", gamma=1.5, time_limit=1e-6)
    assert (late.status, late.controller) == ("no controller", None)
    assert "time limit of 1e-06 s" in late.reason
    assert "Weigh u" not in late.reason


@pytest.mark.long
def test_two_masses_are_far_better_than_with_the_nominal_design():
    """Proven for both: the worst machine's gain is less than half of that of the nominal design."""
    plant = two_masses()
    nominal = rp.output_feedback(rp.GeneralizedPlant(plant.nominal, 1, 1))
    worst = rp.worst_case_gain(plant.lft(nominal.controller))
    design = rp.robust_output_feedback(plant, "measured", "force", gamma=3.0)
    assert worst.proven
    assert design.worst_case.proven
    assert design.status == "robust"
    assert design.worst_case.upper < 0.4 * worst.lower
    assert design.method == "scenarios"
    assert design.lower_bound <= design.worst_case.lower


@pytest.mark.long
def test_distillation_column_has_a_proven_mu_below_one_with_twelve_states():
    design = rp.robust_output_feedback(column(), 2, 2, order=12)
    assert design.order <= 12
    assert design.performance.proven
    assert design.mu[1] <= 1.0
    assert np.isfinite(design.certificate.achieved)


@pytest.mark.long
def test_the_default_order_of_the_column_costs_at_most_two_percent():
    # 0.986 is proven with twelve states.
    design = rp.robust_output_feedback(column(), 2, 2)
    assert design.status in ("robust", "limited")
    assert design.performance.proven
    assert design.order < 12
    assert design.mu[1] < 1.02


def test_a_design_shows_what_is_proven(design):
    shown = repr(design)
    assert shown.startswith("Robust design: robust")
    assert "mu at most" in shown
    assert design.reason in shown
    assert design.margin == design.performance.lower
    assert design.mu == design.performance.mu


def test_a_worst_machine_between_the_corners_is_found_by_the_proof():
    """The damping is a parabola of a number: the middle is worst, and what it allows is reached."""
    b = rp.uncertain.real("b", 0.2, range=(-1.0, 1.0))
    plant = rp.uncertain.system(
        [[-0.1 - b * b]], [[1.0, 0.0, 1.0]], [[1.0], [0.0], [1.0]],
        [[0, 0, 0], [0, 0, 0.5], [0, 0.1, 0]],
    )  # fmt: skip
    design = rp.robust_output_feedback(plant, 1, 1, gamma=2.0, structure=[[1]], effort=0.1)
    assert design.worst_case.proven
    middle = rp.output_feedback(rp.GeneralizedPlant(plant.at({"b": 0.0}), 1, 1))
    assert design.worst_case.upper <= 1.01 * middle.certificate.achieved


def test_the_lower_bound_is_what_one_machine_allows(design):
    weak = rp.output_feedback(rp.GeneralizedPlant(lag().at({"b": 0.8}), 1, 1))
    assert design.lower_bound == weak.lower_bound <= design.worst_case.lower * (1 + 1e-9)


def test_a_pattern_that_moves_nothing_is_told():
    k = rp.uncertain.real("k", 1.0, percent=10)
    # The control that moves the unstable state stays zero.
    plant = rp.uncertain.system(
        [[k, 0], [0, -1.0]], [[1, 1, 0], [1, 0, 1]], [[1, 1], [0, 1], [1, 0]], 0
    )
    design = rp.robust_output_feedback(plant, 2, 2, structure=[[0, 0], [1, 1]])
    assert (design.status, design.controller) == ("no controller", None)


def test_too_few_states_are_told():
    # An unstable oscillator that no gain on its position stabilises.
    k = rp.uncertain.complex("k", 1.0, radius=0.1)
    plant = rp.uncertain.system(
        [[0, 1], [-k, 0.1]], [[0, 0, 0], [1, 0, 1]], [[1, 0], [0, 0], [1, 0]],
        [[0, 0, 0], [0, 0, 1], [0, 1, 0]],
    )  # fmt: skip
    design = rp.robust_output_feedback(plant, 1, 1, order=0, effort=0.03)
    assert design.status == "no controller"
    assert "few states" in design.reason


# Steps of D-K iteration and of the descent: against analysis and output feedback.
