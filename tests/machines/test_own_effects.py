"""Effects of your own: formulas, units, what a screening tries of them, and models with them."""

import builtins
import ctypes
import math
import pickle
import time

import numpy as np
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish.errors import InvalidInputError, RobustPolishWarning
from robustpolish.machines.effects import effect as catalogue
from robustpolish.machines.effects.effect import Effect, kinds, unregister
from robustpolish.machines.effects.evaluate import compiled_law, shapes_along
from robustpolish.machines.effects.formula_language import (
    dimension_text,
    dimensions,
    read_formula,
    read_unit,
    specification_from,
)
from robustpolish.machines.effects.kind import Motion
from robustpolish.machines.effects.user_defined import FormulaLaw, candidates, own_kind, own_table
from robustpolish.machines.simulation import simulate_model
from tests import made_up

# Three lines in a notebook: defined, used, found.
PLACE = ("x", "ground")


@pytest.fixture(autouse=True)
def nothing_registered(monkeypatch):
    monkeypatch.setattr(catalogue, "_registered", {})


def fifth(**more):
    return rp.effect("f = -k*q**5", parameters={"k": "N/m^5"}, **more)


def test_a_formula_becomes_an_effect():
    kind = fifth()
    assert kinds()["f = -k*q**5"] is kind
    for named in (kind, kind.kind):
        model = made_up.model().with_effect(named, "x", {"k": 3.0})
        assert model.effects[0].values == {"k": 3.0}
        assert model.effects[0].definition is kind
    assert "N/m^5" in str(model)


def test_the_catalogue_is_never_replaced():
    with pytest.raises(InvalidInputError, match="Rename"):
        fifth(name="cubic_stiffness")


def test_an_effect_is_withdrawn():
    kind = fifth()
    unregister(kind.kind)
    assert kind.kind not in kinds()
    assert Effect.of(kind, PLACE, {"k": 1.0}).definition == kind
    with pytest.raises(InvalidInputError, match="registered"):
        unregister(kind.kind)
    with pytest.raises(InvalidInputError, match="registered"):
        unregister("cubic_stiffness")


def test_options_are_kept():
    kind = rp.effect(
        "f = -F*abs(v/w)**n*sign(v)", parameters={"F": "N", "w": "m/s", "n": "1"}, name="rim",
        title="Drag at the rim", domain="dof", bounds={"F": (0, None), "n": (0.5, 3.0)},
        scan={"n": [1.0, 2.0]}, known={"w": 0.5},
    )  # fmt: skip
    assert (kind.kind, kind.title, kind.domain) == ("rim", "Drag at the rim", "dof")
    limits = [(p.lower, p.upper) for p in kind.parameters]
    assert limits == [(0.0, np.inf), (-np.inf, np.inf), (0.5, 3.0)]
    assert [p.default for p in kind.parameters] == [0.0, 0.5, 1.0]
    assert [p.fitted for p in kind.parameters] == [True, False, True]
    assert {scan.parameter: scan.shares for scan in kind.scan} == {"n": (1.0, 2.0), "w": (0.5,)}
    assert own_kind(own_table(kind)) == kind


@pytest.mark.parametrize(
    ("formula", "units", "key", "told"),
    [
        ("f = -c*abs(v)**n*sign(v)", {"c": "N", "n": "1"}, ("scan",), "scan={'n'"),
        ("f = -k*q**5", {"k": "N/mm^5"}, ("parameters", "k"), "parameters.k: got 'N/mm^5'"),
        ("f = -k*q**5", None, ("formula", "k"), "Declare it"),
    ],
)
def test_errors_teach(formula, units, key, told):
    with pytest.raises(InvalidInputError) as caught:
        rp.effect(formula, parameters=units)
    assert caught.value.key == key
    assert told in str(caught.value)
    assert formula not in kinds()


def test_a_law_that_no_diagnosis_can_try_is_said_to_be_one():
    with pytest.warns(RobustPolishWarning, match="proportional"):
        kind = rp.effect("f = -q/c", parameters={"c": "m/N"})
    model = made_up.model().with_effect(kind, "x", {"c": 0.5})
    assert model.linearize().A[1, 0] == pytest.approx(-(8e4 + 2.0) / 2.0)


