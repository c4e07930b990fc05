from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from robustpolish.identification.fit.least_squares import standard_errors
from robustpolish.identification.policy import Policy
from robustpolish.identification.structure.screening import ScreenedEffect
from robustpolish.identification.structure.state import Search
from robustpolish.machines.effects.effect import Effect
from tests.hidden_effects.cases import Case, model_of, one, records
from tests.identification.discover.searches import judged, refitted, search_of
from tests.identification.oscillators import PLACE, of_rig, oscillator, record, rig


@pytest.fixture
def search():
    return search_of(rig(), of_rig(noise=1.0))


def test_the_floor_is_where_the_noise_alone_is_no_visible_fall(search):
    (noise,) = search.prepared.scales.noise
    assert search.at_noise_floor(judged(rig(), 1.24 * noise))
    assert not search.at_noise_floor(judged(rig(), 1.26 * noise))
    bold = replace(search, prepared=replace(search.prepared, policy=Policy(visible_fall=0.5)))
    assert bold.at_noise_floor(judged(rig(), 1.9 * noise))


@pytest.fixture(scope="module")
def coloured():
    """A right model's search with coloured noise, and the size of that."""
    data, shaped = record(), lfilter([1.0], [1.0, -0.9], np.random.default_rng(1).normal(size=4000))
    size = 0.03 * float(np.std(data["x"]))
    noisy = data["x"] + size * shaped / np.std(shaped)
    found = data.assign(x=noisy.assign_attrs(data["x"].attrs))
    return search_of(oscillator(), found), size


@pytest.mark.parametrize("predictable", [True, False])
def test_a_right_model_shows_the_whole_of_coloured_noise(coloured, predictable):
    search, size = coloured
    assert search.prepared.scales.noise[0] < 0.7 * size  # what the quietest band shows
    assert search.residual_noise_floor(oscillator(), predictable)[0] == pytest.approx(size, rel=0.3)


def test_a_wrong_model_does_not_make_its_error_a_noise(coloured):
    search, size = coloured
    assert search.residual_noise_floor(oscillator(stiffness=300.0), True)[0] < 1.5 * size


@pytest.mark.parametrize("missing", [True, False])
def test_an_effect_is_fitted_from_far_away_and_one_that_is_not_there_to_nothing(missing):
    hidden = [("cubic_stiffness", PLACE, [4e6])] if missing else []
    case = Case("cubic", one(), hidden, drive=8.0, samples=1500)
    search = search_of(model_of(case), records(case)[0][0])
    cubic = Effect("cubic_stiffness", PLACE, {"stiffness": 1e6})
    found = search.fit_with(search.stage.model, cubic)
    assert found is not None
    if not missing:
        error = found.model.parameters["effect[0].stiffness"]
        assert abs(error) < 4 * standard_errors(found.fit)["effect[0].stiffness"]
        assert found.error == pytest.approx(search.stage.error, rel=0.02)
    else:
        mass = found.model.parameters["dof.x.mass"]
        assert found.model.parameters["effect[0].stiffness"] / mass == pytest.approx(4e6, rel=0.05)
        assert found.error < 0.5 * search.stage.error


@pytest.mark.parametrize(("moved", "known_too"), [(1.5, False), (3.0, True)])
def test_beside_an_effect_numbers_that_were_bent_far_begin_as_they_were_known_too(
    search, monkeypatch, moved, known_too
):
    stiffness = search.reference.springs[0].stiffness
    bent = search.stage.model.with_parameters({"spring[0].stiffness": moved * stiffness})
    begun = []

    def fitted(self, model, *effects, anew, near):
        begun.append(model.springs[0].stiffness / stiffness)
        return judged(model, 2.0 if begun[1:] else 3.0)

    monkeypatch.setattr(Search, "_fit_from_smaller_sizes", fitted)
    cubic = Effect("cubic_stiffness", PLACE, {"stiffness": 1e6})
    found = search.fit_with(bent, cubic)
    assert begun == pytest.approx([moved, 1.0] if known_too else [moved])
    assert found.error == (2.0 if known_too else 3.0)  # the better of the two


def test_a_fit_begins_smaller_where_runs_diverge():
    """Beyond its peak a softening spring pushes away; half of that does not."""
    hidden = [("quadratic_stiffness", PLACE, [6e4])]
    case = Case("soft", one(), hidden, drive=5.0, samples=1500)
    search = search_of(model_of(case), records(case)[0][0])
    large = Effect("quadratic_stiffness", PLACE, {"stiffness": 5e5})
    assert replaced_shares(search, (1.0,)).fit_with(search.stage.model, large) is None
    found = search.fit_with(search.stage.model, large)
    assert found is not None
    mass = found.model.parameters["dof.x.mass"]
    assert found.model.parameters["effect[0].stiffness"] / mass == pytest.approx(6e4, rel=0.1)


