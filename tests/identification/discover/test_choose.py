from dataclasses import replace

import numpy as np
import pytest

from robustpolish.identification.structure.moves_add import select_effect, together
from robustpolish.identification.structure.score import rejection_reason
from robustpolish.identification.structure.screening import ScreenedEffect
from robustpolish.identification.structure.state import RefittedEffect, Search
from robustpolish.machines.effects.effect import Effect
from tests.identification.discover.searches import (
    MODEL,
    cubic,
    drag,
    judged,
    refitted,
    search_of,
)
from tests.identification.oscillators import PLACE, of_rig


def test_the_best_that_earns_its_place_is_chosen(search):
    best, second = cubic(2.0, share=0.9), drag(3.0)
    assert select_effect([best, second], search) == [second]
    assert search.reasons == [
        "cubic_stiffness at x, ground was not added: its stiffness is not determined."
    ]
    assert select_effect([], search) == []


def test_what_the_data_do_not_separate_is_noted_and_the_simpler_one_taken(search):
    """Of the 300 samples held out, a difference of 3 % says nothing."""
    friction = {"force": 3.0, "static_force": 4.0, "velocity": 0.5}
    stribeck = refitted(MODEL, "stribeck_friction", PLACE, friction, 2.0)
    near, far = cubic(2.05), drag(2.2)
    assert select_effect([stribeck, near, far], search) == [near]
    (pair,) = search.indistinguishable_pairs
    assert (pair.first, pair.second) == (near.effect, stribeck.effect)


def test_far_above_the_noise_a_simpler_kind_of_the_family_comes_first(search):
    friction = {"force": 3.0, "static_force": 4.0, "velocity": 0.5}
    for error, taken in ((5.0, 1), (2.0, 0)):
        pair = [
            refitted(MODEL, "stribeck_friction", PLACE, friction, error),
            refitted(MODEL, "coulomb_friction", PLACE, {"force": 3.0}, 1.15 * error),
        ]
        assert select_effect(pair, search) == [pair[taken]]


@pytest.mark.parametrize(
    ("decays", "held_out", "fitted", "taken"),
    [(True, 2.15, 0.5, 1), (True, 2.15, 0.9, 0), (True, 2.3, 0.5, 0), (False, 2.15, 0.5, 0)],
)
def test_where_the_quiet_part_of_a_decay_hardly_tells_the_loud_one_does(
    search, decays, held_out, fitted, taken
):
    if decays:
        search = replace(search, reference=replace(MODEL, inputs=(), dofs=(
            replace(MODEL.dofs[0], mass=1.0),)))  # fmt: skip
    pair = [cubic(2.0), drag(held_out)]
    louder = replace(pair[1].fitted, over_fitted=lambda: fitted * pair[0].fitted.fitted)
    pair[1] = replace(pair[1], fitted=louder)
    assert select_effect(pair, search) == [pair[taken]]


def test_two_that_hide_each_other_earn_their_places_together():
    """An offset and a cubic spring of 0.85 N in 1 N of noise: one alone is 16 % of the error."""
    data = of_rig(4000, noise=1.0)
    X = np.column_stack([data["x"], data["v"]])
    cube = data["x"].values ** 3
    size = 0.85 / np.std(cube - X @ np.linalg.lstsq(X, cube, rcond=None)[0])
    data = data.assign(f=("time", data["f"].values + 0.85 + size * cube))
    search = search_of(MODEL, data)
    ranked = []
    for effect in (Effect("sensor_offset", "f"), Effect("cubic_stiffness", PLACE)):
        fitted = search.fit_with(search.stage.model, effect)
        fall = float(1 - fitted.error[0] / search.stage.error[0])
        assert fall == pytest.approx(1 - np.sqrt(1.7225 / 2.445), abs=0.035)
        assert rejection_reason(search.stage, fitted, search.prepared)
        ranked.append(RefittedEffect(ScreenedEffect(effect, 100.0, fall), fitted))
    assert select_effect(ranked, search) == []
    for pairs in ([], [(ranked[1].screened, ranked[0].screened)]):  # as refits show, and free runs
        found = together(ranked, pairs, search)
        assert {item.effect.kind for item in found} == {"sensor_offset", "cubic_stiffness"}
        assert search.reasons[-1].count("earns its place only beside") == 1
        both = found[-1].fitted.model.effects
        assert [e.kind for e in both] == [item.effect.kind for item in found]
        values = {name: value for e in both for name, value in e.values.items()}
        assert values["offset"] == pytest.approx(0.85, abs=0.1)
        assert values["stiffness"] == pytest.approx(size, rel=0.15)
    alone = search_of(MODEL, data.assign(f=data["f"] - 0.85))
    assert together(ranked[1:], [], replace(alone, stage=ranked[1].fitted)) == []


