"""What came close is followed where more than noise is left, and the needless goes."""

from dataclasses import replace

import numpy as np
import pytest

from robustpolish.identification.fit.prepared import WorkBudget
from robustpolish.identification.structure.moves_backtrack import VisitedSearches, backtrack
from robustpolish.identification.structure.state import Search, SelectionStep
from tests.identification.decays.pendulums import AT, decay, pendulum
from tests.identification.discover.searches import judged, refitted, search_of
from tests.identification.oscillators import PLACE, of_rig, rig

CUBIC = ("cubic_stiffness", PLACE, {"stiffness": 3.0})
DRAG = ("quadratic_damping", PLACE, {"coefficient": 3.0})
STRIBECK = ("stribeck_friction", PLACE, {"force": 3.0, "static_force": 4.0, "velocity": 0.5})
COULOMB = ("coulomb_friction", PLACE, {"force": 3.0})


@pytest.fixture
def begun(monkeypatch):
    found = search_of(rig(), of_rig(noise=1.0))
    monkeypatch.setattr(
        Search, "fit_with", lambda self, model, *added, near=False: judged(model, 100.0)
    )
    monkeypatch.setattr(Search, "fit_over_windows", lambda self, model, spans: None)
    own = judged(found.reference, 100.0)
    return replace(found, stage=own, linear=own, steps=[found.steps[0], ("refit", own.model)])


def went(search, added, *others):
    """The search after a turn in which one effect was added and others had earned it too."""
    after = search.copy()
    after.accept([added])
    after.selection_steps.append(SelectionStep(search.copy(), (added,), others))
    return after


def growing(left):
    """Going on leaves so much, by the kind of the effect that was added first."""
    followed = []

    def grow(search, _followed):
        first = search.stage.model.effects[0].kind
        followed.append(first)
        search.stage = judged(search.stage.model, left[first])
        return search

    return grow, followed


def test_a_runner_up_that_leaves_visibly_less_takes_the_place(begun):
    added, other = refitted(rig(), *CUBIC, 20.0), refitted(rig(), *DRAG, 21.0)
    search = went(begun, added, other)
    grow, followed = growing({"quadratic_damping": 10.0})
    found = backtrack(search, grow)
    assert followed == ["quadratic_damping"]
    assert [e.kind for e in found.stage.model.effects] == ["quadratic_damping"]
    assert [name for name, _ in found.steps[2:]] == ["quadratic_damping"]
    assert [e.kind for e in search.stage.model.effects] == ["cubic_stiffness"]


def test_steps_are_those_of_the_effects_that_are_left(begun, monkeypatch):
    """A branch that goes on from what was left without an effect brings steps with it along."""
    search = went(begun, refitted(rig(), *DRAG, 50.0))
    search.accept([refitted(search.stage.model, *CUBIC, 40.0)])

    def grow(other, _followed):
        if other.excluded_effects == (DRAG[:2],):
            other.accept([refitted(other.stage.model, *COULOMB, 10.0)])
        return other

    found = backtrack(search, grow)
    names = [e.kind for e in found.stage.model.effects]
    assert set(names) == {"cubic_stiffness", "coulomb_friction"}
    assert [name for name, _ in found.steps] == ["base", "refit", *names]


def test_one_that_leaves_as_much_does_not(begun):
    search = went(begun, refitted(rig(), *CUBIC, 20.0), refitted(rig(), *DRAG, 21.0))
    grow, _ = growing({"quadratic_damping": 18.5})
    assert backtrack(search, grow) is search


def test_an_effect_more_has_to_be_worth_it(begun):
    search = went(begun, refitted(rig(), *CUBIC, 20.0), refitted(rig(), *DRAG, 21.0))

    def grow(other, _followed):
        more = other.stage.model.with_effect(*COULOMB)
        other.stage = judged(more, 17.0)
        other.steps.append(("coulomb_friction", more))
        return other

    assert backtrack(search, grow) is search


def test_where_only_noise_is_left_nothing_is_followed(begun):
    (noise,) = begun.prepared.scales.noise
    search = went(begun, refitted(rig(), *CUBIC, noise), refitted(rig(), *DRAG, 1.1 * noise))
    grow, followed = growing({"quadratic_damping": 0.1 * noise})
    assert backtrack(search, grow) is search
    assert not followed


def test_a_search_that_has_done_its_work_follows_nothing(begun):
    done = WorkBudget(1.0)
    done.spend()
    search = went(begun, refitted(rig(), *CUBIC, 20.0), refitted(rig(), *DRAG, 21.0))
    search.prepared = replace(search.prepared, work=done)
    grow, followed = growing({"quadratic_damping": 10.0})
    assert backtrack(search, grow).stage is search.stage
    assert followed == []
    assert done.refused