def replaced_shares(search, shares):
    policy = replace(search.policy, shares=shares)
    return replace(search, prepared=replace(search.prepared, policy=policy))


def test_what_earned_its_place_is_the_next_stage(search):
    cubic = refitted(rig(), "cubic_stiffness", PLACE, {"stiffness": 3.0}, 2.0)
    drag = refitted(rig(), "quadratic_damping", PLACE, {"coefficient": 3.0}, 2.0)
    search.reasons += [f"{item.effect} was not added: why." for item in (cubic, drag)]
    search.accept([cubic])
    assert search.added == 1
    assert search.stage is cubic.fitted
    assert search.steps[-1] == ("cubic_stiffness", cubic.fitted.model)
    assert search.reasons == ["quadratic_damping at x, ground was not added: why."]


def test_two_that_earned_their_places_together_are_two_steps(search):
    cubic = refitted(rig(), "cubic_stiffness", PLACE, {"stiffness": 3.0}, 9.0)
    drag = refitted(cubic.fitted.model, "quadratic_damping", PLACE, {"coefficient": 3.0}, 2.0)
    search.reasons += [f"{item.effect} was not added: why." for item in (cubic, drag)]
    search.accept([cubic, drag])
    assert search.added == 2
    assert search.stage is drag.fitted
    assert search.steps[-2:] == [
        ("cubic_stiffness", cubic.fitted.model), ("quadratic_damping", drag.fitted.model),
    ]  # fmt: skip
    assert search.reasons == []


def test_a_model_is_fitted_without_one_of_its_effects(search, monkeypatch):
    monkeypatch.setattr(Search, "fit_with", lambda self, model: judged(model, 1.0))
    model = rig().with_effect("cubic_stiffness", PLACE).with_effect("quadratic_damping", PLACE)
    left = [search.fit_without(model, at).model.effects for at in (0, 1)]
    assert [[e.kind for e in effects] for effects in left] == [
        ["quadratic_damping"], ["cubic_stiffness"],
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("anew", "on", "left"), [(1.0, 0.5, 0.5), (0.5, 1.0, 0.5), (1.0, None, 1.0)]
)
def test_the_others_begin_anew_or_go_on_whichever_is_better(search, monkeypatch, anew, on, left):
    model = rig().with_effect("cubic_stiffness", PLACE, {"stiffness": 3.0})
    there = None if on is None else judged(rig(), on)
    monkeypatch.setattr(Search, "fit_with", lambda self, model: judged(model, anew))
    monkeypatch.setattr(Search, "fit_over_windows", lambda self, model, spans: there)
    assert search.fit_without(model, 0).error == left


def test_a_copy_goes_its_own_way(search):
    cubic = refitted(rig(), "cubic_stiffness", PLACE, {"stiffness": 3.0}, 2.0)
    other = search.copy()
    other.accept([cubic])
    other.reasons.append("why")
    assert (search.added, other.added) == (0, 1)
    assert len(other.steps) == len(search.steps) + 1
    assert search.reasons == []


def test_what_was_tried_is_remembered_the_best_first(search):
    cubic = refitted(rig(), "cubic_stiffness", PLACE, {"stiffness": 3.0}, 2.0, score=80.0)
    screened = [
        cubic.screened,
        ScreenedEffect(Effect("coulomb_friction", PLACE), 30.0, 0.2),
        ScreenedEffect(Effect("lugre_friction", PLACE), 20.0, 0.2, "its force has the wrong sign"),
        ScreenedEffect(Effect("sensor_offset", "f"), -1.0, 0.0),
    ]
    search.record_candidates([cubic], screened, 2)
    assert [(c.kind, c.score, c.step, c.remark) for c in search.candidates] == [
        ("cubic_stiffness", 80.0, 2, ""),
        ("coulomb_friction", 30.0, 2, "screened only"),
        ("lugre_friction", 20.0, 2, "its force has the wrong sign"),
    ]
    spread = np.std(search.prepared.record.Y)
    assert search.candidates[0].nrmse_held_out == pytest.approx(2.0 / spread)
    assert search.candidates[1].nrmse_held_out == np.inf


def test_a_refitted_effect_counts_what_is_fitted():
    friction = {"force": 3.0, "static_force": 4.0, "velocity": 0.5}
    stribeck = refitted(rig(), "stribeck_friction", PLACE, friction, 2.0)
    offset = refitted(rig(), "sensor_offset", "f", {"offset": 3.0}, 2.0)
    assert (stribeck.size, offset.size) == (3, 1)
    assert (stribeck.constant, offset.constant) == (False, True)
    assert stribeck.screened.sensible
