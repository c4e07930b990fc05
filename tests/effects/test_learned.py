"""Learned kinds: what their names code, their curves, and a model that holds one."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import BSpline

import robustpolish as rp
from robustpolish.machines.effects.effect import Effect, kinds, lookup, register
from robustpolish.machines.effects.evaluate import force_along, shapes_along
from robustpolish.machines.effects.kind import Motion
from robustpolish.machines.effects.spline_law import (
    coefficients_of,
    learned_kind,
    learned_name,
    second_differences,
    smoothness_prior,
    spline_basis,
    spline_centres,
)
from tests.identification.oscillators import PLACE, oscillator, record

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
    [
        ("learned_stiffness_9", "Learned law over displacement"),
        ("learned_damping_25", "Learned law over velocity"),
        ("learned_force_7x7", "Learned law over displacement and velocity"),
        ("learned_varying_stiffness_9", "Learned stiffness over time"),
        ("learned_varying_damping_25", "Learned damping over time"),
    ],
)
def test_a_name_codes_a_kind(name, title):
    kind = lookup(name)
    assert kind.kind == name
    assert kind.title == title
    assert kind is learned_kind(name)
    assert pickle.loads(pickle.dumps(kind)) == kind
    assert sum(p.fitted for p in kind.parameters) == {"9": 9, "5": 25, "7": 49}[name[-1]]
    assert kind.looks_like
    assert kind.checks
    assert kind.references


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
    assert kind.gains(values, 1.0, 1.0) == (35.0 * along[0], 35.0 * along[1], 0.0)
    assert (kind.parameters[0].unit(), kind.parameters[-1].unit()) == ("s", unit)


def test_no_learned_law_is_named_like_an_effect_of_the_catalogue():
    assert not any(learned_kind(name) for name in kinds())
    assert learned_name("damping", 8) not in kinds()
    taken = lookup("cubic_stiffness")
    with pytest.raises(rp.InvalidInputError, match="not taken"):
        register(replace(taken, kind="learned_stiffness_9"))


def test_no_screening_tries_one():
    time = np.arange(100) * 1e-2
    motion = Motion(time, np.sin(time)[None], np.cos(time)[None])
    assert shapes_along(lookup("learned_stiffness_9"), motion) == []


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


def test_a_line_does_not_bend_and_has_no_price():
    line = spline_centres(-2.0, 1.0, 8)
    assert np.abs(second_differences(8) @ line).max() < 1e-12
    values = Effect("learned_stiffness_8", "x", named(line, **KNOTS, roughness=0.1)).values
    assert np.abs(smoothness_prior(values) @ line).max() < 1e-10
    assert smoothness_prior(values).shape == (6, 8)
    assert smoothness_prior({**values, "roughness": 0.0}).shape == (0, 8)
    plane = np.add.outer(spline_centres(-2.0, 1.0, 6), 3 * spline_centres(-5.0, 5.0, 6))
    whole = named(plane, **KNOTS, slow=-5.0, fast=5.0, roughness=0.1)
    values = Effect("learned_force_6x6", "x", whole).values
    assert np.abs(smoothness_prior(values) @ plane.ravel()).max() < 1e-9
    np.testing.assert_allclose(coefficients_of(values), plane)


def test_its_steepest_slope_is_known():
    values = Effect("learned_stiffness_8", "x", named(5 * spline_centres(-2, 1, 8), **KNOTS)).values
    assert lookup("learned_stiffness_8").steepness(values, 1.0, 1.0) == pytest.approx((5, 0, 0))
    assert lookup("learned_damping_8").steepness(values, 1.0, 1.0) == pytest.approx((0, 5, 0))
    # all coefficients are counted in one size, those that are nearly zero too
    kind = lookup("learned_stiffness_8")
    values |= {"c3": 1e-12}
    assert kind.parameter("c3").scale_from(1e-12, values) == max(abs(values[f"c{j}"]) for j in
                                                                  range(1, 9))  # fmt: skip


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