def test_other_kinds_have_no_table():
    assert own_table(kinds()["cubic_stiffness"]) is None
    with pytest.raises(InvalidInputError, match="unknown key"):
        own_kind({"formula": "f = -3*q", "kind": "x"})


def driven(samples=4000):
    time = np.arange(samples) / 2e3
    rng = np.random.default_rng(8)
    force = sum(
        rng.normal() * np.sin(2 * np.pi * hertz * time + rng.uniform(0, 6))
        for hertz in np.linspace(3, 60, 20)
    )
    return xr.Dataset({"F": ("time", 20 * force, {"units": "N"})}, {"time": time})


def noisy(model, share=0.005):
    data = driven(6000)
    x = simulate_model(model, data).outputs[:, 0]
    noise = share * x.std() * np.random.default_rng(2).standard_normal(x.size)
    return data.assign(x=("time", x + noise, {"units": "m"}))


@pytest.mark.parametrize("known", [{}, {"w": 0.02}])
def test_it_is_refitted_but_for_what_is_known(known):
    kind = rp.effect("f = -F*tanh(v/w)", parameters={"F": "N", "w": "m/s"}, known=known)
    true = made_up.model().with_effect(kind, "x", {"F": 8.0, "w": 0.02})
    start = true.with_parameters({"effect[0].F": 5.0, "effect[0].w": 0.02 if known else 0.03})
    fitted = rp.refit(start, noisy(true)).model.effects[0]
    assert kind.parameter("w").default == (0.02 if known else 1.0)
    assert fitted.values["F"] == pytest.approx(8.0, rel=0.02)
    assert fitted.values["w"] == (0.02 if known else pytest.approx(0.02, rel=0.1))


def test_one_that_nobody_registered_gets_its_first_values_from_a_screening():
    """As of a model from a file: no numbers, and no diagnosis knows the kind."""
    true = made_up.model().with_effect(fifth(), "x", {"k": 1e16})
    unregister("f = -k*q**5")
    blank = made_up.model().with_effect(true.effects[0].definition, "x")
    start = rp.MechanicalModel.from_toml(blank.to_toml())
    assert start.effects[0].values == {"k": 0.0}
    fitted = rp.refit(start, noisy(true)).model.effects[0]
    assert fitted.values["k"] == pytest.approx(1e16, rel=0.02)


@pytest.mark.long
def test_a_diagnosis_finds_the_fifth_power_among_the_catalogue(tmp_path):
    kind = fifth()
    true = made_up.model().with_effect(kind, "x", {"k": 1e16})
    found = rp.diagnose(made_up.model(), noisy(true))
    assert [(e.kind, e.at) for e in found.effects] == [(kind.kind, PLACE)]
    assert found.effects[0].parameters["k"].value == pytest.approx(1e16, rel=0.02)
    assert found.effects[0].parameters["k"].unit == "N/m^5"
    found.save(tmp_path / "found.json")
    unregister(kind.kind)
    again = rp.load(tmp_path / "found.json")
    assert again.model == found.model
    assert again.effects == found.effects
    assert again.explain() == found.explain()


# Channels -----------------------------------------------------------------------------


def damper():
    return rp.effect("f = -c*u*v", parameters={"c": "N s/(m V)"}, channels={"u": "V"})


def test_a_channel_is_a_straight_line_between_samples():
    """A ramp of voltage does what a law with the ramp in it does."""
    kind = rp.effect(
        "f = -(a + c*u)*v", parameters={"a": "N s/m", "c": "N s/(m V)"}, channels={"u": "V"}
    )
    ramp = rp.effect("f = -(a + c*(1 + 3*t))*v", parameters={"a": "N s/m", "c": "N s/m"})
    values = {"a": 5.0, "c": 40.0}
    data = driven()
    data = data.assign(u=("time", 1 + 3 * data["time"].values, {"units": "V"}))
    one, other = (made_up.model().with_effect(k, "x", values) for k in (kind, ramp))
    found, wanted = (simulate_model(m, data, substeps=2).outputs for m in (one, other))
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())


def test_a_model_says_what_an_effect_reads():
    model = made_up.model().with_effect(damper(), "x", {"c": 40.0})
    assert model.channels == ("u",)
    assert model == made_up.model().with_channel("u", "V").with_effect("f = -c*u*v", "x", {"c": 40})
    assert rp.MechanicalModel.from_toml(model.to_toml()) == model
    assert "N s/m/V" in str(model)
    assert "channel" in str(model)
    assert "mass 0" not in " ".join(str(model).split())


