"""A kind at a place with numbers."""

import copy
import pickle

import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.machines.effects import effect as catalogue
from robustpolish.machines.effects.effect import Effect, lookup, register, unregister
from robustpolish.machines.effects.evaluate import force_along
from robustpolish.machines.effects.kind import EffectKind, Motion, Parameter
from robustpolish.machines.effects.user_defined import own_kind


def test_bad_effects_say_what_is_wrong():
    with pytest.raises(InvalidInputError, match="coulomb_friktion"):
        Effect("coulomb_friktion", ("x", "ground"))
    with pytest.raises(InvalidInputError, match="weight"):
        Effect("coulomb_friction", ("x", "ground"), {"weight": 1.0})
    with pytest.raises(InvalidInputError, match="two degrees"):
        Effect("gyroscopic_coupling", ("x",), {})
    with pytest.raises(InvalidInputError, match="finite"):
        Effect("coulomb_friction", ("x", "ground"), {"force": float("nan")})


@pytest.mark.parametrize(
    ("make", "key"),
    [
        (lambda: Effect("coulomb_friktion", ("x",)), ("effect", "kind")),
        (lambda: Effect("gyroscopic_coupling", ("x",)), ("gyroscopic_coupling", "at")),
        (
            lambda: Effect("coulomb_friction", ("x",), {"force": "much"}),
            ("coulomb_friction", "parameters", "force"),
        ),
    ],
)
def test_errors_carry_keys(make, key):
    with pytest.raises(InvalidInputError) as caught:
        make()
    assert caught.value.key == key


def test_values_are_changed_or_replaced():
    friction = Effect("coulomb_friction", "x", {"force": 3.0, "width": 1e-3})
    assert friction.with_parameters(force=4.0).parameters == {"force": 4.0, "width": 1e-3}
    assert friction.with_values({"force": 4.0}).parameters == {"force": 4.0}
    assert friction.with_values({}).at == ("x", "ground")


def test_effects_travel_and_are_copied():
    friction = Effect("coulomb_friction", "x", {"force": 3.0})
    assert pickle.loads(pickle.dumps(friction)) == friction
    assert copy.deepcopy(friction) == friction


def test_a_force_is_no_effect_on_a_signal():
    with pytest.raises(InvalidInputError, match="input or output"):
        Effect("coulomb_friction", "x").on_signal(np.ones(3), np.arange(3.0))


def test_users_add_a_kind(monkeypatch):
    monkeypatch.setattr(catalogue, "_registered", {})

    def law(t, q, v, z, p, f, dz):
        f[0] = -p[0] * q[0] ** 5

    kind = EffectKind(
        "fifth_power", "Fifth power", "pair", (Parameter("stiffness", "F/L^5", "coefficient"),), law
    )
    assert register(kind) is lookup("fifth_power")
    time = np.arange(1500) * 1e-3
    along = Motion(time, np.sin(40 * time)[None] * 1e-3, np.cos(40 * time)[None] * 0.04)
    force = force_along(kind, along, np.array([2.0]))
    np.testing.assert_allclose(force, -2 * along.q**5)
    with pytest.raises(InvalidInputError, match="taken"):
        register(EffectKind("cubic_stiffness", "Another", "pair", (Parameter("a", "F", "b"),), law))


def test_an_effect_keeps_the_kind_it_was_made_of(monkeypatch):
    monkeypatch.setattr(catalogue, "_registered", {})
    former, later = (
        own_kind({"formula": f"f = -k*q**{power}", "units": {"k": f"N/m^{power}"}, "name": "law"})
        for power in (5, 7)
    )
    register(former)
    effect = Effect("law", "x", {"k": 2.0})
    register(later)
    assert effect.definition == effect.with_values({"k": 3.0}).definition == former
    assert Effect("law", "x", {"k": 2.0}).definition == later
    assert pickle.loads(pickle.dumps(effect)) == effect
    unregister("law")
    assert effect.definition == former
    with pytest.raises(InvalidInputError, match="spelling"):
        Effect("law", "x")
    assert Effect.of(later, "x").values == {"k": 0.0}
    assert Effect.of(lookup("cubic_stiffness"), "x") == Effect("cubic_stiffness", "x")
