"""One turn of a search, on data with a cubic spring."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from robustpolish.identification.observer.kalman import FREE
from robustpolish.identification.structure import moves_add as module
from robustpolish.identification.structure.candidates import RefitCandidates, stick_slip_candidates
from robustpolish.identification.structure.moves_add import (
    _refit_candidates,
    _refit_other_constants,
    _refit_resonators_at_lines,
    _refit_resonators_elsewhere,
    _refit_with_new_windows,
    _refit_with_smoothing,
    _screening_models,
    _similarly_likely_kinds,
    forward_step,
)
from robustpolish.identification.structure.screening import ScreenedEffect, Screening, screen
from robustpolish.identification.structure.state import RefittedEffect
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.simulation.run import simulate_model as simulate
from tests.hidden_effects.cases import Case, model_of, one, records, two
from tests.identification.discover.searches import judged, refitted, search_of

PLACE = ("x", "ground")


@pytest.fixture
def search():
    case = Case("cubic", one(), [("cubic_stiffness", PLACE, [4e6])], drive=8.0, samples=1500)
    return search_of(model_of(case), records(case)[0][0])


def at_noise(model, search):
    """A fit that leaves noise alone, of what it was fitted to and of what was held out."""
    noise = search.prepared.scales.noise
    quiet = judged(model, noise)
    return replace(quiet, fit=replace(quiet.fit, errors=noise * quiet.fit.errors))


def test_what_earns_its_place_is_added_and_what_came_close_is_kept(search):
    before = search.stage
    assert forward_step(search)
    assert [e.kind for e in search.stage.model.effects] == ["cubic_stiffness"]
    (turn,) = search.selection_steps
    assert turn.before.stage is before
    assert turn.before.added == 0
    assert [item.fitted for item in turn.added] == [search.stage]
    assert turn.added[0] not in turn.others
    assert all(item.fitted.error < before.error for item in turn.others)
    assert {c.step for c in search.candidates} == {1}


def test_at_the_floor_nothing_is_looked_for(search):
    search.stage = at_noise(search.stage.model, search)
    assert not forward_step(search)
    assert not search.selection_steps
    assert not search.candidates


def test_what_was_fitted_counts_where_the_quiet_part_of_a_record_is_held_out(search):
    """The tail of a decay is at the noise of its sensor whatever is missing from the model."""
    quiet = at_noise(search.stage.model, search)
    assert search.at_noise_floor(quiet)
    assert not search.at_noise_floor(replace(quiet, fit=search.stage.fit))
    chaotic = replace(quiet, fit=search.stage.fit, reproducible=False)
    assert search.at_noise_floor(chaotic)


def test_absurd_numbers_that_explain_all_keep_nothing_else_from_being_tried(search, monkeypatch):
    """Elastic Coulomb friction is a hysteresis of a huge exponent, which fits and is refused."""
    steep = {"force": 4.0, "stiffness": 2e3, "exponent": 20.0, "beta": 0.5, "gamma": 0.5}
    absurd = ScreenedEffect(Effect("bouc_wen_hysteresis", PLACE, steep), 100.0, 0.9)
    right = ScreenedEffect(Effect("cubic_stiffness", PLACE, {"stiffness": 4e6}), 10.0, 0.9)
    start = search.stage.model

    def explains_all(model, effect):
        return at_noise(model.with_effect(effect.definition, effect.at, effect.values), search)

    monkeypatch.setattr(search, "fit_with", explains_all)
    tried = _refit_candidates(search, start, RefitCandidates([absurd, right], [], [], []))
    assert [item.screened for item in tried] == [absurd, right]
    far = replace(absurd, score=10.0)
    (only,) = _refit_candidates(
        search, start, RefitCandidates([replace(right, score=100.0), far], [], [], [])
    )
    assert only.effect == right.effect


@pytest.mark.parametrize(("left", "asked"), [(0.5, True), (0.9, False)])
def test_a_friction_that_helps_the_loud_part_alone_may_turn_over_gently(
    search, monkeypatch, left, asked
):
    def item(kind):
        found = refitted(search.stage.model, kind, PLACE, {}, 2 * search.stage.error)
        quiet = replace(found.fitted, over_fitted=lambda: left * search.stage.fitted)
        return replace(found, fitted=quiet)

    friction, other = item("coulomb_friction"), item("dahl_friction")
    monkeypatch.setattr(module, "fits_with_smoothing", lambda some, start, search: some)
    tried = _refit_with_smoothing([friction, other], search.stage.model, search)
    assert tried == ([friction] if asked else [])


def test_kinds_of_the_family_that_are_about_as_likely_are_asked_beside_noise_alone(search):
    """LuGre's friction errs by a few per cent less than Dahl's, which leaves noise alone, too."""
    model = search.stage.model

    def screened(kind, score, at=PLACE):
        return ScreenedEffect(Effect(kind, at), score, 0.3)

    loops = screened("dahl_friction", 650.0)
    likely = screened("lugre_friction", 550.0)
    others = [
        screened("coulomb_friction", 100.0),
        screened("cubic_stiffness", 900.0),
        screened("lugre_friction", 900.0, ("y", "ground")),
    ]
    found = RefitCandidates([loops], [likely, *others], [], [])
    earned = RefittedEffect(loops, judged(model, search.prepared.scales.noise))
    # the one that would be added has been fitted already
    assert _similarly_likely_kinds(earned, found, search.policy.near_score) == [loops, likely]


def test_where_nothing_earns_its_place_what_helped_is_kept(search, monkeypatch):
    monkeypatch.setattr(
        "robustpolish.identification.structure.moves_add.select_effect", lambda ranked, search: []
    )
    monkeypatch.setattr(
        "robustpolish.identification.structure.moves_add.together", lambda *given: []
    )
    assert not forward_step(search)
    (turn,) = search.selection_steps
    assert not turn.added
    assert turn.others[0].effect.kind == "cubic_stiffness"
    assert all(item.fitted.error < search.stage.error for item in turn.others)
    assert not any(item.constant for item in turn.others)


@pytest.mark.parametrize(("times", "leads"), [(0.001, True), (0.02, True), (0.1, False)])
def test_numbers_as_they_were_known_lead_where_the_fit_left_hardly_anything_of_a_spring(
    search, times, leads
):
    """As after the offset of a sensor. One that is ten times too large may be so."""
    stiffness = search.reference.springs[0].stiffness
    moved = search.reference.with_parameters({"spring[0].stiffness": times * stiffness})
    begun = replace(search, stage=judged(moved, 10.0), short_window_model=moved)
    assert (_screening_models(begun)[0] is search.reference) == leads
    assert len(_screening_models(begun)) == 2 + leads


@pytest.mark.parametrize(("most", "asked"), [(1, False), (2, True)])
def test_two_at_once_need_room_for_two(search, monkeypatch, most, asked):
    tried = []
    monkeypatch.setattr(module, "select_effect", lambda *_: [])
    monkeypatch.setattr(module, "together", lambda *_: tried.append(1) or [])
    policy = replace(search.policy, most_effects=most)
    forward_step(replace(search, prepared=replace(search.prepared, policy=policy)))
    assert bool(tried) == asked


def test_what_swings_by_itself_is_tried_at_all_places():
    """Found at one place, it may as well hang at another."""
    at, values = ("x",), [0.1, 0.1 * 60.0**2, 0.3]
    case = Case("hanging", two(), [("attached_resonator", at, values)], drive=8.0, samples=1500)
    search = search_of(model_of(case), records(case)[0][0])
    elsewhere = Effect("attached_resonator", ("x_m",), {"mass": 0.1, "stiffness": 360.0})
    fitted = search.fit_with(search.stage.model, elsewhere)
    refit = RefittedEffect(ScreenedEffect(elsewhere, 10.0, 0.1), fitted)
    (found,) = _refit_resonators_elsewhere([refit], search.stage.model, search)
    assert found.effect.at == at
    mass = found.fitted.model.effects[-1].values["mass"]
    assert mass == pytest.approx(0.1, rel=0.1)
    assert all(found.fitted.error < fitted.error)


def test_what_swings_by_itself_is_tried_at_the_lines_of_the_force():
    """Screening has not named it: a slow and heavy mass seemed to explain more."""
    at, values = ("x",), [0.1, 0.1 * 60.0**2, 0.3]
    case = Case("hanging", two(), [("attached_resonator", at, values)], drive=8.0, samples=1500)
    search = search_of(model_of(case), records(case)[0][0])
    line = Effect("harmonic_force", at, {"amplitude": 1.0, "frequency": 62.0 / (2 * np.pi)})
    search.screening = Screening((ScreenedEffect(line, 100.0, 0.1),), (), FREE)
    (found,) = _refit_resonators_at_lines([], search.stage.model, search)
    assert (found.effect.kind, found.effect.at) == ("attached_resonator", at)
    assert found.fitted.model.effects[-1].values["mass"] == pytest.approx(0.1, rel=0.1)
    assert _refit_resonators_at_lines([found], search.stage.model, search) == [
        found
    ]  # it helps: no more is tried


def test_what_sticks_and_slips_is_no_force_with_a_line_of_its_own():
    """A slide that a slow spring draws along: it stands still, jumps, and stands still again."""
    model = model_of(Case("drawn along", one()))
    model = model.with_parameters({"spring[0].stiffness": 200.0, "damper[0].damping": 1.0})
    time = 2e-3 * np.arange(2000)
    data = xr.Dataset({"F_x": ("time", 10.0 * time)}, {"time": time})
    # Over half the speed a fit ends at one of two forces at rest, by the rounding of a processor.
    friction = {"force": 2.0, "static_force": 3.2, "velocity": 0.1}
    truth = model.with_effect("stribeck_friction", PLACE, friction)
    x = simulate(truth, data).outputs[:, 0]
    noise = 1e-4 * np.random.default_rng(0).standard_normal(x.size)
    search = search_of(model, data.assign({model.output_names[0]: ("time", x + noise)}))
    stuck = stick_slip_candidates(search.stage.fit, search.prepared, screen(model, search.prepared))
    assert {c.effect.kind for c in stuck} == {"coulomb_friction", "stribeck_friction"}
    assert forward_step(search)
    (found,) = search.stage.model.effects
    assert found.kind == "stribeck_friction"
    assert found.values["static_force"] == pytest.approx(3.2, rel=0.05)
    tried = {c.kind for c in search.candidates if np.isfinite(c.nrmse_held_out)}
    assert tried & {"harmonic_force", "attached_resonator"}


def test_what_moves_all_the_time_sticks_nowhere(search):
    assert stick_slip_candidates(search.stage.fit, search.prepared, Screening((), (), FREE)) == []


@pytest.mark.parametrize(("kind", "values"), [("input_delay", [0.005]), ("input_lag", [0.004])])
def test_what_is_late_is_told_from_what_lags(kind, values):
    case = Case("late", one(), [(kind, ("F_x",), values)], drive=8.0, samples=1500)
    search = search_of(model_of(case), records(case)[0][0])
    assert forward_step(search)
    (found,) = search.stage.model.effects
    assert found.kind == kind
    assert [*found.values.values()] == pytest.approx(values, rel=0.02)
    tried = {c.kind for c in search.candidates if np.isfinite(c.nrmse_held_out)}
    assert {"input_delay", "input_lag"} <= tried


@pytest.mark.parametrize(("vanished", "begun"), [(True, [1.0, 10.0, 100.0]), (False, [1.0])])
def test_the_likeliest_begins_larger_if_nothing_of_it_is_left(search, monkeypatch, vanished, begun):
    first, tried = 1e5, []

    def fit_with(_, model, effect, anew=False):
        times = effect.values["stiffness"] / first
        tried.append(times)
        nothing = vanished and times < 100
        found = judged(model.with_effect(effect.kind, effect.at, {"stiffness": first}), 1 / times)
        left = effect.with_values({"stiffness": 0.0 if nothing else 2 * effect.values["stiffness"]})
        return replace(found, fit=replace(found.fit, model=replace(found.model, effects=(left,))))

    monkeypatch.setattr(type(search), "fitted_with", fit_with)
    likely = ScreenedEffect(Effect("cubic_stiffness", PLACE, {"stiffness": first}), 90.0, 0.5)
    start = search.stage.model
    monkeypatch.setattr(module, "rejection_reason", lambda *_: "not asked here")
    found = _refit_candidates(search, start, RefitCandidates([likely], [], [], []))
    assert tried[: len(begun)] == pytest.approx(begun)
    assert found[0].fitted.model.effects[0].values["stiffness"] == 2 * first * begun[-1]


def test_what_would_be_added_is_sought_again_if_it_leaves_far_more_than_noise(search, monkeypatch):
    model, before, noise = search.stage.model, search.stage.error, search.prepared.scales.noise
    kept = refitted(model, "cubic_stiffness", PLACE, {"stiffness": 1e6}, 0.5 * before)
    asked = []

    def leaving(times):
        return replace(kept, fitted=replace(kept.fitted, over_fitted=lambda: times * noise))

    def fit_with(_, model, effect, anew=False):
        asked.append(anew)
        return judged(model.with_effect(effect.kind, effect.at, {"stiffness": 4e6}), 0.1 * before)

    monkeypatch.setattr(type(search), "fitted_with", fit_with)
    (found,) = _refit_with_new_windows([leaving(3.1)], model, search)
    assert asked == [True]
    assert found.fitted.model.effects[0].values["stiffness"] == 4e6
    near = leaving(2.9)
    assert _refit_with_new_windows([near], model, search) == [near]
    assert asked == [True]


def test_beside_a_law_an_offset_and_a_preload_are_both_tried(search):
    model = search.stage.model.with_effect("backlash", PLACE, {"gap": 1e-4})
    load = refitted(model, "constant_force", ("x",), {"force": 1.0}, 1.0)
    offset = ScreenedEffect(Effect("sensor_offset", ("x",), {"offset": 1e-4}), 3.0, 0.1)
    search.screening = Screening((load.screened, offset), (), FREE)
    (found,) = _refit_other_constants([load], model, search)
    assert (found.effect.kind, found.effect.at) == ("sensor_offset", ("x",))
    assert _refit_other_constants([load], search.stage.model, search) == []
