"""Where effects pull on a model, and what they are told of it."""

import numpy as np
import pytest

from robustpolish.machines.effects.user_defined import own_kind
from robustpolish.machines.mechanical.data import (
    context_of,
    dynamic_effects,
    effect_ports,
    port_pairs,
    port_rows,
)
from robustpolish.machines.mechanical.parts import Output
from tests.models.mechanical.two_masses import GROUND, two_masses

BETWEEN = ("x", "x_m")
MODEL = two_masses(
    outputs=[Output("x", GROUND), Output("f", BETWEEN, "force")], spin_frequency=20.0
)


def test_ports_are_relative_motions():
    cubic = MODEL.with_effect("cubic_stiffness", BETWEEN, {"stiffness": 1e9})
    np.testing.assert_array_equal(port_rows(cubic, cubic.effects[0]), [[-1.0, 1.0]])
    assert port_pairs(cubic.effects[0]) == [BETWEEN]
    turning = MODEL.with_effect("gyroscopic_coupling", ("x_m", "x"), {})
    np.testing.assert_array_equal(port_rows(turning, turning.effects[0]), np.eye(2))
    assert port_pairs(turning.effects[0]) == [("x_m", "ground"), ("x", "ground")]


def test_a_force_pulls_on_both_masses_and_shows_in_the_force_between_them():
    found = effect_ports(
        MODEL.with_effect("input_gain", "F").with_effect("cubic_stiffness", BETWEEN)
    )
    assert [effect.kind for effect in found.effects] == ["cubic_stiffness"]
    np.testing.assert_allclose(found.G, [[0.0], [0.0], [-1 / 0.6], [1 / 0.2]])
    np.testing.assert_array_equal(found.H, [[0.0], [-1.0]])
    Qs, Qw, Vs, Vw = found.motion
    np.testing.assert_array_equal(Qs, [[-1.0, 1.0, 0.0, 0.0]])
    np.testing.assert_array_equal(Vs, [[0.0, 0.0, -1.0, 1.0]])
    assert not Qw.any()
    assert not Vw.any()


def test_only_effects_with_a_force_are_dynamic():
    model = MODEL.with_effect("input_gain", "F").with_effect("constant_force", "x")
    assert [(i, effect.kind) for i, effect in dynamic_effects(model)] == [(1, "constant_force")]


def test_what_an_effect_is_told_of_its_model():
    found = context_of(MODEL, BETWEEN, 1e-3)
    assert found["spring_stiffness"] == 3e4
    assert found["spin_frequency"] == pytest.approx(40 * np.pi)
    assert found["mobility"] == pytest.approx(1e-3 * (1 / 0.6 + 1 / 0.2))
    assert context_of(MODEL, ("x",), 1e-3)["spring_stiffness"] == 0.0
    assert context_of(two_masses(), BETWEEN, 0.0)["spin_frequency"] == 0.0


def test_what_an_effect_reads_is_a_port_without_a_force():
    kind = own_kind({"formula": "f = -c*u*v", "units": {"c": "N s/(m V)"}, "channels": {"u": "V"}})
    read = MODEL.with_effect(kind, BETWEEN, {"c": 2.0})
    effect = read.effects[0]
    np.testing.assert_array_equal(port_rows(read, effect), [[-1.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    assert port_pairs(effect) == [BETWEEN, ("u", "ground")]
    found = effect_ports(read)
    assert not found.G[:, 1].any()
    assert not found.H[:, 1].any()