def test_it_is_linearised_at_a_voltage():
    model = made_up.model().with_effect(damper(), "x", {"c": 40.0})
    slopes = [model.linearize(operating_point={"u": volt}).A[1, 1] for volt in (0.0, 2.0)]
    np.testing.assert_allclose(slopes, [-12.0 / 2.0, -(12.0 + 80.0) / 2.0])


def test_data_without_the_channel_are_refused():
    model = made_up.model().with_effect(damper(), "x", {"c": 40.0})
    data = driven()
    with pytest.raises(InvalidInputError, match="no column 'u'"):
        rp.compare(model, data.assign(x=data["F"] * 1e-5))


def test_channel_names_that_are_taken_are_refused():
    taken = rp.effect("f = -c*F*v", parameters={"c": "s/m"}, channels={"F": "N"})
    with pytest.raises(InvalidInputError, match="Rename"):
        made_up.model().with_effect(taken, "x", {"c": 1.0})
    with pytest.raises(InvalidInputError, match="no input imposes"):
        itself = rp.effect("f = -c*x*v", parameters={"c": "N s/(m V)"}, channels={"x": "V"})
        made_up.model().with_effect(itself, "x", {"c": 1.0})


def test_a_diagnosis_finds_what_follows_a_voltage():
    kind = damper()
    data = driven(6000)
    volts = 2 + np.sin(2 * np.pi * 0.7 * data["time"].values)
    data = data.assign(u=("time", volts, {"units": "V"}))
    true = made_up.model().with_effect(kind, "x", {"c": 40.0})
    x = simulate_model(true, data).outputs[:, 0]
    noise = 0.005 * x.std() * np.random.default_rng(4).standard_normal(x.size)
    data = data.assign(x=("time", x + noise, {"units": "m"}))
    found = rp.diagnose(made_up.model().with_channel("u", "V"), data)
    assert [(e.kind, e.at) for e in found.effects] == [(kind.kind, PLACE)]
    assert found.effects[0].parameters["c"].value == pytest.approx(40.0, rel=0.02)
    assert not any("u" in c.at for c in found.candidates)


# A formula makes the force that a law written by hand makes.


def mixed(t, q, v, z, p, f, dz):
    f[0] = (
        p[0] * np.sin(3.0 * t) * np.exp(-(q[0] ** 2)) / (2.0 + np.cos(v[0]))
        - p[1] * np.arctan(q[0]) * np.sqrt(abs(v[0])) * np.sign(v[0])
        + np.log(1.0 + q[0] ** 2) * np.tan(0.1 * q[0]) * abs(q[0]) ** p[1]
        - (1.0 + q[0] ** 2) ** -2
    )


MIXED = (
    "f = a*sin(3*t)*exp(-q**2)/(2 + cos(v)) - b*arctan(q)*sqrt(abs(v))*sign(v)"
    " + log(1 + q**2)*tan(0.1*q)*abs(q)**b - (1 + q**2)**-2"
)


def law_of(formula, *names):
    # units stand aside: this tests operations
    return FormulaLaw(formula, tuple((name, "1") for name in names))


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


# What is no formula ends quickly and in words; nothing of it runs.
HOSTILE = [
    "f = __import__('os').system('true')", "f = q.__class__", "f = __builtins__*q",
    "f = (lambda: 1)()", "f = (q := 1)", "f = sum([i for i in (1, 2)])", "f = q[0]",
    "f = 'a'*9**9", "f = f'{q}'", "f = q; import os", "f = q\nimport os", "g = q", "f[0] = q",
    "f = q = 1", "f += q", "-k*q", "f = min(*q)", "f = sin(x=q)", "f = True*q", "f = 1j*q",
    "f = q, v", "f = q\0", "", "   ", "# f = q", "f = sin()", "f = max(q)", "f = eval(q)",
    "f = " + "9" * 900 + "*q", "f = 1e999*q", "f = 10**10**10**10*q", "f = 1 << 999999999",
    "f = q // 2", "f = q % 2", "f = q @ v", "f = " + "(" * 400 + "q" + ")" * 400,
    "f = " + "sin(" * 150 + "q" + ")" * 150, "f = " + "-" * 900 + "q",
    "f = " + "q**" * 300 + "q", "f = " + "q+" * 5_000_000 + "q", "f = q" + " " * 10_000_000,
    3, b"f = q", None,
]  # fmt: skip


