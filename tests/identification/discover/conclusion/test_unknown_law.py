"""A law takes the place of names where these leave visibly more."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from robustpolish.identification.structure import verdict as laws
from robustpolish.identification.structure.screening import ScreenedEffect
from robustpolish.identification.structure.state import RefittedEffect
from robustpolish.identification.structure.verdict import Verdict, final_fit
from robustpolish.machines.effects.effect import Effect
from tests.effects.learned_curves import learned_law_of, surface_of
from tests.hidden_effects.cases import Case, model_of, one, records
from tests.identification.discover.searches import search_of

PLACE = ("x", "ground")
CUBIC = Effect("cubic_stiffness", PLACE, {"stiffness": -1e6})
SATURATING = Case(
    "saturating", one(), [("saturating_spring", PLACE, [2000.0, 0.004])],
    "unknown_law", drive=10.0, samples=3000, seed=4,
)  # fmt: skip
TRUE_NAME = replace(SATURATING, effects=[("cubic_stiffness", PLACE, [4e6])])


def named(case, hold=None):
    """A search that has found a cubic spring; `hold` is the order of an input's hold."""
    model = model_of(case)
    if hold is not None:
        model = model.with_effect("input_hold", ("F_x",), {"order": hold})
    search = search_of(model, records(case)[0][0])
    fitted = search.fit_with(search.stage.model, CUBIC)
    search.accept([RefittedEffect(ScreenedEffect(CUBIC, 100.0, 0.5), fitted)])
    return search


def test_one_curve_explains_what_a_name_does_not():
    search = named(SATURATING)
    law = laws.one_curve(search)
    assert law.search is search
    (curve,) = law.learned.laws
    assert curve.effect.kind.startswith("learned_stiffness")
    assert law.search.at_noise_floor(law.learned.fitted)
    assert np.all(search.stage.error > 1.5 * search.prepared.scales.noise)


def test_no_curve_is_asked_for_beside_a_name_that_leaves_noise(monkeypatch):
    monkeypatch.setattr(laws, "learn", lambda *_: pytest.fail("nothing is left to be learned"))
    assert laws.one_curve(named(TRUE_NAME)) is None


def test_a_curve_that_leaves_as_much_as_a_name_takes_no_place():
    """With coloured noise the quietest band does not tell whether more than noise is left."""
    search = named(replace(TRUE_NAME, colour=0.9))
    assert np.all(search.stage.error > 2 * search.prepared.scales.noise)
    assert laws.one_curve(search) is None


def test_a_hold_that_was_believed_beside_a_name_is_asked_again_beside_a_law():
    search = named(SATURATING, hold=0.0)
    search.begin = lambda held: search_of(held, records(SATURATING)[0][0])
    law = laws.one_curve(search)
    assert law.search is not search
    assert not any(e.values["order"] == 0.0 for e in law.search.reference.effects)
    assert law.search.at_noise_floor(law.learned.fitted)


@pytest.mark.parametrize(("times", "looked"), [(1.05, []), (1.15, ["screened"])])
def test_more_is_looked_for_beside_a_name_that_leaves_more_than_white_noise(
    monkeypatch, times, looked
):
    search, screened = named(TRUE_NAME), []
    error = times * search.prepared.scales.noise
    names = final_fit(search)._replace(error=error)
    monkeypatch.setattr(laws, "_screening_finds_more", lambda *_: screened.append("screened"))
    assert laws.unknown_law(search, names, Verdict("missing_effect", [], error), None) is None
    assert screened == looked


@pytest.mark.parametrize(
    ("left", "over", "taken"),
    [
        (0.3, ["stiffness"], True),
        (0.5, ["stiffness"], False),
        (0.3, ["force"], False),
        (0.3, ["stiffness", "damping"], False),
    ],
)
def test_a_curve_that_does_not_explain_all_leaves_a_third_of_what_names_leave(
    monkeypatch, left, over, taken
):
    """Several curves, or a surface, are whatever several named forces are together."""
    search = named(SATURATING)
    names = final_fit(search)
    made = {"force": lambda: surface_of(lambda q, v: q * v)}
    found = [made[o]() if o in made else learned_law_of(lambda x: x, over=o) for o in over]
    effects = (*search.reference.effects, *(law.effect for law in found))
    learned = SimpleNamespace(explains=False, model=SimpleNamespace(effects=effects))
    law = laws.NonparametricLaw(search, learned)
    monkeypatch.setattr(laws, "_best_law", lambda *_: law)
    monkeypatch.setattr(laws, "whole_record_error", lambda *_: left * names.error)
    verdict = Verdict("missing_effect", [], 0.1 * names.error)
    assert laws.unknown_law(search, names, verdict, None) is (law if taken else None)
