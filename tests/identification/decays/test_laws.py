from dataclasses import replace

import pytest

from robustpolish.identification.structure.decays import damped_places, damping_laws
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import Damper, Dof, Output, Spring
from tests.identification.decays.pendulums import AT, COULOMB, DRAG, decay, pendulum
from tests.identification.discover.searches import prepared_of


@pytest.fixture(scope="module")
def prepared():
    return prepared_of(pendulum(), decay())


def laws_of(model, prepared, known=1, alike=()):
    motion = prepared.motion(model, prepared.record)
    return damping_laws(model, known, AT, motion, prepared.record, alike)


def damped(*laws, damping=0.02):
    model = pendulum(damping)
    for kind, name, value in laws:
        model = model.with_effect(kind, AT, {name: value})
    return model


def kinds_of(found, laws):
    return [effect.kind for effect in found.effects(laws)]


def test_places_are_those_of_effects_that_were_added():
    model = damped(COULOMB, DRAG)
    assert damped_places(model, 1) == [AT]
    assert damped_places(model.with_effect("coulomb_friction", ("arm", "ground")), 3) == [AT]


def test_where_none_was_added_it_is_the_place_of_the_only_damper():
    assert damped_places(pendulum(), 1) == [AT]
    model = MechanicalModel(
        [Dof("a", 1.0), Dof("b", 1.0)], [Spring(("a", "b"), 1.0)],
        [Damper(("a", "b"), 0.1), Damper(("a", "ground"), 0.1)],
        outputs=[Output("a", ("a", "ground"))],
    )  # fmt: skip
    assert damped_places(model, 0) == []
    assert damped_places(replace(model, dampers=()), 0) == []


def test_a_place_has_those_that_were_found_the_own_damper_and_the_others(prepared):
    found = laws_of(damped(DRAG), prepared)
    assert [law.effect.kind if law.effect else "own" for law in found.laws] == [
        "quadratic_damping", "coulomb_friction", "displacement_dependent_damping", "own",
    ]  # fmt: skip
    assert found.found == {0, 3}
    assert found.damper == "damper[0].damping"
    assert found.held(frozenset({0, 1})) == {"damper[0].damping"}
    assert found.held(frozenset({0, 3})) == frozenset()


def test_what_is_lost_is_the_power_of_all_that_damps(prepared):
    found = laws_of(damped(COULOMB, DRAG), prepared)
    of_each = {law.size + str(i): law.power for i, law in enumerate(found.laws)}
    v = prepared.motion(damped(COULOMB, DRAG), prepared.record).v[0]
    assert of_each["damper[0].damping3"] == pytest.approx((v**2).mean())
    assert of_each["coefficient1"] == pytest.approx((abs(v) ** 3).mean())
    sizes = [0.15, 0.01, 0.0, 0.02]
    dissipated_power = sum(size * law.power for size, law in zip(sizes, found.laws, strict=True))
    assert found.dissipated_power == pytest.approx(dissipated_power, rel=1e-6)


def test_sets_of_laws_share_what_is_lost(prepared):
    found = laws_of(damped(COULOMB, DRAG), prepared)
    both = frozenset({1, 2})
    model = found.model_with(both)
    assert [e.kind for e in model.effects] == [
        "pendulum_gravity", "quadratic_damping", "displacement_dependent_damping",
    ]  # fmt: skip
    assert model.parameters["damper[0].damping"] == 0.0
    for i, effect in zip((1, 2), found.effects(both), strict=True):
        assert effect.values["coefficient"] * found.laws[i].power == pytest.approx(
            found.dissipated_power / 2
        )
    assert kinds_of(found, frozenset({3})) == []


def test_effects_behind_them_stay_behind_and_own_ones_stay(prepared):
    model = damped(COULOMB).with_effect("constant_force", ("arm",), {"force": 0.1})
    found = laws_of(model, prepared)
    after = found.model_with(frozenset({0, 1}))
    assert [e.kind for e in after.effects] == [
        "pendulum_gravity", "coulomb_friction", "quadratic_damping", "constant_force",
    ]  # fmt: skip
    own = laws_of(damped(COULOMB, DRAG), prepared, known=2)
    assert [e.kind for e in own.here] == ["quadratic_damping"]
    assert "coulomb_friction" not in [law.effect.kind for law in own.laws if law.effect]


def test_friction_with_memory_stays_as_it_was_found_and_competes_with_coulomb_friction(prepared):
    values = {"force": 0.15, "stiffness": 50.0}
    found = laws_of(pendulum().with_effect("elastic_coulomb_friction", AT, values), prepared)
    kinds = [law.effect.kind for law in found.laws if law.effect]
    memory, dry = kinds.index("elastic_coulomb_friction"), kinds.index("coulomb_friction")
    assert found.has_two_dry_frictions(frozenset({memory, dry}))
    assert not found.has_two_dry_frictions(frozenset({memory, kinds.index("quadratic_damping")}))
    assert found.laws[0].effect == Effect("elastic_coulomb_friction", AT, values)
    assert found.laws[0].size == ""
    joined = found.effects(frozenset({0, kinds.index("quadratic_damping")}))
    assert joined[0].values == pytest.approx(values | {"behind_clearance": 1.0})
    assert joined[1].values["coefficient"] > 0


def test_what_is_told_alike_with_a_friction_there_is_another_law(prepared):
    """It begins as it was fitted, beside the others; of two dry frictions there is one at most."""
    memory = Effect("dahl_friction", AT, {"force": 0.15, "stiffness": 20.0})
    elsewhere = Effect("dahl_friction", ("arm", "other"), {"force": 0.15, "stiffness": 20.0})
    drag = Effect("quadratic_damping", AT)
    found = laws_of(damped(COULOMB), prepared, alike=[memory, elsewhere, drag])
    kinds = [law.effect.kind if law.effect else "own" for law in found.laws]
    assert kinds == [
        "coulomb_friction", "quadratic_damping", "displacement_dependent_damping",
        "dahl_friction", "own",
    ]  # fmt: skip
    assert found.effects(frozenset({3})) == [memory]
    assert found.laws[3].power > 0
    assert found.has_two_dry_frictions(frozenset({0, 3}))
    assert not found.has_two_dry_frictions(frozenset({1, 3}))
