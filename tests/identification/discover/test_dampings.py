from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from robustpolish.identification.compare import compare
from robustpolish.identification.diagnosis.findings import indistinguishable_pair
from robustpolish.identification.policy import POLICY
from robustpolish.identification.structure import moves_special as dampings
from robustpolish.identification.structure.decays import DampingLaw
from robustpolish.identification.structure.moves_special import (
    _differs_in_friction_only,
    select_damping_laws,
)
from robustpolish.machines.effects.effect import Effect
from tests.identification.decays.pendulums import AT, decay, pendulum
from tests.identification.discover.searches import search_of

WRONG = (
    Effect("coulomb_friction", AT, {"force": 0.1}),
    Effect("displacement_dependent_damping", AT, {"coefficient": 0.05}),
)


def search_with(data, *effects, model=None):
    """A search that found these effects, one after the other."""
    search = search_of(model or pendulum(), data)
    for effect in effects:
        fitted = search.fit_with(search.stage.model, effect)
        assert fitted is not None
        search.stage = fitted
        search.steps.append((effect.kind, fitted.model))
    return search


def kinds_of(search):
    return [e.kind for e in search.stage.model.effects]


@pytest.fixture(scope="module")
def settled():
    """Coulomb friction and drag, of which the upper part of the decay is known."""
    data = decay().isel(time=slice(0, 900))
    search = search_with(data, *WRONG)
    search.indistinguishable_pairs = [
        indistinguishable_pair(WRONG[1], WRONG[0]),
        indistinguishable_pair(WRONG[0], Effect("dahl_friction", AT)),
    ]  # fmt: skip
    before = search.stage.model
    search = select_damping_laws(search)
    return before, search


def test_what_predicts_the_end_takes_the_place_of_what_came_first(settled):
    _, search = settled
    assert kinds_of(search) == ["pendulum_gravity", "coulomb_friction", "quadratic_damping"]
    numbers = search.stage.model.parameters
    assert numbers["effect[1].force"] == pytest.approx(0.15, rel=0.1)
    assert numbers["effect[2].coefficient"] == pytest.approx(0.01, rel=0.15)
    assert numbers["effect[1].width"] == 0.0
    assert "found one by one" in search.reasons[-1]


def test_the_rest_of_the_decay_is_predicted(settled):
    before, search = settled
    ends = decay().isel(time=slice(900, None))
    error, old = (compare(m, ends).outputs["angle"].rmse for m in (search.stage.model, before))
    assert error < 1.5e-3
    assert error < 0.7 * old


def test_the_steps_go_on_with_what_was_chosen(settled):
    _, search = settled
    assert [kind for kind, _ in search.steps] == [
        "base", "refit", "coulomb_friction", "quadratic_damping",
    ]  # fmt: skip
    assert [len(model.effects) for _, model in search.steps] == [1, 1, 2, 3]
    assert search.steps[-1][1] is search.stage.model


def test_pairs_with_what_is_no_longer_there_go(settled):
    _, search = settled
    pairs = [(p.first.kind, p.second.kind) for p in search.indistinguishable_pairs]
    assert ("coulomb_friction", "dahl_friction") in pairs
    assert all(first != "displacement_dependent_damping" for first, _ in pairs)


def test_what_is_right_already_stays_and_a_constant_that_does_nothing_goes():
    right = Effect("coulomb_friction", AT, {"force": 0.1})
    idle = Effect("constant_force", ("arm",), {"force": 0.01})
    search = search_with(decay(drag=0.0, viscous=0.04), right, idle)
    search = select_damping_laws(search)
    assert kinds_of(search) == ["pendulum_gravity", "coulomb_friction"]
    assert search.reasons == [
        f"{search_effect(search, idle)} was not kept: the damping explains as much."
    ]
    assert search.stage.model.parameters["damper[0].damping"] == pytest.approx(0.04, rel=0.3)
    assert search.prepared.held == frozenset()