@pytest.mark.parametrize("number", range(len(HOSTILE)))
def test_what_is_no_formula_is_refused_at_once(number, monkeypatch):
    def forbidden(*_):
        raise AssertionError("text was executed")

    monkeypatch.setattr(builtins, "eval", forbidden)
    monkeypatch.setattr(builtins, "exec", forbidden)
    start = time.process_time()
    with pytest.raises(InvalidInputError) as caught:
        read_formula(HOSTILE[number], [])
    assert time.process_time() - start < 2.0
    assert len(str(caught.value)) < 1000


@pytest.mark.parametrize(
    ("text", "hint"),
    [("f = -k*q^5", r"\*\* for a power"), ("f = -k*q if q > 0 else 0", "min, max"),
     ("f = -k*np.tanh(q)", "name alone"), ("f = -k*|v|", "Correct it"),
     ("f = -k*(q > 0)", "min, max"), ("f = -kk*q", "parameters={'kk'"),
     ("f = -k*(q and v)", "min, max"), ("-k*q", "Begin with 'f ='"),
     ("f = -k*cosh(q)", "Use one of these functions")],
)  # fmt: skip
def test_common_slips_get_a_hint(text, hint):
    with pytest.raises(InvalidInputError, match=hint):
        read_formula(text, ["k"])


@pytest.mark.parametrize(
    "name", ["q", "f", "tanh", "pi", "lambda", "2k", "a b", "__import__", "", 3]
)
def test_names_that_cannot_be_parameters_are_refused(name):
    with pytest.raises(InvalidInputError, match="Rename it"):
        read_formula("f = q", [name])


def test_a_declared_name_has_to_be_used():
    with pytest.raises(InvalidInputError, match="without c"):
        read_formula("f = -k*q", ["k", "c"])


def test_letters_of_other_alphabets_are_names():
    assert read_formula("f = -μ*sign(v)", ["μ"]).value({"μ": 2.0, "v": 1.0}) == -2.0
    with pytest.raises(InvalidInputError, match="plain letters"):
        read_formula("f = -µ*sign(v)", ["µ"])  # the micro sign, which Python turns into a mu


def test_long_sums_are_not_deep():
    text = "f = " + " + ".join(["q"] * 200)
    assert read_formula(text, []).value({"q": 1.0}) == 200.0


@pytest.mark.parametrize(
    "text",
    ["", " ", "N/", "/m", "N/mm", "kN", "N/m s", "N^", "N^^2", "(N", "N)", "N/m^5^2", "5", "N--", 3,
     None, "N/m^1e5", "N" * 200, "(" * 30 + "N" + ")" * 30, "N\nm;", "V"],
)  # fmt: skip
def test_what_is_no_unit_is_refused(text):
    with pytest.raises(InvalidInputError, match="SI unit") as caught:
        read_unit(text, ("units", "k"))
    assert caught.value.key == ("units", "k")


def found(text, channels=None, **units):
    formula = read_formula(text, [*units, *(channels or {})])
    return {n: dimension_text(p) for n, p in dimensions(formula, units, channels or {}).items()}


@pytest.mark.parametrize(
    ("text", "units", "wanted"),
    [
        ("f = -k*q**5", {"k": "N/m^5"}, {"k": "F/L^5"}),
        ("f = -c*abs(v)*v", {"c": "N s^2/m^2"}, {"c": "F*T^2/L^2"}),
        ("f = -F*tanh(v/w)", {"F": "N", "w": "m/s"}, {"F": "F", "w": "L/T"}),
        ("f = -F*tanh(v/w)", {"F": "N m", "w": "rad/s"}, {"F": "F", "w": "L/T"}),
        ("f = -k*sin(q)", {"k": "N m"}, {"k": "F"}),
        ("f = -k*q", {"k": "N m/rad"}, {"k": "F/L"}),
        ("f = -m*g*l*sin(q)", {"m": "kg", "g": "m/s^2", "l": "m"},
         {"m": "kg", "g": "m/s^2", "l": "m"}),
        ("f = -m*g*q/l", {"m": "kg", "g": "m/s^2", "l": "m"}, {"m": "M", "g": "L/T^2", "l": "L"}),
        ("f = F*sin(2*pi*n*t + p)", {"F": "N", "n": "Hz", "p": "rad"},
         {"F": "F", "n": "1/T", "p": "1"}),
        ("f = -F*tanh(50*q)", {"F": "N"}, {"F": "F"}),
        ("f = -c*abs(v)**n*sign(v)", {"c": "N", "n": "1"}, {"c": "F", "n": "1"}),
        ("f = -k*max(q, 0)**1.5", {"k": "N/m^1.5"}, {"k": "F/L^1.5"}),
    ],
)  # fmt: skip
def test_dimensions_are_those_that_make_a_force(text, units, wanted):
    assert found(text, **units) == wanted


