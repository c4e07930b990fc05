"""A formula makes the force that a law written by hand makes."""

import ctypes
import pickle

import numpy as np
import pytest

from robustpolish.machines.effects.evaluate import compiled_law, force_along
from robustpolish.machines.effects.formula_language import specification_from
from robustpolish.machines.effects.kind import EffectKind, Motion, Parameter
from robustpolish.machines.effects.user_defined import FormulaGains, FormulaLaw, own_kind


def cubic(t, q, v, z, p, f, dz):
    f[0] = -p[0] * q[0] ** 3


def drag(t, q, v, z, p, f, dz):
    f[0] = -p[0] * abs(v[0]) * v[0]


def friction(t, q, v, z, p, f, dz):
    f[0] = -p[0] * np.tanh(v[0] / p[1])


def play(t, q, v, z, p, f, dz):
    f[0] = -p[0] * (q[0] - min(max(q[0], -p[1]), p[1]))


def mixed(t, q, v, z, p, f, dz):
    f[0] = (
        p[0] * np.sin(3.0 * t) * np.exp(-(q[0] ** 2)) / (2.0 + np.cos(v[0]))
        - p[1] * np.arctan(q[0]) * np.sqrt(abs(v[0])) * np.sign(v[0])
        + np.log(1.0 + q[0] ** 2) * np.tan(0.1 * q[0]) * abs(q[0]) ** p[1]
        - (1.0 + q[0] ** 2) ** -2
    )


LAWS = {
    "cubic": (cubic, "f = -k*q**3", {"k": "N/m^3"}),
    "drag": (drag, "f = -c*abs(v)*v", {"c": "N s^2/m^2"}),
    "friction": (friction, "f = -F*tanh(v/w)", {"F": "N", "w": "m/s"}),
    "play": (play, "f = -k*(q - min(max(q, -g), g))", {"k": "N/m", "g": "m"}),
}


def by_hand(law, kind):
    """Return the same kind with a law in Python."""
    parameters = tuple(Parameter(p.name, p.dimension, "") for p in kind.parameters)
    return EffectKind("by_hand", "", "pair", parameters, law, gains=kind.gains, sharp=kind.sharp)


def along():
    time = np.linspace(0.0, 3.0, 3001)
    q = 2.0 * np.sin(5 * time) + 0.3 * np.cos(31 * time)
    return Motion(time, q[None], np.gradient(q, time)[None])


@pytest.mark.parametrize("name", LAWS)
def test_it_makes_the_force_that_a_law_by_hand_makes(name):
    law, formula, units = LAWS[name]
    kind = own_kind({"formula": formula, "units": units})
    values = np.array([3.0, 0.4])[: len(units)]
    wanted = force_along(by_hand(law, kind), along(), values)
    found = force_along(kind, along(), values)
    np.testing.assert_allclose(found, wanted, rtol=1e-13, atol=1e-13 * np.abs(wanted).max())


MIXED = (
    "f = a*sin(3*t)*exp(-q**2)/(2 + cos(v)) - b*arctan(q)*sqrt(abs(v))*sign(v)"
    " + log(1 + q**2)*tan(0.1*q)*abs(q)**b - (1 + q**2)**-2"
)


def law_of(formula, *names):
    # units stand aside: this tests operations
    return FormulaLaw(specification_from({"formula": formula, "units": dict.fromkeys(names, "1")}))


def call(compiled, t, *arrays):
    """Call machine code with the addresses of arrays."""
    compiled.ctypes(t, *(a.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for a in arrays))


def test_every_operation_is_compiled_as_it_is_computed():
    law = law_of(MIXED, "a", "b")
    compiled, rng = law.compiled(), np.random.default_rng(5)
    z, dz = np.zeros(0), np.zeros(0)
    for _ in range(50):
        t, (q, v), p = rng.uniform(), rng.normal(size=(2, 1)), rng.uniform(0.5, 2.0, 2)
        f, g, h = np.zeros(1), np.zeros(1), np.zeros(1)
        call(compiled, t, q, v, z, p, f, dz)
        law(t, q, v, z, p, g, dz)
        mixed(t, q, v, z, p, h, dz)
        assert f[0] == pytest.approx(h[0], rel=1e-13)
        assert g[0] == pytest.approx(h[0], rel=1e-13)


