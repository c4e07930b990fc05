"""A friction that turns over gently is fitted with its speed, a jump stays a jump."""

import numpy as np
import pytest

from robustpolish.effects import Effect
from robustpolish.identification.discover.search import RefittedEffect
from robustpolish.identification.discover.turnover import rounded_friction
from robustpolish.identification.fit.parameters import free_parameters, turns_over_gently
from robustpolish.identification.policy import POLICY
from robustpolish.identification.screening.screen import ScreenedEffect
from tests.hidden_effects.cases import Case, model_of, one, records
from tests.identification.discover.searches import search_of

PLACE = ("x", "ground")
FORCE = 3.0


def tried(width, *kinds):
    """A search on data with Coulomb friction, and refits of some kinds with what they leave."""
    effects = [("coulomb_friction", PLACE, [FORCE, width])]
    case = Case("friction", one(), effects, drive=10.0, samples=2500, seed=7)
    search = search_of(model_of(case), records(case)[0][0])
    refits = []
    for kind in kinds:
        effect = Effect(kind, PLACE, {"force": 2.0})
        fitted = search.fitted_with(search.stage.model, effect)
        assert fitted is not None
        refits.append(RefittedEffect(ScreenedEffect(effect, 10.0, 0.1), fitted))
    return search, refits


def test_the_speed_of_a_gentle_turn_is_found():
    search, refits = tried(0.15, "coulomb_friction")
    (found,) = rounded_friction(refits, search.stage.model, search)
    values = found.fitted.model.effects[-1].values
    assert values["width"] == pytest.approx(0.15, rel=0.1)
    assert values["force"] == pytest.approx(FORCE, rel=0.02)
    assert np.all(found.fitted.error < 0.8 * refits[0].fitted.error)
    assert found.size == refits[0].size + 1
    assert found.screened.place == refits[0].screened.place


def test_a_jump_that_leaves_noise_alone_stays_one():
    search, refits = tried(0.002, "coulomb_friction")
    assert search.at_floor(refits[0].fitted)
    assert rounded_friction(refits, search.stage.model, search) == []


def test_kinds_that_turn_over_by_themselves_are_left_alone():
    search, _ = tried(0.15)
    refit = RefittedEffect(ScreenedEffect(Effect("dahl_friction", PLACE), 1.0, 0.1), search.stage)
    assert rounded_friction([refit], search.stage.model, search) == []


@pytest.mark.parametrize(("width", "fitted"), [(0.0, False), (0.1, True)])
def test_only_a_rounded_friction_that_was_found_has_its_width_fitted(width, fitted):
    model = model_of(Case("own", one(), []))
    with_friction = model.with_effect("coulomb_friction", PLACE, {"force": 1.0, "width": width})
    assert turns_over_gently(with_friction.effects[0]) == fitted

    def keys(reference, *how):
        return {f.key for f in free_parameters(with_friction, 100.0, POLICY, reference, *how)}

    assert ("effect[0].width" in keys(model)) == fitted
    assert "effect[0].width" not in keys(model, False) | keys(with_friction)