def test_a_channel_brings_its_unit():
    units = {"a": "N s/m", "b": "N s/(m V)"}
    wanted = {"a": "F*T/L", "b": "F*T/L/V"}
    assert found("f = -(a + b*u)*v", {"u": "V"}, **units) == wanted
    with pytest.raises(InvalidInputError, match=r"\+ joins"):
        found("f = -(a + b*u)*v", {"u": "V"}, a="N s/m", b="N s/m")


@pytest.mark.parametrize(
    ("text", "units", "why"),
    [
        ("f = -k*q**5", {"k": "N/m^3"}, "f comes out in N m^2"),
        ("f = -k*q - c*v", {"k": "N/m", "c": "N/m"}, "joins N and N/s"),
        ("f = -k*(q + v)", {"k": "N/m"}, "joins m and m/s"),
        ("f = -F*tanh(v)", {"F": "N"}, "tanh is taken of something in m/s"),
        ("f = -k*q", {"k": "N/rad"}, "f comes out in N,"),
        ("f = -k*sin(v)", {"k": "N m/rad"}, "sin is taken of something in 1/s"),
        ("f = -k*sin(q)", {"k": "N"}, "sin is taken of something in m"),
    ],
)
def test_wrong_units_are_told(text, units, why):
    with pytest.raises(InvalidInputError, match="Check the units") as caught:
        found(text, **units)
    assert why in str(caught.value)


WHOLE = {
    "formula": "f = -F*tanh(v/w)", "units": {"F": "N", "w": "m/s"}, "name": "rim",
    "title": "Friction at the rim", "domain": "dof",
    "bounds": {"F": [0.0, math.inf], "w": [1e-4, 1.0]}, "scan": {"w": [1e-3, 1e-2]},
    "known": {"F": 2.0},
}  # fmt: skip


@pytest.mark.parametrize(
    ("change", "key"),
    [({"units": "N"}, ("units",)), ({"units": {"F": "N"}}, ("formula", "w")),
     ({"name": ""}, ("name",)), ({"name": 3}, ("name",)), ({"title": "x" * 100}, ("title",)),
     ({"domain": "axes"}, ("domain",)), ({"bounds": [0, 1]}, ("bounds",)),
     ({"bounds": {"x": [0, 1]}}, ("bounds", "x")), ({"bounds": {"F": [1, 0]}}, ("bounds", "F")),
     ({"bounds": {"F": [0]}}, ("bounds", "F")), ({"bounds": {"F": 3}}, ("bounds", "F")),
     ({"bounds": {"F": [math.nan, 1]}}, ("bounds", "F")), ({"scan": {"w": []}}, ("scan", "w")),
     ({"scan": {"w": [math.inf]}}, ("scan", "w")), ({"scan": {"w": ["1"]}}, ("scan", "w")),
     ({"scan": {"w": [10**400]}}, ("scan", "w")), ({"scan": {"w": 0.1}}, ("scan", "w")),
     ({"scan": {"x": [1.0]}}, ("scan", "x")), ({"known": {"x": 1.0}}, ("known", "x")),
     ({"known": {"w": 1.0}}, ("known", "w")), ({"known": {"F": "1"}}, ("known", "F")),
     ({"channels": {"F": "V"}}, ("channels", "F"))],
)  # fmt: skip
def test_errors_say_where(change, key):
    with pytest.raises(InvalidInputError) as caught:
        specification_from({**WHOLE, **change})
    assert caught.value.key == key