def test_two_of_one_family_are_no_pair(search):
    names = ("coulomb_friction", "stribeck_friction")
    pair = tuple(ScreenedEffect(Effect(name, PLACE), 100.0, 0.5) for name in names)
    assert together([], [pair], search) == []


def test_a_constant_brings_along_what_earns_its_place_beside_it(search, monkeypatch):
    """An offset is no preload to a law that is not linear: both are tried."""
    load = refitted(MODEL, "constant_force", ("x",), {"force": 1.0}, 6.0)
    offset = refitted(MODEL, "sensor_offset", ("f",), {"offset": 1.0}, 6.0)
    law, left = drag(9.0), {"constant_force": 5.5, "sensor_offset": 1.0}

    def beside(_, model, effect):
        return judged(
            model.with_effect(effect.kind, effect.at, {**effect.values}), left[effect.kind]
        )

    monkeypatch.setattr(Search, "fit_with", beside)
    found = select_effect([load, offset, law], search)
    assert [item.effect.kind for item in found] == ["quadratic_damping", "sensor_offset"]
    assert found[0].fitted is law.fitted
    assert [e.kind for e in found[1].fitted.model.effects] == ["quadratic_damping", "sensor_offset"]
    left["sensor_offset"] = 5.8
    assert select_effect([load, offset, law], replace(search, beside={})) == [load]


def test_what_is_refused_sets_no_measure_for_the_simplest(search):
    """An absurd kind may come closest; of the others that are alike the simplest is taken."""
    absurd = refitted(
        MODEL, "stribeck_friction", PLACE,
        {"force": 2.0, "static_force": 1.0, "velocity": 0.1, "width": 0.0}, 4.0,
    )  # fmt: skip
    many = refitted(MODEL, "elastic_coulomb_friction", PLACE, {"force": 2.0, "stiffness": 9.0}, 5.0)
    found = select_effect([absurd, many, cubic(5.03)], search)
    assert [item.effect.kind for item in found] == ["cubic_stiffness"]


def test_what_is_absurd_by_itself_is_tried_beside_what_may_bend_it(search, monkeypatch):
    """A friction beside a drag falls with speed, to nothing, if the drag is missing."""
    values = {"force": 0.1, "static_force": 9.0, "velocity": 0.1, "width": 0.0}
    absurd = refitted(MODEL, "stribeck_friction", PLACE, values, 3.0)
    assert select_effect([absurd], search) == []
    sound = {**values, "force": 5.0}

    def fit_with(_, model, *effects, anew=False):
        kinds = [*(e.kind for e in model.effects), *(e.kind for e in effects)]
        whole = {"stribeck_friction", "quadratic_damping"} == set(kinds)
        for kind in kinds:
            own = {"stribeck_friction": sound if whole else values}
            numbers = own.get(kind, {"coefficient" if "damping" in kind else "stiffness": 3.0})
            model = replace(model, effects=tuple(e for e in model.effects if e.kind != kind))
            model = model.with_effect(kind, PLACE, numbers)
        return judged(model, 1.0 if whole else 2.9 if absurd.effect.kind in kinds else 10.0)

    monkeypatch.setattr(Search, "fitted_with", fit_with)
    found = together([absurd], [], replace(search, beside={}))
    assert [item.effect.kind for item in found] == ["stribeck_friction", "quadratic_damping"]
    assert found[1].fitted.model.effects[0].values["force"] == 5.0
    assert together([drag(9.5)], [], replace(search, beside={})) == []