@pytest.mark.parametrize(
    ("formula", "q", "wanted"),
    [("f = log(q)", -1.0, np.nan), ("f = 1/q", 0.0, np.inf), ("f = q**0.5", -1.0, np.nan),
     ("f = q**-1", 0.0, np.inf), ("f = q**100", 1e10, np.inf), ("f = max(q, 1)", 0.5, 1.0),
     ("f = q**0", 3.0, 1.0)],
)  # fmt: skip
def test_what_is_not_finite_stays_so(formula, q, wanted):
    f, empty = np.zeros(1), np.zeros(0)
    call(law_of(formula).compiled(), 0.0, np.array([q]), np.zeros(1), empty, empty, f, empty)
    np.testing.assert_equal(f[0], wanted)


def test_equal_laws_are_equal_and_travel():
    table = {"formula": "f = -k*q**5", "units": {"k": "N/m^5"}}
    kind, again = own_kind(table), own_kind(table)
    assert kind == again
    assert hash(kind) == hash(again)
    assert pickle.loads(pickle.dumps(kind)) == kind
    assert compiled_law(kind) is compiled_law(again)
    assert own_kind({**table, "formula": "f = -k*q**5*1"}) != kind


def test_it_costs_what_a_law_by_hand_costs():
    """The machine code is the arithmetic alone: as many products as were written, and no call."""
    law = law_of("f = -k*q**5 - c*v*abs(v)", "k", "c")
    code = law.compiled().inspect_llvm()
    body = code[code.index("define") :].split("\n}")[0]
    assert body.count("fmul") == 3 + 1 + 2  # the fifth power, its factor, the drag
    assert [line for line in body.splitlines() if "call" in line and "@llvm." not in line] == []


def test_the_steepest_slopes_decide_on_steps():
    law = FormulaLaw(specification_from({"formula": "f = -k*q**3 - F*tanh(v/w)",
                                   "units": {"k": "N/m^3", "F": "N", "w": "m/s"}}))  # fmt: skip
    gains = FormulaGains(law)
    stiffness, damping, rate = gains({"k": 2.0, "F": 3.0, "w": 0.01}, 10.0, 5.0)
    assert stiffness == pytest.approx(600.0, rel=1e-4)
    assert damping == pytest.approx(300.0, rel=1e-4)
    assert rate == 0.0
    assert gains({"k": 2.0, "F": 3.0, "w": 0.01}, 0.0, 0.0) == (0.0, 0.0, 0.0)
    assert gains == FormulaGains(law)


def test_signals_are_read_behind_the_motion_and_may_be_large():
    table = {"formula": "f = -(a + c*u)*v", "units": {"a": "N s/m", "c": "N s/(m V)"},
             "channels": {"u": "V"}}  # fmt: skip
    law = FormulaLaw(specification_from(table))
    f, g, empty = np.zeros(2), np.zeros(2), np.zeros(0)
    given = (0.0, np.array([7.0, 2.0]), np.array([3.0, 0.0]), empty, np.array([1.0, 10.0]))
    law(*given, f, empty)
    call(law.compiled(), *given, g, empty)
    assert f.tolist() == g.tolist() == [-63.0, 0.0]
    assert FormulaGains(law)({"a": 1.0, "c": 10.0}, 1.0, 1.0)[1] == pytest.approx(101.0, rel=1e-6)
    assert own_kind(table).ports == 2


def test_corners_ask_for_short_steps():
    assert law_of("f = max(q, 0)").sharp
    assert not law_of("f = q**3").sharp
