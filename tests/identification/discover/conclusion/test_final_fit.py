"""The final fit lets go what the whole record leaves open, if nothing else bends for it."""

import numpy as np
import pytest

from robustpolish.identification.structure import verdict as module
from robustpolish.identification.structure.state import Search
from robustpolish.identification.structure.verdict import FinalFit, final_fit
from robustpolish.machines.effects.effect import Effect
from tests.identification.discover.searches import STRIBECK, judged, refitted, search_of
from tests.identification.oscillators import PLACE, of_rig, rig


def with_friction(model, **numbers):
    return model.with_effect("stribeck_friction", PLACE, STRIBECK | numbers)


@pytest.mark.parametrize(("sliding", "kept"), [(3.0, False), (0.1, True)])
def test_what_is_left_open_stays_if_another_is_absurd_without_it(monkeypatch, sliding, kept):
    search = search_of(rig(), of_rig(noise=1.0))
    friction = refitted(rig(), "stribeck_friction", PLACE, STRIBECK, 20.0)
    search.accept([friction])
    drag = Effect("quadratic_damping", PLACE, {"coefficient": 3.0})
    both = with_friction(rig()).with_effect(drag.kind, PLACE, drag.values)
    stage = judged(both, 10.0, share=0.9)
    search.accept([refitted(friction.fitted.model, drag.kind, PLACE, drag.values, 10.0)])
    search.stage = stage

    def fit_without(self, model, at):
        return judged(with_friction(rig(), force=sliding), 10.1) if at else None

    def as_it_is(search, stage, predictable):
        return FinalFit(stage.fit, np.atleast_1d(stage.free), predictable)

    monkeypatch.setattr(Search, "fitted_without", fit_without)
    monkeypatch.setattr(module, "fit_whole_record", as_it_is)
    monkeypatch.setattr(module, "free_runs_predictable", lambda search: False)
    monkeypatch.setattr(module, "fits_of_simpler_kinds", lambda *_: ())
    monkeypatch.setattr(module, "_smooth_frictions", lambda search, final: final)
    found = [effect.kind for effect in final_fit(search).fit.model.effects]
    assert found == ["stribeck_friction", *["quadratic_damping"] * kept]