@pytest.mark.long
@pytest.mark.xfail(reason="An elastic friction is chosen, told alike with Coulomb's.", strict=True)
def test_what_was_told_alike_with_a_law_that_goes_may_go_with_it():
    """The pairs of the search change while its damping is settled; the laws on trial do not."""
    wrong = Effect("dahl_friction", AT, {"force": 0.15, "stiffness": 3.0})
    elastic = Effect("elastic_coulomb_friction", AT, {"force": 0.15, "stiffness": 3.0})
    idle = Effect("constant_force", ("arm",), {"force": 0.01})
    search = search_with(decay(drag=0.0, viscous=0.04), wrong, idle)
    search.indistinguishable_pairs = [indistinguishable_pair(wrong, elastic)]
    search = select_damping_laws(search)
    assert kinds_of(search) == ["pendulum_gravity", "coulomb_friction"]
    assert not search.indistinguishable_pairs


def search_effect(search, effect):
    return str(Effect(effect.kind, effect.at))


def test_what_hides_behind_the_damper_is_found_where_no_effect_was():
    search = search_with(decay(drag=0.0, viscous=0.04, noise=5e-3))
    search = select_damping_laws(search)
    assert kinds_of(search) == ["pendulum_gravity", "coulomb_friction"]
    assert search.stage.model.parameters["effect[1].force"] == pytest.approx(0.15, rel=0.1)
    assert "better than a viscous damper" in search.reasons[-1]


def test_nothing_is_named_where_the_damper_does_it_all():
    search = search_with(decay(coulomb=0.0, drag=0.0, viscous=0.15))
    stage, steps = search.stage, list(search.steps)
    search = select_damping_laws(search)
    assert search.stage is stage
    assert search.steps == steps
    assert search.reasons == []


def test_a_damper_that_is_not_there_ends_near_nothing():
    # what the linear model took for viscous is Coulomb friction and drag
    search = search_with(decay(viscous=0.0), *WRONG)
    search = select_damping_laws(search)
    assert search.stage.model.parameters["damper[0].damping"] < 2e-3


def test_a_record_that_is_no_decay_is_left_alone():
    steady = decay(coulomb=0.0, drag=0.0, viscous=0.02, samples=600)
    search = search_with(steady, WRONG[0])
    stage, steps = search.stage, list(search.steps)
    search = select_damping_laws(search)
    assert search.stage is stage
    assert search.steps == steps


def test_where_runs_do_not_repeat_nothing_is_settled(settled):
    _, search = settled
    stage = replace(search.stage, reproducible=False)
    other = replace(search, stage=stage)
    other = select_damping_laws(other)
    assert other.stage is stage


def test_kinds_of_friction_that_fit_all_as_well_are_told_alike():
    """How well is a matter of likelihood: coloured errors tell less than white ones."""
    kinds = ("coulomb_friction", "dahl_friction", "quadratic_damping")
    laws = [DampingLaw(Effect(kind, AT), "", 1.0) for kind in kinds]
    white = np.random.default_rng(0).standard_normal((4000, 1))
    slow = np.cumsum(white, axis=0) - np.linspace(0, 1, 4000)[:, None] * np.sum(white)

    def trials(errors, more):
        one = SimpleNamespace(errors=errors, rmse=np.array([1.0]))
        two = SimpleNamespace(errors=errors, rmse=np.array([1.0 + more]))
        fits = {frozenset({i}): two if i else one for i in range(3)}
        found = SimpleNamespace(laws=laws)
        return SimpleNamespace(fits=fits, found=found, prepared=SimpleNamespace(policy=POLICY))

    coulomb, dahl, drag = (frozenset({i}) for i in range(3))
    assert _differs_in_friction_only(trials(white, 1e-3), coulomb, dahl)
    assert not _differs_in_friction_only(trials(white, 3e-3), coulomb, dahl)
    assert _differs_in_friction_only(trials(slow, 3e-3), coulomb, dahl)
    assert not _differs_in_friction_only(trials(white, 1e-3), coulomb, drag)
    assert not _differs_in_friction_only(trials(white, 1e-3), coulomb, coulomb)


def test_where_no_observer_follows_the_law_nothing_is_settled(settled, monkeypatch):
    """What such a motion loses is no number."""
    dissipated_power = SimpleNamespace(found=SimpleNamespace(dissipated_power=np.nan))
    monkeypatch.setattr(dampings, "_damping_fits", lambda *_: dissipated_power)
    assert select_damping_laws(settled[1]) is settled[1]
