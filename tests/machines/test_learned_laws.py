"""Learned laws: what their names code, their curves, their words and formulas."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import BSpline

import robustpolish as rp
from robustpolish.machines.effects.effect import Effect, kinds, lookup, register
from robustpolish.machines.effects.evaluate import force_along
from robustpolish.machines.effects.kind import Motion
from robustpolish.machines.effects.spline_law import (
    learned_kind,
    learned_name,
    spline_basis,
    spline_centres,
)
from tests.effects.learned_curves import learned_law_of, surface_of
from tests.identification.oscillators import PLACE, oscillator, record

# Learned kinds: what their names code, their curves, and a model that holds one.
KNOTS = {"low": -2.0, "high": 1.0}


def named(c, **knots):
    """Values of a learned law, its coefficients numbered."""
    c = np.asarray(c, dtype=float)
    if c.ndim == 2:
        names = [f"c{i + 1}_{j + 1}" for i in range(len(c)) for j in range(len(c))]
    else:
        names = [f"c{j + 1}" for j in range(len(c))]
    return {**knots, **dict(zip(names, c.ravel().tolist(), strict=True))}


def curve(kind, values, q, v):
    """Minus the force along points, as the compiled law gives it."""
    time = np.arange(q.size) * 1e-3
    values = Effect(kind, "x", values).values
    p = np.array(list(values.values()))
    return -force_along(lookup(kind), Motion(time, q[None], v[None]), p)[0]


@pytest.mark.parametrize(
    ("name", "title"),
    [("learned_stiffness_9", "Learned law over displacement"),
     ("learned_damping_25", "Learned law over velocity"),
     ("learned_force_7x7", "Learned law over displacement and velocity"),
     ("learned_varying_stiffness_9", "Learned stiffness over time"),
     ("learned_varying_damping_25", "Learned damping over time")],
)  # fmt: skip
def test_a_name_codes_a_kind(name, title):
    kind = lookup(name)
    assert kind.kind == name
    assert kind.title == title
    assert kind is learned_kind(name)
    assert pickle.loads(pickle.dumps(kind)) == kind
    assert sum(p.fitted for p in kind.parameters) == {"9": 9, "5": 25, "7": 49}[name[-1]]
    assert all((kind.looks_like, kind.checks, kind.references))


@pytest.mark.parametrize(
    "name",
    ["learned_varying_force_7x7", "learned_varying_9", "learned_stiffness_4",
     "learned_stiffness_201", "learned_force_7", "learned_force_7x8",
     "learned_law_9", "learned_stiffness_", "learned_force_41x41"],
)  # fmt: skip
def test_other_names_code_none(name):
    assert learned_kind(name) is None
    with pytest.raises(rp.InvalidInputError, match="Check the spelling"):
        lookup(name)


@pytest.mark.parametrize(("over", "unit"), [("stiffness", "N/m"), ("damping", "N s/m")])
def test_what_varies_follows_the_time_and_stays_as_it_ended(over, unit):
    kind = lookup(learned_name(f"varying_{over}", 7))
    given = named(10.0 * spline_centres(1.0, 3.0, 7), low=1.0, high=3.0)
    values = Effect(kind.kind, "x", given).values

    def force(t, q, v):
        f = np.zeros(1)
        p = np.array(list(values.values()))
        kind.law(t, np.array([q]), np.array([v]), np.zeros(0), p, f, np.zeros(0))
        return f[0]

    along, across = ((1.0, 0.0), (0.0, 1.0))[:: 1 if over == "stiffness" else -1]
    found = [-force(t, *along) for t in (0.0, 1.0, 2.0, 3.0, 9.0)]
    assert found == pytest.approx([10.0, 10.0, 20.0, 30.0, 30.0])
    assert force(2.0, *across) == 0.0
    assert kind.steepness(values, 1.0, 1.0) == (35.0 * along[0], 35.0 * along[1], 0.0)
    assert (kind.parameters[0].unit(), kind.parameters[-1].unit()) == ("s", unit)


def test_no_learned_law_is_named_like_an_effect_of_the_catalogue():
    assert not any(learned_kind(name) for name in kinds())
    assert learned_name("damping", 8) not in kinds()
    taken = lookup("cubic_stiffness")
    with pytest.raises(rp.InvalidInputError, match="not taken"):
        register(replace(taken, kind="learned_stiffness_9"))


def test_the_curve_is_the_spline_of_the_textbook():
    c = np.random.default_rng(0).standard_normal(9)
    step = 3.0 / 6
    knots = -2.0 + step * np.arange(-3, 10)
    x = np.linspace(-2.0, 1.0, 200)
    wanted = BSpline(knots, c, 3)
    np.testing.assert_allclose(c @ spline_basis(x, -2.0, 1.0, 9), wanted(x), atol=1e-12)
    stays = c @ spline_basis(np.array([-3.0, 1.7]), -2.0, 1.0, 9, stays=True)
    np.testing.assert_allclose(stays, wanted(np.array([-2.0, 1.0])), atol=1e-12)


def test_outside_a_curve_bends_less_and_less_and_is_straight_from_one_stretch_on():
    c = np.random.default_rng(0).standard_normal(9)
    step = 3.0 / 6
    further = BSpline(
        -2.0 + step * np.arange(-5, 12),
        [3 * c[0] - 2 * c[1], 2 * c[0] - c[1], *c, 2 * c[-1] - c[-2], 3 * c[-1] - 2 * c[-2]],
        3,
    )
    x = np.linspace(-2.0 - 2 * step, 1.0 + 2 * step, 400)
    np.testing.assert_allclose(c @ spline_basis(x, -2.0, 1.0, 9), further(x), atol=1e-12)
    ends = np.array([-2.0 - step, 1.0 + step])
    far = np.array([-6.0, 9.0])
    straight = further(ends) + further(ends, 1) * (far - ends)
    np.testing.assert_allclose(c @ spline_basis(far, -2.0, 1.0, 9), straight, atol=1e-12)


def test_the_compiled_laws_are_their_curves():
    rng = np.random.default_rng(1)
    q, v = rng.uniform(-3, 2, 300), rng.uniform(-8, 8, 300)
    c = rng.standard_normal(8)
    of_q = c @ spline_basis(q, -2.0, 1.0, 8)
    np.testing.assert_allclose(curve("learned_stiffness_8", named(c, **KNOTS), q, v), of_q)
    of_v = c @ spline_basis(v, -2.0, 1.0, 8, stays=True)
    np.testing.assert_allclose(curve("learned_damping_8", named(c, **KNOTS), q, v), of_v)
    C = rng.standard_normal((6, 6))
    both = named(C, **KNOTS, slow=-5.0, fast=6.0)
    across = spline_basis(v, -5.0, 6.0, 6, stays=True)
    wanted = np.einsum("ip,ij,jp->p", spline_basis(q, -2.0, 1.0, 6), C, across)
    np.testing.assert_allclose(curve("learned_force_6x6", both, q, v), wanted)


def test_what_is_no_number_breaks_nothing():
    q = np.array([np.nan, np.inf, -np.inf, 0.0])
    found = curve("learned_stiffness_8", named(np.ones(8), **KNOTS), q, np.zeros(4))
    assert not np.isfinite(found[:1]).any()
    assert found[3] == pytest.approx(1.0)
    flat = curve(
        "learned_stiffness_8", named(np.ones(8), low=1.0, high=1.0), np.ones(4), np.ones(4)
    )
    assert not flat.any()


def with_curves():
    """An oscillator whose spring and damper are learned laws that are straight lines."""
    q = named(400 * spline_centres(-0.1, 0.1, 7), low=-0.1, high=0.1)
    v = named(1.0 * spline_centres(-2.0, 2.0, 7), low=-2.0, high=2.0)
    bare = oscillator(springs=[], dampers=[])
    return bare.with_effect("learned_stiffness_7", PLACE, q).with_effect(
        "learned_damping_7", PLACE, v
    )


def test_a_model_with_straight_curves_is_the_linear_one():
    curved, straight = with_curves(), oscillator()
    plant = curved.linearize()
    np.testing.assert_allclose(plant.A, straight.linearize().A, rtol=1e-3)
    away = curved.linearize(operating_point={"x": 0.05})
    np.testing.assert_allclose(away.A, straight.linearize().A, rtol=1e-3)
    data = record(samples=500)
    one = rp.compare(curved, data).residual["x"].values
    other = rp.compare(straight, data).residual["x"].values
    np.testing.assert_allclose(one, other, atol=2e-5 * float(data["x"].std()))


def test_it_is_the_same_after_a_file():
    curved = with_curves()
    again = rp.MechanicalModel.from_toml(curved.to_toml())
    assert again == curved
    assert again.effects[0].definition is curved.effects[0].definition


# The formula behind a curve is found, and none is made up.


def dead(q, gap):
    return np.sign(q) * np.maximum(np.abs(q) - gap, 0)


@pytest.mark.parametrize(
    ("curve", "over", "expression", "numbers"),
    [
        (lambda q: 90 * q, "stiffness", "k*q", {"k": 90}),
        (lambda q: 90 * q**3, "stiffness", "k3*q**3", {"k3": 90}),
        (lambda q: 90 * q**5, "stiffness", "k5*q**5", {"k5": 90}),
        (lambda q: 90 * q * np.abs(q), "stiffness", "ka*q*abs(q)", {"ka": 90}),
        (lambda q: 90 * q**2, "stiffness", "k2*q**2", {"k2": 90}),
        (lambda q: 9 * np.tanh(q / 0.3), "stiffness", "Fs*tanh(q/d)", {"Fs": 9, "d": 0.3}),
        (lambda q: 90 * dead(q, 0.3), "stiffness", "kd*sign(q)*max(abs(q) - d, 0)",
         {"kd": 90, "d": 0.3}),
        (lambda q: 90 * np.maximum(q, 0), "stiffness", "kr*max(q, 0)", {"kr": 90}),
        (lambda q: 90 * np.maximum(q - 0.3, 0), "stiffness", "kr*max(q - d, 0)",
         {"kr": 90, "d": 0.3}),
        (lambda q: 90 * q + 300 * q**3, "stiffness", "k*q + k3*q**3", {"k": 90, "k3": 300}),
        (lambda v: 9 * v, "damping", "c*v", {"c": 9}),
        (lambda v: 9 * np.tanh(v / 0.004), "damping", "F*sign(v)", {"F": 9}),
        (lambda v: 9 * v * np.abs(v), "damping", "ca*v*abs(v)", {"ca": 9}),
        (lambda v: 20 * v**3 - 5 * v, "damping", "c*v + c3*v**3", {"c": -5, "c3": 20}),
    ],
)  # fmt: skip
def test_the_right_formula_is_the_simplest(curve, over, expression, numbers):
    found = learned_law_of(curve, over=over).formula()
    assert found is not None
    assert found.expression == expression
    for name, value in numbers.items():
        assert found.numbers[name] == pytest.approx(value, rel=0.03, abs=0.02 * abs(value))
        error = found.stderr[name]
        assert np.isnan(error) or abs(found.numbers[name] - value) < 4 * error + 0.01 * abs(value)
    assert found.misfit < 0.02
    assert all(name in str(found) for name in numbers)


def test_a_wider_band_takes_a_simpler_formula():
    def bent(q):
        return 90 * q + 5 * q**3

    assert learned_law_of(bent, share=0.002).formula().expression == "k*q + k3*q**3"
    assert learned_law_of(bent, share=0.05).formula().expression == "k*q"


def test_where_none_fits_none_is_named():
    assert learned_law_of(lambda q: 90 * np.sin(8 * q) * np.exp(q)).formula() is None
    assert learned_law_of(lambda q: 0 * q, share=0.0).formula() is None


def test_surfaces_have_formulas_too():
    assert surface_of(lambda q, v: 8 * q + 3 * v).formula().expression == "k*q + c*v"
    damped = surface_of(lambda q, v: 40 * q**2 * v).formula()
    assert damped.expression == "cq*q**2*v"
    assert damped.units == {"cq": "N s/m^3"}


@pytest.mark.parametrize(
    ("curve", "over", "said", "unsaid"),
    [
        (lambda q: 90 * q, "stiffness", ("odd", "nearly straight", "slope 89.8"), ("dead zone",)),
        (lambda q: 90 * q**3, "stiffness", ("odd", "hardens"), ("dead zone", "softens")),
        (lambda q: 90 * q**2, "stiffness", ("even",), ("softens", "hardens")),
        (lambda q: 90 * q - 20 * q**3, "stiffness", ("odd", "softens"), ("saturates",)),
        (lambda q: 9 * np.tanh(q / 0.2), "stiffness", ("saturates",), ("hardens",)),
        (lambda q: 90 * dead(q, 0.3), "stiffness", ("dead zone from -0.3",), ("hardens",)),
        (lambda q: 90 * np.maximum(q, 0), "stiffness", ("one side only, at positive",), ("odd, ",)),
        (lambda v: 9 * v, "damping", ("takes energy out", "nearly viscous"), ("feeds",)),
        (lambda v: 9 * np.tanh(v / 0.01), "damping", ("dry friction of 9",), ("viscous",)),
        (lambda v: 9 * v * np.abs(v), "damping", ("grows faster",), ("feeds",)),
        (lambda v: 20 * v**3 - 5 * v, "damping", ("feeds energy at speeds from -0.4",), ()),
        (lambda v: -9 * v, "damping", ("feeds energy at every speed",), ("takes",)),
    ],
)
def test_words_fit_the_curve(curve, over, said, unsaid):
    text = learned_law_of(curve, over=over).describe()
    for part in said:
        assert part in text, text
    for part in unsaid:
        assert part not in text, text


def test_a_surface_is_judged_by_its_energy():
    assert "takes energy out" in surface_of(lambda q, v: 50 * q + 3 * v).describe()
    text = surface_of(lambda q, v: 50 * q - 3 * v).describe()
    assert "feeds energy" in text
    assert "Force over displacement and velocity" in text


@pytest.mark.parametrize(
    ("curve", "said"),
    [
        (lambda t: 40 * t, "rises along the record: from 0"),
        (lambda t: -40 * t, "falls along the record"),
        (lambda t: 40 * np.sin(t), "goes up and down along the record"),
    ],
)
def test_what_varies_with_time_has_a_way(curve, said):
    text = learned_law_of(curve, low=0.0, high=8.0, over="varying_stiffness", share=1e-4).describe()
    assert text.startswith("Stiffness over time at x, ground, seen from 0 to 8 s: up to ")
    assert said in text


def test_warming_up_has_a_formula():
    law = learned_law_of(
        lambda t: 40 * (1 - np.exp(-t / 2)), low=0.0, high=8.0, over="varying_damping"
    )
    assert "aw*(1 - exp(-t/d)) with aw = 4" in law.describe()
    assert law.formula().numbers["d"] == pytest.approx(2.0, rel=0.1)


def test_the_curve_comes_with_its_band():
    law = learned_law_of(lambda q: 100 * q**3, count=12, share=0.01)
    shown = law.curve()
    true = 100 * shown["displacement"].values ** 3
    off = np.abs(shown["force"].values - true) / shown["stderr"].values
    assert np.mean(off < 2) > 0.9
    assert shown["force"].attrs["units"] == "N"
    assert shown["displacement"].attrs["units"] == "m"
    assert law.seen == {"displacement": (-1.1, 1.0)}
    assert law.over == "displacement"


def test_what_is_not_known_has_no_band():
    known = learned_law_of(lambda q: q, count=8)
    bare = rp.results.LearnedLaw(known.effect)
    assert np.isnan(bare.curve()["stderr"].values).all()
    assert len(bare.plot().collections) == 0
    # one coefficient that no data has seen spoils the band where it counts, and there only
    covariance = np.array(known.covariance)
    covariance[0, 0] = np.inf
    stderr = rp.results.LearnedLaw(known.effect, covariance).curve()["stderr"].values
    assert np.isinf(stderr[0])
    assert np.isfinite(stderr[-1])


def test_a_torque_over_an_angle_has_its_units():
    law = rp.results.LearnedLaw(learned_law_of(lambda q: 5 * q).effect, rotational=True)
    assert law.curve()["force"].attrs["units"] == "N m"
    assert law.plot().get_xlabel().startswith("displacement [")
    assert "rad" in law.plot().get_xlabel()
    assert "N m/rad" in str(law.formula())


def test_curves_and_surfaces_are_drawn():
    ax = learned_law_of(lambda v: 5 * v, over="damping").plot()
    assert ax.get_xlabel() == "velocity [m/s]"
    assert ax.get_ylabel() == "force [N]"
    assert len(ax.collections) == 1
    surface = surface_of(lambda q, v: 3 * q + 2 * v)
    assert surface.plot().get_ylabel() == "velocity [m/s]"
    shown = surface.curve(5)
    assert shown["force"].shape == (5, 5)
    wanted = 3 * shown["displacement"] + 2 * shown["velocity"]
    np.testing.assert_allclose(shown["force"], wanted, atol=0.1)


@pytest.mark.parametrize(
    ("over", "quantity", "unit"),
    [("varying_stiffness", "stiffness", "N/m"), ("varying_damping", "damping", "N s/m")],
)
def test_what_varies_is_a_curve_over_time(over, quantity, unit):
    law = learned_law_of(lambda t: 40 * t - 90, low=2.0, high=8.0, over=over)
    assert (law.over, law.quantity, law.unit) == ("time", quantity, unit)
    assert law.seen == {"time": (2.0, 8.0)}
    shown = law.curve(3)
    assert set(shown.data_vars) == {quantity, "stderr"}
    np.testing.assert_allclose(shown[quantity], [-10, 110, 230], atol=2)
    assert shown["time"].attrs["units"] == "s"
    ax = law.plot()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time [s]", f"{quantity} [{unit}]")
    formula = law.formula()
    assert formula.expression == "a0 + a1*t"
    assert formula.units == {"a0": unit, "a1": f"{unit}/s"}
    assert formula.numbers["a1"] == pytest.approx(40, rel=0.02)
    turning = rp.results.LearnedLaw(law.effect, rotational=True)
    assert turning.unit == unit.replace("N", "N m").replace("/m", "/rad")


def test_named_effects_are_refused():
    with pytest.raises(rp.InvalidInputError, match="a learned law"):
        rp.results.LearnedLaw(Effect("cubic_stiffness", "x", {"stiffness": 1.0}))
