import json
from dataclasses import replace
from functools import partial

import pytest

from robustpolish.identification.compare import compare
from robustpolish.identification.diagnose import (
    _search_with_holds,
    _significantly_worse,
    _start_search,
    diagnose,
)
from robustpolish.identification.policy import POLICY
from tests.hidden_effects.cases import Case, model_of, one, records
from tests.identification.discover.searches import judged, prepared_of, search_of

PLACE = ("x", "ground")
CUBIC = Case("cubic", one(), [("cubic_stiffness", PLACE, [4e6])], drive=8.0, samples=4000, seed=1)


@pytest.fixture(scope="module")
def cubic():
    (data, _), (unseen, noise) = records(CUBIC)
    model = model_of(replace(CUBIC, wrong={"mass": 0.03, "stiffness": 0.1}))
    return diagnose(model, data), unseen, noise


def test_names_the_missing_spring(cubic):
    diagnosis = cubic[0]
    assert diagnosis.verdict == "missing_effect"
    assert [(e.kind, e.at) for e in diagnosis.effects] == [("cubic_stiffness", PLACE)]
    found = diagnosis.effects[0].parameters["stiffness"]
    mass = diagnosis.parameters["dof.x.mass"].value
    assert found.value / mass == pytest.approx(4e6, rel=0.02)
    assert 0 < found.stderr < 0.05 * found.value
    assert found.unit == "N/m^3"


def test_the_error_falls_to_the_noise(cubic):
    diagnosis = cubic[0]
    steps = [entry.step for entry in diagnosis.ledger.entries]
    assert steps == ["base", "refit", "cubic_stiffness"]
    errors = [entry.nrmse["x"] for entry in diagnosis.ledger.entries]
    assert errors[0] > errors[1] > 5 * errors[2]
    assert errors[2] == pytest.approx(10 ** (-30 / 20), rel=0.05)
    assert diagnosis.noise_floor["x"] == pytest.approx(errors[2], rel=0.1)


def test_the_effect_extrapolates(cubic):
    diagnosis, unseen, noise = cubic
    assert compare(diagnosis.model, unseen).outputs["x"].rmse < 1.1 * noise["x"]


def test_json_is_what_programs_rely_on(cubic):
    content = json.loads(json.dumps(cubic[0].to_dict(), allow_nan=False))
    assert content["effects"][0]["at"] == ["x", "ground"]
    assert set(content["effects"][0]["parameters"]["stiffness"]) == {"value", "stderr", "unit"}
    assert content["candidates"][0]["nrmse_held_out"] < 0.1
    assert content["ledger"][0]["step"] == "base"
    assert set(content["noise_floor"]) == {"x"}


def test_it_explains_itself(cubic):
    text = cubic[0].explain()
    for part in ("Cubic stiffness at x, ground", "Check:", "noise floor", "N/m^3"):
        assert part in text


@pytest.mark.parametrize("colour", [0.0, 0.9])
def test_nothing_is_named_where_nothing_is_missing(colour):
    case = Case("nothing", one(), drive=10.0, samples=4000, seed=2, colour=colour, noise_db=20)
    (data, _), _ = records(case)
    assert diagnose(model_of(case), data).verdict == "adequate"
    wrong = model_of(replace(case, wrong={"stiffness": 0.15, "damping": 0.5}))
    diagnosis = diagnose(wrong, data)
    assert diagnosis.verdict == "parameters"
    assert not diagnosis.effects
    assert diagnosis.model.parameters["spring[0].stiffness"] == pytest.approx(3000, rel=0.1)


@pytest.mark.long
def test_a_drift_is_learned_where_no_effect_explains_it():
    case = Case(
        "drift", one(), [("drifting_stiffness", PLACE, [800.0, 8.0])], drive=10.0, samples=4000,
        seed=3,
    )  # fmt: skip
    (data, _), _ = records(case)
    diagnosis = diagnose(model_of(case), data)
    assert diagnosis.verdict == "unknown_law"
    (law,) = diagnosis.laws
    assert law.quantity == "stiffness"
    assert law.formula().numbers["a1"] == pytest.approx(100.0, rel=0.02)
    assert diagnosis.missing_force.shape == (1, 4000)


@pytest.mark.parametrize("held", [True, False])
def test_a_hold_that_free_runs_speak_against_is_dropped(held):
    """A jump of a missing force may look like one to the innovations."""
    case = Case("held", one(), drive=10.0, samples=1500, held=held)
    model = model_of(case)
    prepared = prepared_of(model, records(case)[0][0])
    named = model.with_effect("input_hold", ("F_x",), {"order": 0.0})
    search = _search_with_holds(
        model, named, partial(_start_search, model, prepared=prepared, say=str)
    )
    assert search.reference is (named if held else model)
    assert search.at_noise_floor(search.stage)


def test_a_search_that_comes_to_its_limit_of_work_ends_with_what_it_has_and_says_so():
    """The second effect needs more work; with it nothing is said of a limit."""
    effects = [("quadratic_damping", PLACE, [30.0]), ("cubic_stiffness", PLACE, [4e6])]
    case = Case("two", one(), effects, drive=8.0, samples=1500, seed=1)
    model, data = model_of(case), records(case)[0][0]
    little = replace(POLICY, work=2e5)
    ended, again = (diagnose(model, data, _policy=little) for _ in range(2))
    whole = diagnose(model, data)
    assert len(ended.effects) == 1
    assert [reason for reason in ended.reasons if "limit of work" in reason]
    assert ended.to_dict() == again.to_dict()
    assert {e.kind for e in whole.effects} == {"quadratic_damping", "cubic_stiffness"}
    assert not [reason for reason in whole.reasons if "limit of work" in reason]


def test_a_search_with_other_holds_has_to_come_about_as_far():
    """From where it begins a friction may find no way to the noise that was reached without."""
    search = search_of(model_of(CUBIC), records(CUBIC)[0][0])
    model = search.stage.model
    here, near, far = (replace(search, stage=judged(model, left)) for left in (1.0, 1.2, 20.0))
    assert not _significantly_worse(near, here)
    assert _significantly_worse(far, here)
    assert not _significantly_worse(here, far)


def test_noise_alone_asks_for_no_other_hold(monkeypatch):
    asked = []
    monkeypatch.setattr(
        "robustpolish.identification.diagnose._holds_beside_effects", lambda s: asked.append(s)
    )
    case = replace(CUBIC, samples=1500)
    assert diagnose(model_of(case), records(case)[0][0]).verdict == "missing_effect"
    assert asked == []


@pytest.mark.parametrize(
    ("kind", "number", "name"),
    [("input_saturation", 12.0, "limit"), ("input_dead_zone", 1.5, "width")],
)
def test_names_what_an_actuator_makes_of_its_commands(kind, number, name):
    case = Case(kind, one(), [(kind, ("F_x",), [number])], drive=8.0, samples=4000, seed=1)
    (data, _), _ = records(case)
    model = model_of(replace(case, wrong={"mass": 0.03, "stiffness": 0.1}))
    diagnosis = diagnose(model, data)
    assert [(e.kind, e.at) for e in diagnosis.effects] == [(kind, ("F_x",))]
    found = diagnosis.effects[0].parameters[name]
    assert found.value == pytest.approx(number, rel=0.02)
    assert 0 < found.stderr < 0.05 * found.value
    assert found.unit == "N"
