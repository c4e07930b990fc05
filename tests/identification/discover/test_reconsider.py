"""The needless goes, a kind gives way to a better one of its family, and steps are told anew."""

from dataclasses import replace

import numpy as np
import pytest

from robustpolish.effects import Effect
from robustpolish.identification.discover import reconsider
from robustpolish.identification.discover.reconsider import (
    renamed,
    retold,
    without_the_needless,
)
from robustpolish.identification.discover.search import Search
from robustpolish.identification.findings.confused import confused
from robustpolish.identification.screening.screen import ScreenedEffect
from tests.identification.discover.searches import judged, refitted, search_of
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
    monkeypatch.setattr(Search, "fitted_with", lambda self, model: judged(model, left))
    found = without_the_needless(search)
    assert kinds(found) == ["coulomb_friction", "cubic_stiffness"][2 - kept :]
    assert bool(found.reasons) == (kept == 1)
    assert kinds(search) == ["coulomb_friction", "cubic_stiffness"]
    # the last one is asked on request only
    assert kinds(without_the_needless(found, last=True)) == ([] if kept == 1 else kinds(search))


def fitting(errors):
    """Fits whose error follows from the kinds of the effects."""

    def fitted_with(self, model, *effects):
        for effect in effects:
            model = model.with_effect(effect.kind, effect.at, effect.values)
        return judged(model, errors[frozenset(e.kind for e in model.effects)])

    return fitted_with


@pytest.mark.parametrize(
    ("error", "taken", "alike"), [(5.0, True, False), (10.1, False, True), (20.0, False, False)]
)
def test_a_kind_gives_way_to_a_better_one_of_its_family(monkeypatch, error, taken, alike):
    search = two(COULOMB)
    errors = {
        frozenset({"cubic_stiffness"}): 20.0,
        frozenset({"cubic_stiffness", "dahl_friction"}): error,
    }
    monkeypatch.setattr(Search, "fitted_with", fitting(errors))
    candidate = ScreenedEffect(DAHL, 0.0, 0.5)
    monkeypatch.setattr(reconsider, "rivals_of", lambda *given: [candidate])
    found = renamed(search)
    assert (kinds(found)[-1] == "dahl_friction") == taken
    assert bool(found.confusions) == alike
    if alike:
        assert {found.confusions[0].first.kind, found.confusions[0].second.kind} == {
            "coulomb_friction", "dahl_friction",
        }  # fmt: skip


def test_steps_are_told_anew_where_effects_changed(monkeypatch):
    search = two(COULOMB)
    assert retold(search) is search
    changed = search.copy()
    model = rig().with_effect(*CUBIC).with_effect(DAHL.kind, DAHL.at, DAHL.values)
    changed.stage = judged(model, 5.0)
    changed.confusions.append(confused(Effect(*COULOMB), DAHL))
    changed.confusions.append(confused(DAHL, Effect(*COULOMB)))
    monkeypatch.setattr(Search, "fitted_with", fitting({frozenset({"cubic_stiffness"}): 20.0}))
    found = retold(changed)
    names = [name for name, _ in found.steps]
    assert names == ["base", "refit", "cubic_stiffness", "dahl_friction"]
    assert [len(item.effects) for _, item in found.steps] == [0, 0, 1, 2]
    assert found.steps[-1][1] is model
    assert [c.first.kind for c in found.confusions] == ["dahl_friction"]
    assert np.all(found.stage.error == 5.0)
