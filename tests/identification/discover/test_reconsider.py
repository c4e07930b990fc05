"""The needless goes, a kind gives way to a better one of its family, and steps are told anew."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from robustpolish.identification.diagnosis.findings import indistinguishable_pair
from robustpolish.identification.fit.parameters import free_parameters, has_smoothing
from robustpolish.identification.policy import POLICY
from robustpolish.identification.structure import moves_replace as reconsider
from robustpolish.identification.structure.moves_replace import (
    backward_elimination,
    fits_of_simpler_kinds,
    fits_with_smoothing,
    lower_error_kinds,
    prune_indistinguishable,
    rebuild_steps,
    replace_kinds,
)
from robustpolish.identification.structure.screening import ScreenedEffect
from robustpolish.identification.structure.state import RefittedEffect, Search, SelectionStep
from robustpolish.linear.response import linear_response
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.effects.evaluate import force_along
from robustpolish.machines.effects.kind import Motion
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import Damper, Dof, Input, Output, Spring
from tests.hidden_effects.cases import Case, model_of, one, records
from tests.identification.discover.searches import STRIBECK, judged, refitted, search_of
from tests.identification.oscillators import PLACE, of_rig, rig

CUBIC = ("cubic_stiffness", PLACE, {"stiffness": 3.0})
COULOMB = ("coulomb_friction", PLACE, {"force": 3.0})
DAHL = Effect("dahl_friction", PLACE, {"force": 3.0, "stiffness": 50.0})


def kinds(search):
    return [e.kind for e in search.stage.model.effects]


def two(first):
    """A search that found one effect, then a cubic spring."""
    begun = search_of(rig(), of_rig(noise=1.0))
    own = judged(begun.reference, 100.0)
    found = replace(begun, stage=own, linear=own, screening=object())
    one = refitted(rig(), *first, 20.0)
    found.accept([one])
    found.accept([refitted(one.fitted.model, *CUBIC, 10.0)])
    return found


@pytest.mark.parametrize(("left", "kept"), [(10.5, 1), (20.0, 2)])
def test_what_the_others_explain_as_well_goes(monkeypatch, left, kept):
    search = two(COULOMB)
    monkeypatch.setattr(Search, "fit_with", lambda self, model: judged(model, left))
    monkeypatch.setattr(Search, "fit_over_windows", lambda self, model, spans: None)
    found = backward_elimination(search)
    assert kinds(found) == ["coulomb_friction", "cubic_stiffness"][2 - kept :]
    assert bool(found.reasons) == (kept == 1)
    assert kinds(search) == ["coulomb_friction", "cubic_stiffness"]
    # the last one is asked on request only
    assert kinds(backward_elimination(found, last=True)) == ([] if kept == 1 else kinds(search))


@pytest.mark.parametrize(("sliding", "kept"), [(3.0, 1), (0.1, 2)])
def test_what_another_would_be_absurd_without_stays(monkeypatch, sliding, kept):
    """A friction that falls with speed, to nothing, leaves as little as one beside a drag."""
    begun = search_of(rig(), of_rig(noise=1.0))
    drag = refitted(rig(), "quadratic_damping", PLACE, {"coefficient": 3.0}, 20.0)
    begun.accept([drag])
    friction = Effect("stribeck_friction", PLACE, STRIBECK)
    begun.accept([refitted(drag.fitted.model, friction.kind, PLACE, friction.values, 10.0)])

    def fit_with(self, model, *effects, near=False):
        alone = rig().with_effect(friction.kind, PLACE, friction.values | {"force": sliding})
        return judged(alone, 10.2)

    monkeypatch.setattr(Search, "fitted_with", fit_with)
    monkeypatch.setattr(Search, "fit_over_windows", lambda self, model, spans: None)
    assert len(kinds(backward_elimination(begun))) == kept


@pytest.mark.parametrize(("open_", "kept"), [(True, 1), (False, 2)])
def test_what_has_no_place_goes_if_the_others_do_as_well_beside_numbers_as_known(
    monkeypatch, open_, kept
):
    """It has bent the springs, and no fit leads back from there."""
    search = two(COULOMB)
    model = search.stage.model
    search.stage = judged(model, 10.0, share=0.9 if open_ else 0.1)
    search.linear = replace(search.linear, fit=replace(search.linear.fit, model=rig(120.0)))

    def fit_with(self, start, *added):
        from_known = start.parameters == search.linear.model.parameters
        for effect in added:
            start = start.with_effect(effect.kind, effect.at, effect.values)
        return judged(start, 10.2 if from_known and added else 20.0)

    monkeypatch.setattr(Search, "fitted_with", fit_with)
    monkeypatch.setattr(Search, "fit_over_windows", lambda self, model, spans: None)
    assert len(kinds(backward_elimination(search))) == kept


def test_what_stood_by_the_one_that_goes_is_asked_again(monkeypatch):
    search = two(COULOMB)
    drag = refitted(search.stage.model, "quadratic_damping", PLACE, {"coefficient": 3.0}, 10.0)
    search.accept([drag])
    errors = {
        frozenset({"coulomb_friction", "cubic_stiffness"}): 20.0,
        frozenset({"coulomb_friction", "quadratic_damping"}): 10.2,
        frozenset({"coulomb_friction"}): 10.3,
        frozenset({"quadratic_damping"}): 50.0,
        frozenset(): 100.0,
    }
    monkeypatch.setattr(Search, "fit_with", fitting(errors))
    monkeypatch.setattr(Search, "fit_over_windows", lambda self, model, spans: None)
    assert kinds(backward_elimination(search, last=True)) == ["coulomb_friction"]


def fitting(errors):
    """Fits whose error follows from the kinds of the effects."""

    def fit_with(self, model, *effects, near=False):
        for effect in effects:
            model = model.with_effect(effect.kind, effect.at, effect.values)
        return judged(model, errors[frozenset(e.kind for e in model.effects)])

    return fit_with


def chain():
    """Two masses on springs, the first pushed and both seen."""
    return MechanicalModel(
        [Dof("m1", 1.0), Dof("m2", 1.0)],
        [Spring(("m1", "ground"), 400.0), Spring(("m2", "m1"), 300.0)],
        [Damper(("m1", "ground"), 2.0), Damper(("m2", "m1"), 1.0)],
        [Input("F", ("m1", "ground"))],
        [Output("x1", ("m1", "ground")), Output("x2", ("m2", "ground"))],
    )


def of_chain():
    """What it does under a broad force."""
    rng, time = np.random.default_rng(0), np.arange(1000) * 0.02
    push = rng.standard_normal(time.size)
    seen = linear_response(chain().state_space(), time, push[:, None]).outputs
    seen = seen + 0.01 * np.std(seen, axis=0) * rng.standard_normal(seen.shape)
    columns = {"F": push, "x1": seen[:, 0], "x2": seen[:, 1]}
    return xr.Dataset({k: ("time", v) for k, v in columns.items()}, coords={"time": time})


def placed(errors):
    """Fits whose error follows from the place of a constant force."""

    def fit_with(self, model, effect, near):
        fitted = model.with_effect(effect.kind, effect.at, effect.values)
        return judged(fitted, errors[effect.at]) if effect.at in errors else None

    return fit_with


@pytest.mark.parametrize(
    ("error", "taken", "alike"),
    [(5.0, True, False), (9.0, False, True), (10.1, False, True), (20.0, False, False)],
)
def test_a_kind_gives_way_to_a_better_one_of_its_family(monkeypatch, error, taken, alike):
    """Far above the noise, one with more numbers has to be visibly better."""
    search = two(COULOMB)
    errors = {
        frozenset({"cubic_stiffness"}): 20.0,
        frozenset({"cubic_stiffness", "dahl_friction"}): error,
    }
    monkeypatch.setattr(Search, "fit_with", fitting(errors))
    candidate = ScreenedEffect(DAHL, 0.0, 0.5)
    monkeypatch.setattr(reconsider, "family_alternatives", lambda *given: [candidate])
    monkeypatch.setattr(reconsider, "find_force_equivalents", lambda *given: [])
    monkeypatch.setattr(reconsider, "_fits_whole_record_as_well", lambda *given: False)
    monkeypatch.setattr(reconsider, "backward_elimination", lambda search, last=False: search)
    found = replace_kinds(search)
    assert (kinds(found)[-1] == "dahl_friction") == taken
    assert bool(found.indistinguishable_pairs) == alike
    if alike:
        pair = found.indistinguishable_pairs[0]
        assert {pair.first.kind, pair.second.kind} == {
            "coulomb_friction", "dahl_friction",
        }  # fmt: skip


@pytest.mark.parametrize(("needless", "taken"), [(10.2, True), (20.0, False)])
def test_of_kinds_that_tie_the_one_that_needs_fewer_others_is_taken(monkeypatch, needless, taken):
    """The offset of a sensor beside a cubic spring makes a quadratic one, and a constant force."""
    search = two(COULOMB)
    errors = {
        frozenset({"cubic_stiffness"}): 20.0,
        frozenset(): 100.0,
        frozenset({"dahl_friction"}): needless,
        frozenset({"cubic_stiffness", "dahl_friction"}): 10.0,
    }
    monkeypatch.setattr(Search, "fit_with", fitting(errors))
    monkeypatch.setattr(Search, "fit_over_windows", lambda self, model, spans: None)
    monkeypatch.setattr(
        reconsider, "family_alternatives", lambda *_: [ScreenedEffect(DAHL, 0.0, 0.5)]
    )
    monkeypatch.setattr(reconsider, "find_force_equivalents", lambda *_: [])
    found = replace_kinds(search)
    assert kinds(found) == (["dahl_friction"] if taken else kinds(search))
    assert bool(found.indistinguishable_pairs) == (not taken)


@pytest.mark.parametrize("last", [True, False])
def test_a_constant_is_asked_for_at_all_other_places(monkeypatch, last):
    """As long as something else was missing, it may have bent to that."""
    push, other = ("constant_force", ("m1",), {"force": 3.0}), ("cubic_stiffness", ("m1", "m2"))
    model = chain()
    begun = search_of(model, of_chain())
    found = replace(begun, stage=judged(model, 100.0), linear=judged(model, 100.0))
    for kind, at, values in [(*other, {"stiffness": 2.0}), push][:: 1 if last else -1]:
        found.accept([refitted(found.stage.model, kind, at, values, 10.0)])
    monkeypatch.setattr(reconsider, "_fits_whole_record_as_well", lambda *given: False)
    monkeypatch.setattr(reconsider, "backward_elimination", lambda search, last=False: search)
    monkeypatch.setattr(Search, "fit_with", placed({("m1",): 10.0, ("m2",): 10.01}))
    (pair,) = replace_kinds(found).indistinguishable_pairs
    assert (pair.first.at, pair.second.at) == (("m1",), ("m2",))
    monkeypatch.setattr(Search, "fit_with", placed({("m2",): 5.0}))
    moved = replace_kinds(found)
    assert [e.at for e in moved.stage.model.effects if e.kind == push[0]] == [("m2",)]


def test_simpler_kinds_begin_with_the_values_they_have_in_common(monkeypatch):
    search = two(COULOMB)
    values = {"force": 3.0, "stiffness": 50.0, "exponent": 9.0, "beta": 0.4, "gamma": 0.6}
    search.stage = judged(rig().with_effect("bouc_wen_hysteresis", PLACE, values), 10.0)
    tried = []

    def fit_with(self, model, effect, near):
        tried.append(effect)
        return judged(model.with_effect(effect.kind, effect.at, effect.values), 10.0)

    monkeypatch.setattr(Search, "fitted_with", fit_with)
    assert len(list(fits_of_simpler_kinds(search, search.stage.model, 0))) == len(tried)
    both = {"force": 3.0, "stiffness": 50.0}
    in_common = {e.kind: e.parameters for e in tried if e.values["force"] == 3.0}
    assert in_common["elastic_coulomb_friction"] == in_common["dahl_friction"] == both
    assert tried[0].kind == "coulomb_friction"
    assert tried[0].values["force"] == 3.0
    # and with the same force: sharp as it is, it yields like an elastic Coulomb element
    (other,) = [e for e in tried if e.kind == "elastic_coulomb_friction" and e.parameters != both]
    assert other.values["force"] == pytest.approx(3.0, rel=0.02)
    assert other.values["stiffness"] == pytest.approx(50.0, rel=0.05)


def test_a_simpler_friction_turns_over_as_gently(monkeypatch):
    """As a jump it would leave more, and the needless numbers of the other would stay."""
    search = two(COULOMB)
    values = {"force": 3.0, "static_force": 3.0, "velocity": 0.4, "width": 0.03}
    search.stage = judged(rig().with_effect("stribeck_friction", PLACE, values), 10.0)
    tried = []
    monkeypatch.setattr(Search, "fit_with", lambda self, model, effect, near: tried.append(effect))
    assert list(fits_of_simpler_kinds(search, search.stage.model, 0)) == []
    assert {e.values["width"] for e in tried if e.kind == "coulomb_friction"} == {0.03}


def test_where_more_than_noise_is_left_kinds_begin_with_the_force_that_was_found(monkeypatch):
    """Elastic friction was taken for Dahl's: the right one is found from there, and needs no else.

    The cubic spring had nothing to do but to mend what the wrong friction left.
    """
    data = of_rig(noise=0.02)
    x, v, time = (data[name].to_numpy() for name in ("x", "v", "time"))
    along = Motion(time, x[None], v[None])
    elastic = Effect("elastic_coulomb_friction", PLACE, {"force": 3.0, "stiffness": 8.0})
    push = force_along(elastic.definition, along, np.array([*elastic.values.values(), 0.0]))[0]
    data = data.assign(f=data["f"] - push)
    begun = search_of(rig(), data)
    dahl = begun.fit_with(
        begun.stage.model, Effect("dahl_friction", PLACE, {"force": 3.0, "stiffness": 8.0})
    )
    both = begun.fit_with(dahl.model, Effect("cubic_stiffness", PLACE, {"stiffness": 0.1}))
    found = replace(begun, stage=both, screening=object())
    monkeypatch.setattr(reconsider, "_refit_family_alternatives", lambda *given: [])
    assert kinds(replace_kinds(found)) == ["elastic_coulomb_friction"]


def test_steps_are_told_anew_where_effects_changed(monkeypatch):
    changed = two(COULOMB).copy()
    model = rig().with_effect(*CUBIC).with_effect(DAHL.kind, DAHL.at, DAHL.values)
    changed.stage = judged(model, 5.0)
    alone = {frozenset({"cubic_stiffness"}): 20.0, frozenset({"dahl_friction"}): 30.0}
    monkeypatch.setattr(Search, "fit_with", fitting(alone))
    found = rebuild_steps(changed)
    names = [name for name, _ in found.steps]
    assert names == ["base", "refit", "cubic_stiffness", "dahl_friction"]
    assert [len(item.effects) for _, item in found.steps] == [0, 0, 1, 2]
    assert found.steps[-1][1] is found.stage.model
    assert np.all(found.stage.error == 5.0)


@pytest.mark.parametrize(
    ("first", "cubic", "dahl"), [("cubic", 20.0, 30.0), ("dahl", 30.0, 20.0), ("dahl", None, 40.0)]
)
def test_what_explains_most_is_told_first(monkeypatch, first, cubic, dahl):
    changed = two(COULOMB).copy()
    model = rig().with_effect(*CUBIC).with_effect(DAHL.kind, DAHL.at, DAHL.values)
    changed.stage = judged(model, 5.0)

    def fit_with(self, model, effect):
        left = cubic if effect.kind == "cubic_stiffness" else dahl
        return left and judged(model.with_effect(effect.kind, effect.at, effect.values), left)

    monkeypatch.setattr(Search, "fitted_with", fit_with)
    found = rebuild_steps(changed)
    assert kinds(found)[0].startswith(first)
    assert found.stage.model.parameters["effect[0].stiffness"] == (3.0 if first == "cubic" else 50)
    assert [name for name, _ in found.steps[2:]] == kinds(found)


@pytest.mark.parametrize(("error", "stays"), [(10.1, True), (20.0, False)])
def test_what_looked_alike_early_is_asked_again_beside_the_others(monkeypatch, error, stays):
    search = two(COULOMB)
    first, last = (Effect(*each) for each in (COULOMB, CUBIC))
    backlash = Effect("backlash", PLACE, {"gap": 1e-3})
    search.indistinguishable_pairs += [
        indistinguishable_pair(first, DAHL),
        indistinguishable_pair(last, backlash),
        indistinguishable_pair(first, last),
        indistinguishable_pair(DAHL, first),
    ]
    errors = {frozenset({"cubic_stiffness", "dahl_friction"}): error}
    monkeypatch.setattr(Search, "fit_with", fitting(errors))
    found = [
        (p.first.kind, p.second.kind)
        for p in prune_indistinguishable(search).indistinguishable_pairs
    ]
    early = [("coulomb_friction", "dahl_friction")] if stays else []
    assert found == [*early, ("cubic_stiffness", "backlash")]
    assert len(search.indistinguishable_pairs) == 4


def test_kinds_that_came_closer_than_a_simpler_one_are_known():
    model = rig()
    search = search_of(model, of_rig(noise=1.0))
    search.stage = judged(model.with_effect(*COULOMB), 2.0)
    memory = {"force": 3.0, "stiffness": 50.0}
    others = [
        refitted(model, "dahl_friction", PLACE, memory, 1.9),
        refitted(model, "elastic_coulomb_friction", PLACE, memory, 2.1),
        refitted(model, *CUBIC, 1.0),
        refitted(model.with_effect(*CUBIC), "lugre_friction", PLACE, {"force": 3.0}, 1.0),
    ]
    search.selection_steps = [SelectionStep(search, (), tuple(others))]
    assert [effect.kind for effect in lower_error_kinds(search)] == ["dahl_friction"]


AXIS, SLIDING = ("x", "ground"), 3.0


def tried(width, *kinds):
    """A search on data with Coulomb friction, and refits of some kinds with what they leave."""
    effects = [("coulomb_friction", AXIS, [SLIDING, width])]
    case = Case("friction", one(), effects, drive=10.0, samples=2500, seed=7)
    search = search_of(model_of(case), records(case)[0][0])
    refits = []
    for kind in kinds:
        effect = Effect(kind, AXIS, {"force": 2.0})
        fitted = search.fit_with(search.stage.model, effect)
        assert fitted is not None
        refits.append(RefittedEffect(ScreenedEffect(effect, 10.0, 0.1), fitted))
    return search, refits


@pytest.mark.parametrize("width", [0.15, 0.015])
def test_the_speed_of_a_turn_is_found_gentle_or_not(width):
    """No slope leads from the one to the other."""
    search, refits = tried(width, "coulomb_friction")
    (found,) = fits_with_smoothing(refits, search.stage.model, search)
    values = found.fitted.model.effects[-1].values
    assert values["width"] == pytest.approx(width, rel=0.1)
    assert values["force"] == pytest.approx(SLIDING, rel=0.02)
    assert np.all(found.fitted.error < (0.8 if width > 0.1 else 1.0) * refits[0].fitted.error)
    assert found.size == refits[0].size + 1
    assert found.screened.place == refits[0].screened.place


def test_a_jump_that_leaves_noise_alone_stays_one():
    search, refits = tried(0.002, "coulomb_friction")
    assert search.at_noise_floor(refits[0].fitted)
    assert fits_with_smoothing(refits, search.stage.model, search) == []


def test_kinds_that_turn_over_by_themselves_are_left_alone():
    search, _ = tried(0.15)
    refit = RefittedEffect(ScreenedEffect(Effect("dahl_friction", AXIS), 1.0, 0.1), search.stage)
    assert fits_with_smoothing([refit], search.stage.model, search) == []


@pytest.mark.parametrize(("width", "fitted"), [(0.0, False), (0.1, True)])
def test_only_a_rounded_friction_that_was_found_has_its_width_fitted(width, fitted):
    model = model_of(Case("own", one(), []))
    with_friction = model.with_effect("coulomb_friction", AXIS, {"force": 1.0, "width": width})
    assert has_smoothing(with_friction.effects[0]) == fitted

    def keys(reference=None):
        return {f.key for f in free_parameters(with_friction, 100.0, POLICY, reference)}

    assert ("effect[0].width" in keys(model)) == fitted
    assert "effect[0].width" not in keys() | keys(with_friction)
