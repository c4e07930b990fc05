"""One turn of a search, on data with a cubic spring."""

import pytest

from robustpolish.effects import Effect
from robustpolish.identification.discover.add_one import _moved, add_one
from robustpolish.identification.discover.search import RefittedEffect
from robustpolish.identification.screening.screen import ScreenedEffect
from tests.hidden_effects.cases import Case, model_of, one, records, two
from tests.identification.discover.searches import judged, search_of

PLACE = ("x", "ground")


@pytest.fixture
def search():
    case = Case("cubic", one(), [("cubic_stiffness", PLACE, [4e6])], drive=8.0, samples=1500)
    return search_of(model_of(case), records(case)[0][0])


def test_what_earns_its_place_is_added_and_what_came_close_is_kept(search):
    before = search.stage
    assert add_one(search)
    assert [e.kind for e in search.stage.model.effects] == ["cubic_stiffness"]
    (turn,) = search.turns
    assert turn.before.stage is before
    assert turn.before.added == 0
    assert [item.fitted for item in turn.added] == [search.stage]
    assert turn.added[0] not in turn.others
    assert all(item.fitted.error < before.error for item in turn.others)
    assert {c.step for c in search.candidates} == {1}


def test_at_the_floor_nothing_is_looked_for(search):
    search.stage = judged(search.stage.model, search.prepared.scales.noise)
    assert not add_one(search)
    assert not search.turns
    assert not search.candidates


def test_where_nothing_earns_its_place_what_helped_is_kept(search, monkeypatch):
    monkeypatch.setattr(
        "robustpolish.identification.discover.add_one.chosen", lambda ranked, search: []
    )
    monkeypatch.setattr("robustpolish.identification.discover.add_one.together", lambda *given: [])
    assert not add_one(search)
    (turn,) = search.turns
    assert not turn.added
    assert turn.others[0].effect.kind == "cubic_stiffness"
    assert all(item.fitted.error < search.stage.error for item in turn.others)
    assert not any(item.constant for item in turn.others)


def test_what_swings_by_itself_is_tried_at_all_places():
    """Found at one place, it may as well hang at another."""
    at, values = ("x",), [0.1, 0.1 * 60.0**2, 0.3]
    case = Case("hanging", two(), [("attached_resonator", at, values)], drive=8.0, samples=1500)
    search = search_of(model_of(case), records(case)[0][0])
    elsewhere = Effect("attached_resonator", ("x_m",), {"mass": 0.1, "stiffness": 360.0})
    fitted = search.fitted_with(search.stage.model, elsewhere)
    refit = RefittedEffect(ScreenedEffect(elsewhere, 10.0, 0.1), fitted)
    (found,) = _moved([refit], search.stage.model, search)
    assert found.effect.at == at
    mass = found.fitted.model.effects[-1].values["mass"]
    assert mass == pytest.approx(0.1, rel=0.1)
    assert all(found.fitted.error < fitted.error)