def test_coloured_noise_that_a_model_leaves_is_noise_too(begun, monkeypatch):
    (noise,) = begun.prepared.scales.noise
    search = went(begun, refitted(rig(), *CUBIC, 5 * noise), refitted(rig(), *DRAG, 6 * noise))
    grow, followed = growing({"quadratic_damping": 5 * noise})
    monkeypatch.setattr(
        Search, "residual_noise_floor", lambda self, model, predictable: np.array([4.9 * noise])
    )
    backtrack(search, grow)
    assert not followed
    monkeypatch.setattr(
        Search, "residual_noise_floor", lambda self, model, predictable: np.array([noise])
    )
    backtrack(search, grow)
    assert followed


def test_the_simplest_of_a_family_stands_for_it(begun):
    others = [refitted(rig(), *STRIBECK, 21.0), refitted(rig(), *COULOMB, 22.0)]
    drag = refitted(rig(), *DRAG, 23.0)
    search = went(begun, refitted(rig(), *CUBIC, 20.0), *others, drag)
    grow, followed = growing(dict.fromkeys(["coulomb_friction", "quadratic_damping"], 20.0))
    backtrack(search, grow)
    assert followed == ["coulomb_friction", "quadratic_damping"]


def test_what_helps_a_bit_is_followed_where_nothing_earned_its_place(begun):
    """Two that hide each other: the first is tried to see whether the second shows beside it."""
    search = begun.copy()
    search.selection_steps.append(SelectionStep(begun.copy(), (), (refitted(rig(), *DRAG, 95.0),)))

    def grow(other, _followed):
        more = other.stage.model.with_effect(*CUBIC)
        other.stage = judged(more, 10.0)
        other.steps.append(("cubic_stiffness", more))
        return other

    found = backtrack(search, grow)
    assert [e.kind for e in found.stage.model.effects] == ["quadratic_damping", "cubic_stiffness"]
    assert backtrack(search, lambda other, _followed: other) is search


def test_what_the_data_leave_open_is_not_followed(begun):
    search = went(begun, refitted(rig(), *CUBIC, 20.0), refitted(rig(), *DRAG, 21.0))

    def grow(other, _followed):
        other.stage = judged(other.stage.model, 1.0, share=0.9)
        return other

    assert backtrack(search, grow) is search


def test_what_comes_without_an_effect_takes_its_place(begun):
    """The first of two mimics what the second lets show."""
    search = went(begun, refitted(rig(), *DRAG, 50.0))
    search.accept([refitted(search.stage.model, *CUBIC, 40.0)])
    excluded_effects = []

    def grow(other, _followed):
        excluded_effects.append(other.excluded_effects)
        if other.excluded_effects == (DRAG[:2],):
            more = other.stage.model.with_effect("quadratic_stiffness", PLACE, {"stiffness": 1.0})
            other.stage = judged(more, 10.0)
        return other

    found = backtrack(search, grow)
    assert {e.kind for e in found.stage.model.effects} == {"cubic_stiffness", "quadratic_stiffness"}
    assert excluded_effects == [(DRAG[:2],), (CUBIC[:2],)]
    assert not found.excluded_effects


def test_in_a_decay_it_has_to_predict_the_end_too(monkeypatch):
    """The drag of a pendulum is found; a damping that grows with the angle leaves less, by luck."""
    found = search_of(pendulum(), decay(coulomb=0.0, drag=0.05))
    monkeypatch.setattr(
        Search, "fit_with", lambda self, model, *added, near=False: judged(model, 100.0)
    )
    monkeypatch.setattr(Search, "fit_over_windows", lambda self, model, spans: None)
    own = judged(found.reference, 100.0)
    begun = replace(found, stage=own, linear=own, steps=[found.steps[0], ("refit", own.model)])
    drag = refitted(pendulum(), "quadratic_damping", AT, {"coefficient": 0.05}, 20.0)
    other = refitted(pendulum(), "displacement_dependent_damping", AT, {"coefficient": 0.05}, 21.0)
    grow, followed = growing({"pendulum_gravity": 10.0})
    search = went(begun, drag, other)
    assert backtrack(search, grow).stage.model.effects[-1].kind == "quadratic_damping"
    assert followed


def test_a_motion_is_followed_once(begun):
    """An effect that does nothing leads nowhere else, unless something else is barred there."""
    search = went(begun, refitted(rig(), *CUBIC, 20.0))
    followed = VisitedSearches([turn.before for turn in search.selection_steps])
    assert followed.already_visited(begun)
    assert not followed.already_visited(search)
    idle = replace(search, stage=judged(search.stage.model.with_effect(*COULOMB), 20.0))
    assert followed.already_visited(idle)
    assert not followed.already_visited(replace(idle, excluded_effects=(CUBIC[:2],)))
    assert not followed.already_visited(replace(idle, stage=judged(idle.stage.model, 20.001)))


def test_where_runs_diverge_none_is_like_another(begun):
    lost = replace(begun, stage=judged(begun.stage.model, np.inf))
    followed = VisitedSearches()
    assert not followed.already_visited(lost)
    assert not followed.already_visited(lost)