def tried(text, given=None, **units):
    formula = read_formula(text, units)
    return candidates(formula, dimensions(formula, units, {}), given or {})


def sizes(found):
    return {scan.parameter: scan.of for scan in found.scan}


@pytest.mark.parametrize(
    ("text", "units", "solved", "scanned"),
    [
        ("f = -k*q**5", {"k": "N/m^5"}, ("k",), {}),
        ("f = -k*q - c*v", {"k": "N/m", "c": "N s/m"}, ("k", "c"), {}),
        ("f = -F*tanh(v/w)", {"F": "N", "w": "m/s"}, ("F",), {"w": (0, 1)}),
        ("f = -k*max(abs(q) - g, 0)*sign(q)", {"g": "m", "k": "N/m"}, ("k",), {"g": (1, 0)}),
        ("f = -k*(q + b*q**3)", {"k": "N/m", "b": "1/m^2"}, ("k",), {"b": (-2, 0)}),
        ("f = -F*tanh(k*q/F)", {"F": "N", "k": "N/m"}, ("F",), {"k": (-1, 0)}),
        ("f = -F*tanh(c*v/F)", {"c": "N s/m", "F": "N"}, ("c",), {"F": (0, 1)}),
        ("f = -m*w**2*q", {"m": "kg", "w": "1/s"}, ("m",), {"w": (-1, 1)}),
    ],
)
def test_parameters_are_solved_for_or_scanned(text, units, solved, scanned):
    found = tried(text, **units)
    assert found.linear_in == solved
    assert sizes(found) == scanned
    assert not found.missing


def test_values_that_were_given_are_tried():
    found = tried("f = -c*abs(v)**n*sign(v)", {"n": (0.5, 2.0)}, c="N", n="1")
    assert found.linear_in == ("c",)
    assert [(s.of, s.shares) for s in found.scan] == [("1", (0.5, 2.0))]
    both = tried("f = -F*tanh(k*q/F)", {"F": (1.0, 2.0), "k": (1e3,)}, F="N", k="N/m")
    assert both.linear_in == ()
    assert sizes(both) == {"F": "1", "k": "1"}


@pytest.mark.parametrize(
    ("text", "given", "units", "unknown"),
    [
        ("f = -c*abs(v)**n*sign(v)", None, {"c": "N", "n": "1"}, ("n",)),
        ("f = -q/c", None, {"c": "m/N"}, ()),
        ("f = -k*q - 2*q**3", None, {"k": "N/m"}, ()),
        ("f = -3*k**2*q", None, {"k": "1"}, ()),
        ("f = -F*tanh(k*q/F)", {"F": (1.0,)}, {"F": "N", "k": "N/m"}, ()),
    ],
)
def test_what_cannot_be_tried_says_why(text, given, units, unknown):
    found = tried(text, given, **units)
    assert found.missing
    assert found.remedy
    assert found.unknown == unknown
    assert not found.linear_in
    assert not found.scan


def test_too_many_values_or_parameters_are_refused():
    units = {"k": "N", "a": "1", "b": "1"}
    given = {"a": tuple(range(20)), "b": tuple(range(20))}
    with pytest.raises(InvalidInputError, match="400 combinations"):
        tried("f = -k*sin(a*tanh(b*sign(q)))", given, **units)
    units = {f"k{i}": "N/m" for i in range(11)}
    with pytest.raises(InvalidInputError, match="at most 10"):
        specification_from({"formula": "f = " + "".join(f"-{k}*q" for k in units), "units": units})


def test_the_true_force_is_among_the_shapes():
    """With the knee among the values that are tried, the coefficients give the law back."""
    time = np.linspace(0.0, 1.0, 2001)
    q = 0.8 * np.sin(2 * np.pi * 3 * time)
    motion = Motion(time, q[None], np.gradient(q, time)[None])
    kind = own_kind({"formula": "f = -F*tanh(k*q/F)", "units": {"F": "N", "k": "N/m"}})
    shapes = shapes_along(kind, motion)
    assert len(shapes) == 4
    for shape in shapes:
        values = shape.values(np.array([2.5]))
        force = -values["F"] * np.tanh(values["k"] * q / values["F"])
        np.testing.assert_allclose(2.5 * shape.columns[0, 0], force, rtol=1e-10, atol=1e-12)
        assert shape.signs == (1,)
