"""Kinds of effects, their laws along motions, and the damping that is equivalent to them."""

import copy
import math
import pickle
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from robustpolish.machines.effects import effect as catalogue
from robustpolish.machines.effects.effect import Effect, kinds, lookup, register, unregister
from robustpolish.machines.effects.evaluate import force_along, shapes_along
from robustpolish.machines.effects.kind import EffectKind, Motion, Parameter, Scan
from robustpolish.machines.effects.user_defined import own_kind
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import Damper, Dof, Output, Spring
from robustpolish.machines.simulation import simulate_model as simulate

# Laws along a known motion.
TIME = np.arange(3000) * 1e-3
Q, V = 1e-3 * np.sin(40 * TIME), 0.04 * np.cos(40 * TIME)
CONTEXT = {
    "spin_frequency": 0.0, "spring_stiffness": 0.0, "mobility": 0.0, "clearance": 0.0,
    "step": 1e-3,
}  # fmt: skip


def along(kind, *values, context=()):
    numbers = np.array([*values, *(CONTEXT[name] for name in lookup(kind).context)])
    return force_along(lookup(kind), Motion(TIME, Q[None], V[None], CONTEXT), numbers)[0]


def test_a_law_without_memory_is_its_formula():
    np.testing.assert_allclose(along("cubic_stiffness", 2e9), -2e9 * Q**3, rtol=1e-12)
    np.testing.assert_allclose(along("quadratic_damping", 5.0), -5.0 * V * abs(V), rtol=1e-12)


def test_an_attached_resonator_follows_its_equation_of_motion():
    """The internal states start at rest and are stepped finely between the samples."""
    mass, stiffness, damping = 0.02, 500.0, 0.3
    force = along("attached_resonator", mass, stiffness, damping)
    # a mass on a spring and a damper, moved at its foot: relative motion z'' = -... - q''
    fine = np.arange(2999 * 20 + 1) * 5e-5
    r, rate, expected = 0.0, 0.0, np.zeros(fine.size)
    for i, t in enumerate(fine):
        q, v = 1e-3 * np.sin(40 * t), 0.04 * np.cos(40 * t)
        expected[i] = stiffness * (r - q) + damping * (rate - v)
        rate += 5e-5 * -expected[i] / mass
        r += 5e-5 * rate
    scale = np.ptp(expected)
    np.testing.assert_allclose(force[200:], expected[::20][200:], atol=0.02 * scale)


FIRST = np.pi / 80 > TIME  # up to the first reversal


def test_dahl_friction_builds_up_and_turns_exponentially_over_the_way():
    """Dahl (1976): dz/dx = k (1 - z sign(v) / F), whatever the speed."""
    sliding, stiffness = 2.0, 4000.0
    way = sliding / stiffness
    force = along("dahl_friction", sliding, stiffness, 1.0)
    rising = sliding * (1 - np.exp(-Q / way))
    np.testing.assert_allclose(-force[FIRST], rising[FIRST], atol=2e-3 * sliding)
    back = (np.pi / 80 < TIME) & (3 * np.pi / 80 > TIME)
    top = sliding * (1 - np.exp(-1e-3 / way))
    falling = -sliding + (top + sliding) * np.exp(-(1e-3 - Q) / way)
    np.testing.assert_allclose(-force[back], falling[back], atol=2e-3 * sliding)
    # over a way far below what a sample covers it is Coulomb friction, and no number overflows
    sharp = along("dahl_friction", sliding, 1e12, 1.0)
    moving = (abs(V) > 0.02) & (TIME > 0.01)
    np.testing.assert_allclose(sharp[moving], -sliding * np.sign(V[moving]), rtol=1e-2)


def test_behind_a_clearance_dahl_friction_is_nothing_over_the_way_through_it():
    sliding, stiffness, gap = 2.0, 4e5, 2e-4
    motion, kind = Motion(TIME, Q[None], V[None], CONTEXT), lookup("dahl_friction")
    numbers = np.array([sliding, stiffness, 1.0, gap, CONTEXT["step"]])
    force = force_along(kind, motion, numbers)
    back = (np.pi / 80 < TIME) & (3 * np.pi / 80 > TIME)
    free = TIME[back][abs(force[0, back]) < 1e-9]
    way = np.ptp(1e-3 * np.sin(40 * free))
    assert way == pytest.approx(2 * gap, abs=2 * 4e-5)  # a sample covers 0.04 mm at most
    # beyond it the force builds up as it does without
    plain = along("dahl_friction", sliding, stiffness, 1.0)
    late = back & (Q < -5e-4)
    np.testing.assert_allclose(force[0, late], plain[late], rtol=1e-3)
    # and beside the clearance it is nothing else
    numbers[2] = 0.0
    np.testing.assert_array_equal(force_along(kind, motion, numbers)[0], plain)


def test_bouc_wen_loops_that_stiffen_follow_their_formula():
    """With exponent 1 and s = -(beta + gamma) > 0, loading is dz/dx = k (1 + s z / F)."""
    reference, stiffness, beta, gamma = 2.0, 4000.0, 0.2, -0.7
    force = along("bouc_wen_hysteresis", reference, stiffness, 1.0, beta, gamma)
    assert np.isfinite(force).all()
    s = -(beta + gamma)
    rising = reference / s * np.expm1(stiffness * s * Q / reference)
    np.testing.assert_allclose(-force[FIRST], rising[FIRST], rtol=5e-3, atol=1e-3)
    # the secant grows with amplitude: nothing yields
    assert -force[FIRST][-1] > 1.2 * stiffness * Q[FIRST][-1]
    later = TIME > 2.0
    assert np.sum((force * V)[later]) < 0  # and yet it takes energy


def shapes(name, **context):
    motion = Motion(TIME, Q[None], V[None], {**CONTEXT, **context}, force=np.cos(300 * TIME)[None])
    return motion, shapes_along(lookup(name), motion)


@pytest.mark.parametrize(
    ("name", "parameter", "column", "sign"),
    [
        ("cubic_stiffness", "stiffness", -(Q**3), 0),
        ("quadratic_stiffness", "stiffness", -(Q**2), 0),
        ("quadratic_damping", "coefficient", -V * abs(V), 1),
        ("displacement_dependent_damping", "coefficient", -(Q**2) * V, 1),
        ("pendulum_gravity", "moment", -np.sin(Q), 1),
        ("constant_force", "force", np.ones(Q.size), 0),
        ("coulomb_friction", "force", -np.tanh(V / (0.02 * np.percentile(abs(V), 95))), 1),
        ("input_gain", "gain", Q, 0),
        ("sensor_offset", "offset", np.ones(Q.size), 0),
    ],
)
def test_a_kind_of_one_coefficient_is_tried_with_a_unit_of_it(name, parameter, column, sign):
    _, (shape,) = shapes(name)
    np.testing.assert_allclose(shape.columns[0, 0], column, rtol=1e-9, atol=1e-15)
    assert shape.signs == (sign,)
    default = lookup(name).parameter(parameter).default
    assert shape.values(np.array([2.5])) == {parameter: default + 2.5}


def test_stribeck_friction_is_tried_as_sliding_friction_and_what_is_more_at_rest():
    motion, found = shapes("stribeck_friction")
    for shape, share in zip(found, (0.06, 0.15, 0.4), strict=True):
        velocity = share * motion.speed
        direction = np.tanh(V / (0.02 * motion.speed))
        columns = [-direction, -direction * np.exp(-((V / velocity) ** 2))]
        np.testing.assert_allclose(shape.columns[:, 0], columns, atol=1e-12)
        assert shape.signs == (1, 1)
        told = shape.values(np.array([2.0, 0.5]))
        assert told == {"force": 2.0, "static_force": 2.5, "velocity": velocity}


def test_a_clearance_and_stops_are_tried_at_shares_of_the_motion():
    motion, found = shapes("backlash", spring_stiffness=700.0)
    assert len(found) == 5
    for shape in found:
        gap = shape.values(np.array([1.3]))["gap"]
        np.testing.assert_allclose(shape.columns[0, 0], 700.0 * np.clip(Q, -gap, gap))
    assert found[0].values(np.array([1.0])) == {"gap": pytest.approx(0.06 * motion.amplitude)}
    assert shapes("backlash")[1] == []  # without a spring there is nothing to have it
    for shape in shapes("contact_stop")[1]:
        gap = shape.values(np.array([9.0]))["gap"]
        depth = np.maximum(Q - gap, 0.0) if gap >= 0 else np.minimum(Q - gap, 0.0)
        np.testing.assert_allclose(shape.columns[0, 0], -depth)


@pytest.mark.parametrize(
    ("name", "omega", "carried"),
    [("parametric_stiffness", 90.0, -Q), ("harmonic_force", None, np.ones(Q.size))],
)
def test_a_phase_is_tried_as_two_columns(name, omega, carried):
    _, found = shapes(name, spin_frequency=90.0)
    c = np.array([0.3, -1.2])
    told = found[0].values(c)
    turn = omega or 2 * np.pi * told["frequency"]
    force = told["amplitude"] * np.cos(turn * TIME + told["phase"]) * carried
    np.testing.assert_allclose(np.tensordot(c, found[0].columns[:, 0], 1), force, atol=1e-12)
    assert shapes("parametric_stiffness")[1] == []  # nothing spins


def test_candidates_that_no_number_can_hold_are_left_out():
    def law(t, q, v, z, p, f, dz):
        f[0] = p[0] / (p[1] - q[0])

    parameters = (Parameter("strength", "F*L", "pull"), Parameter("distance", "L", "at rest"))
    scan = (Scan("distance", "1", (float(Q[100]), 1.0)),)
    kind = EffectKind("pole", "Pole", "pair", parameters, law, linear_in=("strength",), scan=scan)
    (shape,) = shapes_along(kind, Motion(TIME, Q[None], V[None]))
    assert shape.values(np.ones(1)) == {"strength": 1.0, "distance": 1.0}


# Laws as machine code, called by address.


# Motions and candidate forces.
TIME_SHAPES = np.arange(1000) * 1e-3
MOTION = Motion(TIME_SHAPES, np.linspace(-2.0, 2.0, 1000)[None], np.full((1, 1000), -3.0))


def test_slips_shorter_than_half_a_sample_s_travel_are_left_out():
    least = 0.5 * 3.0 * 1e-3 / MOTION.amplitude
    found = Scan("stiffness", "per slip", (0.9 * least, 1.1 * least, 0.5)).values(MOTION)
    slips = np.array([1.1 * least * MOTION.amplitude, 0.5 * MOTION.amplitude])
    np.testing.assert_allclose(found, 1 / slips)


def test_a_scan_finds_the_lines_of_the_force():
    lines = Scan("frequency", "line of the force", (0, 1))
    assert lines.values(MOTION) == []
    force = np.cos(2 * np.pi * 50 * TIME_SHAPES) + 3 * np.cos(2 * np.pi * 120.25 * TIME_SHAPES)
    assert lines.values(replace(MOTION, force=force[None])) == pytest.approx(
        [120.25, 50.0], abs=0.3
    )


def test_a_line_is_what_stands_out_and_not_what_drifts():
    """A force smoothed from an accelerometer: a wander far larger than the line on it."""
    drift = np.cumsum(np.random.default_rng(0).standard_normal(TIME_SHAPES.size))
    force = np.cos(2 * np.pi * 120.25 * TIME_SHAPES) + 10 * (drift - drift.mean()) / drift.std()
    found = Scan("frequency", "line of the force", (0,)).values(replace(MOTION, force=force[None]))
    assert found == pytest.approx([120.25], abs=0.3)


# What a kind of effect has to have, and what a linear model keeps of it.
FACTOR = (Parameter("factor", "1", "true over measured", default=1.0),)


def scaled(u, time, values):
    return values["factor"] * u


def law(t, q, v, z, p, f, dz):
    f[0] = -p[0] * q[0]


@pytest.mark.parametrize(
    ("domain", "functions", "said"),
    [("input", {}, "neither law nor on_signal"), ("output", {}, "neither law nor on_signal"),
     ("input", {"law": law}, "with law"), ("pair", {}, r"lost\.law"),
     ("pair", {"law": law, "on_signal": scaled}, "on_signal"),
     ("nowhere", {"law": law}, "domain")],
)  # fmt: skip
def test_a_kind_acts_by_its_law_or_on_signals(domain, functions, said):
    with pytest.raises(InvalidInputError, match=said) as caught:
        EffectKind("lost", "Lost", domain, FACTOR, **functions)
    assert caught.value.key[0] == "lost"


def test_the_linear_part_is_the_answer_to_a_step_if_nothing_else_is_said():
    kind = EffectKind("scaled", "Scaled", "input", FACTOR, on_signal=scaled)
    assert kind.signal_slope({"factor": 2.5}) == (2.5, 0.0, 0.0)
    told = replace(kind, linear_signal=lambda values: (values["factor"], 0.25))
    slope = told.signal_slope({"factor": 2.5})
    assert (slope.gain, slope.delay, slope.lag) == (2.5, 0.25, 0.0)


def test_a_signal_of_another_length_is_refused(monkeypatch):
    monkeypatch.setattr(catalogue, "_registered", {})
    register(EffectKind("cut", "Cut", "input", FACTOR, on_signal=lambda u, t, values: u[1:]))
    with pytest.raises(InvalidInputError, match="like the signal"):
        Effect("cut", "F").on_signal(np.ones(5), np.arange(5.0))


@pytest.mark.parametrize(
    ("name", "values", "expected"),
    [
        ("cubic_stiffness", {"stiffness": -2.0}, (3 * 2.0 * 0.3**2, 0.0, 0.0)),
        ("quadratic_stiffness", {"stiffness": 2.0}, (2 * 2.0 * 0.3, 0.0, 0.0)),
        ("quadratic_damping", {"coefficient": 2.0}, (0.0, 2 * 2.0 * 5.0, 0.0)),
        (
            "displacement_dependent_damping",
            {"coefficient": 2.0},
            (2 * 2.0 * 0.3 * 5.0, 2.0 * 0.3**2, 0.0),
        ),
        ("contact_stop", {"stiffness": 7.0, "gap": 0.1}, (7.0, 0.0, 0.0)),
        ("gyroscopic_coupling", {"coefficient": -7.0}, (0.0, 7.0, 0.0)),
        ("cross_stiffness", {"stiffness_xy": 2.0, "stiffness_yx": -7.0}, (7.0, 0.0, 0.0)),
        ("constant_force", {"force": 7.0}, (0.0, 0.0, 0.0)),
        ("unbalance", {"unbalance": 7.0}, (0.0, 0.0, 0.0)),
    ],
)
def test_the_units_tell_how_steep_a_power_law_is(name, values, expected):
    kind = lookup(name)
    full = {p.name: p.default for p in kind.parameters} | values
    assert kind.steepness(full, 0.3, 5.0) == pytest.approx(expected)


def test_powers_need_not_be_whole_and_other_units_stay():
    contact = Parameter("stiffness", "F/L^1.5", "of a ball on a plane")
    assert contact.unit() == "N/m^1.5"
    assert contact.unit(rotational=True) == "N m/rad^1.5"
    assert contact.powers == {"F": 1, "L": -1.5, "T": 0, "M": 0}
    assert contact.slopes(2.0, q=4.0, v=1.0) == (6.0, 0.0)
    assert Parameter("root", "F/L^0.5", "").slopes(2.0, q=0.0, v=0.0) == (0.0, 0.0)
    pressed = Parameter("gain", "F*T/L/MPa", "damping by pressure")
    assert pressed.unit() == "N s/m/MPa"
    assert pressed.powers == {"F": 1, "L": -1, "T": 1, "M": 0}


# A kind at a place with numbers.


@pytest.mark.parametrize(
    ("given", "key"),
    [(("coulomb_friktion", ("x",)), ("effect", "kind")),
     (("gyroscopic_coupling", ("x",)), ("gyroscopic_coupling", "at")),
     (("coulomb_friction", ("x",), {"force": "much"}),
      ("coulomb_friction", "parameters", "force"))],
)  # fmt: skip
def test_errors_carry_keys(given, key):
    with pytest.raises(InvalidInputError) as caught:
        Effect(*given)
    assert caught.value.key == key


def test_effects_change_their_values_travel_and_are_copied():
    friction = Effect("coulomb_friction", "x", {"force": 3.0, "width": 1e-3})
    assert friction.with_parameters(force=4.0).parameters == {"force": 4.0, "width": 1e-3}
    assert friction.with_values({"force": 4.0}).parameters == {"force": 4.0}
    assert friction.with_values({}).at == ("x", "ground")
    assert pickle.loads(pickle.dumps(friction)) == friction
    assert copy.deepcopy(friction) == friction
    with pytest.raises(InvalidInputError, match="input or output"):
        friction.on_signal(np.ones(3), np.arange(3.0))


def test_users_add_a_kind(monkeypatch):
    monkeypatch.setattr(catalogue, "_registered", {})

    def law(t, q, v, z, p, f, dz):
        f[0] = -p[0] * q[0] ** 5

    kind = EffectKind(
        "fifth_power", "Fifth power", "pair", (Parameter("stiffness", "F/L^5", "coefficient"),), law
    )
    assert register(kind) is lookup("fifth_power")
    along = Motion(TIME, Q[None], V[None])
    np.testing.assert_allclose(force_along(kind, along, np.array([2.0])), -2 * along.q**5)
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


# Every built-in kind: its explanation, its shapes, its energy.
NAMED = [name for name in kinds() if name != "input_hold"]


def motion(kind):
    time = TIME[:1500]
    q = np.vstack([np.sin(40 * time) * 1e-3, np.cos(31 * time) * 1e-3])[: kind.ports]
    known = {**CONTEXT, "spin_frequency": 100.0, "spring_stiffness": 1e4, "derivative": 1.0}
    return Motion(time, q, np.gradient(q, 1e-3, axis=1), known, force=q)


def test_every_kind_explains_itself_and_can_be_pickled():
    for kind in kinds().values():
        assert pickle.loads(pickle.dumps(kind)) == kind
        assert kind.looks_like
        assert kind.checks
        assert kind.references
        assert all(p.meaning and p.lower < p.upper for p in kind.parameters)


@pytest.mark.parametrize("name", [n for n in NAMED if lookup(n).law is not None])
def test_a_shape_is_the_law_with_its_values(name):
    kind = lookup(name)
    along = motion(kind)
    for shape in shapes_along(kind, along)[:4]:
        unit = np.zeros(len(shape.signs))
        unit[0] = 1.0
        values = Effect(name, ("x", "y")[: kind.places], shape.values(unit)).values
        p = [*values.values(), *(along.context[c] for c in kind.context)]
        if name == "backlash":
            p[1] = 1e4
        force = force_along(kind, along, np.array(p))
        assert np.isfinite(force).all()
        wanted = shape.columns[0]
        moving = np.abs(along.v[0]) > 0.2 * along.speed  # a shape rounds the corners of friction
        close = np.abs(force - wanted)[:, moving] <= 1e-2 * np.max(np.abs(wanted))
        assert np.mean(close) > 0.97


@pytest.mark.parametrize("name", [n for n in NAMED if lookup(n).family == "dry friction"])
def test_friction_takes_energy_out(name):
    along = motion(lookup(name))
    for shape in shapes_along(lookup(name), along):
        assert np.sum(shape.columns[0] * along.v) < 0


@pytest.mark.parametrize(
    ("name", "values", "slope"),
    [
        ("input_gain", {"gain": 3.0}, (3.0, 0.0, 0.0)),
        ("input_delay", {"delay": 0.02}, (1.0, 0.02, 0.0)),
        ("input_lag", {"lag": 0.02}, (1.0, 0.0, 0.02)),
        ("input_hold", {"order": 0.0}, (1.0, 0.0, 0.0)),
        ("input_hold", {"order": 3.0}, (1.0, 0.0, 0.0)),
        ("sensor_gain", {"gain": 0.5}, (0.5, 0.0, 0.0)),
        ("sensor_offset", {"offset": 1e6}, (1.0, 0.0, 0.0)),
    ],
)
def test_the_linear_part_of_a_signal_effect_is_its_answer_to_a_slow_signal(name, values, slope):
    kind = lookup(name)
    assert kind.signal_slope(values) == slope
    gain, delay, lag = slope
    time = np.arange(4000) * 1e-3
    signal = np.sin(time)
    effect = Effect(name, ("x",), values)
    changed = effect.on_signal(signal, time) - effect.on_signal(0 * signal, time)
    late = np.maximum(time - delay, 0.0)
    began = lag / (1 + lag**2) * np.exp(-late / lag) if lag else 0.0
    expected = gain * ((np.sin(late) - lag * np.cos(late)) / (1 + lag**2) + began)
    # a hold delays by half a sample
    np.testing.assert_allclose(changed[5:-5], expected[5:-5], atol=6e-4)


@pytest.mark.parametrize(
    ("name", "values", "acting"),
    [
        ("input_saturation", {"limit": 2.0}, [-2.0, -1.0, 0.0, 2.0]),
        ("input_saturation", {}, [-3.0, -1.0, 0.0, 2.5]),
        ("input_dead_zone", {"width": 1.5}, [-1.5, 0.0, 0.0, 1.0]),
    ],
)
def test_what_an_actuator_makes_of_its_commands(name, values, acting):
    time, asked = np.arange(4.0), np.array([-3.0, -1.0, 0.0, 2.5])
    assert Effect(name, "F", values).on_signal(asked, time).tolist() == acting
    assert lookup(name).signal_slope(values) == (1.0, 0.0, 0.0)


@pytest.mark.parametrize("name", ["input_saturation", "input_dead_zone"])
def test_candidates_for_actuators_are_what_their_numbers_do(name):
    along = motion(lookup(name))
    shapes = shapes_along(lookup(name), along)
    assert len(shapes) > 3
    for shape in shapes:
        acting = Effect(name, "F", shape.values(np.ones(1))).on_signal(along.q[0], along.time)
        np.testing.assert_allclose(shape.columns[0, 0], acting - along.q[0], atol=1e-12)
        assert shape.values(np.zeros(1)) != shape.values(np.ones(1))
    still = replace(along, q=0 * along.q)
    assert shapes_along(lookup(name), still) == []


def test_friction_parameters_know_their_limits_in_a_fit():
    stribeck, stop = lookup("stribeck_friction"), lookup("contact_stop")
    values = {"force": 2.0, "static_force": 3.0, "velocity": 0.1, "width": 0.0}
    for name in ("stribeck_friction", "lugre_friction"):
        static = lookup(name).parameter("static_force")
        assert static.bounds_from(values) == (0.0, np.inf)
        assert static.at_least == "force"  # which moves too: no number bounds it
        assert lookup(name).implausible({**values, "static_force": 1.99}) is not None
        assert lookup(name).implausible({**values, "static_force": 2.0}) is None
    assert stribeck.parameter("velocity").bounds_from(values) == (0.1 * 0.2, 0.1 * 6)
    assert stop.parameter("gap").bounds_from({"gap": 1e-3, "stiffness": 1.0}) == (0.0, np.inf)
    assert stop.parameter("gap").bounds_from({"gap": -1e-3, "stiffness": 1.0}) == (-np.inf, 0.0)
    assert lookup("harmonic_force").parameter("phase").scale_from(3.0) == 1.0


def test_loops_that_feed_the_motion_are_no_hysteresis():
    kind = lookup("bouc_wen_hysteresis")
    values = {"force": 1.0, "stiffness": 5.0, "exponent": 1.0, "beta": 0.5, "gamma": -0.9}
    assert kind.implausible(values) is None
    assert "feed energy" in str(kind.implausible({**values, "beta": -0.1}))
    assert [p.name for p in kind.parameters if not p.fitted] == ["force"]  # beta and gamma say it


@pytest.mark.parametrize("stiffness", [500.0, 2000.0, 8000.0])
def test_a_slider_behind_a_spring_slips_right_in_rough_steps(stiffness):
    """What a step overshoots slides back, but not beyond its end, where the slider would stick."""
    at, time = ("x", "ground"), 0.004 * np.arange(1000)
    spring, damper, output = Spring(at, 4000.0), Damper(at, 1.0), Output("x", at)
    model = MechanicalModel((Dof("x", 1.0),), (spring,), (damper,), (), (output,))
    values = {"force": 0.5, "stiffness": stiffness}
    model = model.with_effect("elastic_coulomb_friction", at, values)
    about = xr.Dataset({"x": ("time", 0.02 * np.cos(63 * time))}, {"time": time})
    fine, rough = (
        simulate(model, about, [0.02, 0.0], substeps=steps).outputs for steps in (64, None)
    )
    assert np.std(rough - fine) < 1e-3 * np.std(fine)


A, W = 0.01, 120.0


@pytest.mark.parametrize(
    ("kind", "values", "closed"),
    [
        ("coulomb_friction", {"force": 3.0}, 4 * 3.0 * A),
        ("quadratic_damping", {"coefficient": 2.0}, 8 / 3 * 2.0 * W**2 * A**3),
        ("structural_damping", {"loss": 5.0}, 2 * 5.0 * A**2),
        ("displacement_dependent_damping", {"coefficient": 7.0}, math.pi / 4 * 7.0 * W * A**4),
        ("cubic_stiffness", {"stiffness": 1e6}, 0.0),
        ("constant_force", {"force": 3.0}, 0.0),
    ],
)
def test_energies_have_their_closed_form(kind, values, closed):
    lost = rp.effects.energy_per_cycle(Effect(kind, "x", values), A, W)
    assert lost == pytest.approx(closed, rel=1e-6, abs=1e-12)


def test_a_spring_in_series_with_friction_loses_what_its_loop_encloses():
    """Elastic friction, fully developed: a parallelogram of 4 F (A - F/k)."""
    effect = Effect("elastic_coulomb_friction", "x", {"force": 3.0, "stiffness": 1e3})
    assert rp.effects.energy_per_cycle(effect, A, W) == pytest.approx(
        4 * 3.0 * (A - 3.0 / 1e3), rel=2e-3
    )


def test_losses_add_up_to_one_damper():
    air = Effect("quadratic_damping", "x", {"coefficient": 2.0})
    c = rp.effects.equivalent_damping([air, 0.25], A, W)
    # A damper of this size loses as much: pi c w A^2.
    assert math.pi * c * W * A**2 == pytest.approx(8 / 3 * 2.0 * W**2 * A**3 + 0.25, rel=1e-6)
    assert rp.effects.equivalent_damping(0.0, A, W) == 0.0
    alone = rp.effects.equivalent_damping(0.25, A, W)
    assert rp.effects.equivalent_damping(np.float64(0.25), A, W) == alone


def test_a_share_of_the_energy_is_the_published_damping():
    """(8.23) with table 9.1: c_A, c_D and c_R; (5.7) with any amplitude is the same."""
    p, n, share = rp.polishing.AirBearingParameters(), 0.001, rp.effects.share_damping
    found = p.natural_frequencies()
    assert share(n, p.k_t, found["x"][0]) == pytest.approx(1.3159, abs=5e-5)
    assert share(n, p.k_x, found["x"][1]) == pytest.approx(0.0389, abs=5e-5)
    assert share(n, p.k_z, found["z_free"][0]) == pytest.approx(0.5581, abs=5e-5)
    for amplitude in (1e-6, 1e-3):
        c = rp.effects.equivalent_damping(n * p.k_x * amplitude**2 / 2, amplitude, found["x"][1])
        assert c == pytest.approx(share(n, p.k_x, found["x"][1]))
    # n = 2 pi eta, and a body on the spring has the ratio n / (4 pi) = eta / 2.
    k, m, n = 3e5, 0.2, 0.01
    w = math.sqrt(k / m)
    assert share(n, k, w) == pytest.approx(rp.effects.loss_damping(n / (2 * math.pi), k, w))
    assert share(n, k, w) / (2 * math.sqrt(k * m)) == pytest.approx(n / (4 * math.pi))


@pytest.mark.parametrize("size", [1.0, 1e-3])
def test_structural_damping_as_a_force_decays_as_its_loss_factor_says(size):
    """Free decay: a logarithmic decrement of about pi eta, at every amplitude."""
    eta, k = 0.02, 4e2
    model = rp.MechanicalModel(
        [rp.Dof("x", 1.0)],
        [rp.Spring(("x", "ground"), k)],
        outputs=[rp.Output("x", ("x", "ground"))],
    ).with_effect("structural_damping", ("x", "ground"), {"loss": math.pi / 2 * eta * k})
    period, cycles = 2 * math.pi / math.sqrt(k), 10
    data = xr.Dataset(coords={"time": np.linspace(0, cycles * period, 200 * cycles + 1)})
    x = simulate(model, data, initial_state=[size, 0.0]).outputs[:, 0]
    ends = x[::200][[0, -1]] / size
    # Over half a swing the spring is k + h, then k - h: amplitudes are as (1 - h/k) / (1 + h/k).
    h = math.pi / 2 * eta
    assert ends[1] == pytest.approx(((1 - h) / (1 + h)) ** cycles, rel=0.01)
    assert -math.log(ends[1]) / cycles == pytest.approx(math.pi * eta, rel=0.01)


@pytest.mark.parametrize(
    ("name", "given", "key"),
    [("energy_per_cycle", ("friction", A, W), "effect"),
     ("energy_per_cycle", (Effect("input_gain", "F"), A, W), "effect"),
     ("energy_per_cycle", (Effect("cross_stiffness", ("x", "y")), A, W), "effect"),
     ("energy_per_cycle", (Effect("harmonic_force", "x"), A, W), "effect"),
     ("energy_per_cycle", (Effect("coulomb_friction", "x"), 0.0, W), "amplitude"),
     ("equivalent_damping", (1.0, A, 0.0), "frequency"),
     ("equivalent_damping", (-1.0, A, W), "losses"),
     ("equivalent_damping", ({"a": 1.0}, A, W), "losses"),
     ("share_damping", (-0.1, 1.0, W), "share"), ("loss_damping", (0.1, -1.0, W), "stiffness")],
)  # fmt: skip
def test_what_has_no_equivalent_is_refused(name, given, key):
    with pytest.raises(InvalidInputError) as caught:
        getattr(rp.effects, name)(*given)
    assert caught.value.key[0] == key


# No effect is silently idle: in a machine without springs and spin it acts, or it is refused.


@pytest.mark.parametrize("name", [n for n, k in kinds().items() if k.law is not None])
def test_an_effect_acts_or_is_refused(name):
    kind, ground = kinds()[name], "ground"
    bare = rp.MechanicalModel(
        [rp.Dof("x", 1.0), rp.Dof("y", 2.0)], [],
        [rp.Damper(("x", ground), 0.1), rp.Damper(("y", ground), 0.1)],
        [rp.Input("F", ("x", ground))], [rp.Output("px", ("x", ground))],
    )  # fmt: skip
    values = {
        p.name: float(np.clip(p.default or (0.3 if p.upper > 0 else -0.3), p.lower, p.upper))
        for p in kind.parameters
    }
    at = {"pair": ("x", ground), "axes": ("x", "y"), "path": ("F", "px")}.get(kind.domain, ("x",))
    time = np.arange(400) * 0.01
    data = rp.read_measurement(pd.DataFrame({"time": time, "F": 5 * np.sin(3 * time)}))
    for machine, needed in (
        (bare, kind.idle_without),
        (replace(bare, springs=(rp.Spring(("x", ground), 8.0),), spin_frequency=1.0), ""),
    ):
        if needed:
            with pytest.raises(InvalidInputError, match=f"{name}.at.*does nothing"):
                machine.with_effect(name, at, values)
            continue
        runs = [
            simulate(m, data, initial_state=[0.4, 0.3, 0.2, -0.2]).outputs
            for m in (machine, machine.with_effect(name, at, values))
        ]
        assert np.abs(runs[1] - runs[0]).max() > 1e-4


# Forces along the way, modes that sensors see with signs, and what drifts.


@pytest.mark.parametrize("quantity", ["displacement", "velocity", "acceleration"])
def test_a_parallel_mode_is_a_second_mass_that_the_sensor_sees_against_the_first(quantity):
    first = [rp.Spring(("x", "ground"), 800.0)], [rp.Damper(("x", "ground"), 2.0)]
    alone = rp.MechanicalModel(
        [rp.Dof("x", 2.0)], *first, [rp.Input("F", "x")], [rp.Output("y", "x", quantity)]
    )
    w, share, mass = 2 * np.pi * 5.0, 0.02, 4.0
    values = {"gain": -1 / mass, "frequency": 5.0, "damping": share}
    seen = alone.with_effect("parallel_mode", ("F", "y"), values)
    pair = replace(
        alone,
        dofs=(*alone.dofs, rp.Dof("z", mass)),
        springs=(*alone.springs, rp.Spring(("z", "ground"), mass * w**2)),
        dampers=(*alone.dampers, rp.Damper(("z", "ground"), 2 * share * w * mass)),
        inputs=(rp.Input("F", ("x", "z")),),
        outputs=(rp.Output("y", ("x", "z"), quantity, weights=(1.0, 1.0)),),
    )
    f = np.array([0.3, 2.9, 4.9, 5.2, 20.0])
    by_effect, by_mass = (m.frequency_response(f).values for m in (seen, pair))
    assert np.allclose(by_effect, by_mass, rtol=1e-8)
    time = np.arange(1000) * 0.005
    data = xr.Dataset({"F": ("time", np.sin(9 * time))}, {"time": time})
    by_effect, by_mass = (simulate(m, data).outputs for m in (seen, pair))
    assert np.allclose(by_effect, by_mass, atol=1e-4 * np.ptp(by_mass))
    assert rp.MechanicalModel.from_toml(seen.to_toml()) == seen
    with pytest.raises(InvalidInputError, match="seen against the others acts there"):
        alone.with_effect("parallel_mode", ("y", "F"))


def test_cogging_holds_a_mass_where_its_wave_pulls_back():
    """About a place where the force is 0 and falls it is a spring of 2 pi F / period."""
    model = rp.MechanicalModel([rp.Dof("x", 2.0)], outputs=[rp.Output("x", "x")])
    wave = {"force": 3.0, "period": 0.01, "phase": np.pi / 2}
    A = model.with_effect("cogging", "x", wave).linearize().A
    assert -2.0 * A[1, 0] == pytest.approx(2 * np.pi * 3.0 / 0.01, rel=1e-6)


def test_a_guide_pulls_like_a_spring_and_rubs_more_at_one_end():
    at = ("x", "ground")
    model = rp.MechanicalModel([rp.Dof("x", 2.0)], outputs=[rp.Output("x", "x")])
    held = model.with_effect("guide_spring", at, {"stiffness": 50.0})
    sprung = replace(model, springs=(rp.Spring(at, 50.0),))
    time = np.arange(3000) * 1e-3
    data = xr.Dataset(coords={"time": time})
    runs = [simulate(m, data, initial_state=[0.1, 0.0]).outputs for m in (held, sprung)]
    assert np.allclose(*runs, atol=1e-7)
    # m v dv = -(F + s x) dx on the way out
    rubbed = model.with_effect("position_dependent_friction", at, {"force": 1.0, "slope": 4.0})
    x = simulate(rubbed, data, initial_state=[0.0, 1.0]).outputs[:, 0]
    stop = (-1.0 + np.sqrt(1.0 + 4.0 * 2.0 * 1.0)) / 4.0
    assert x[-1] == pytest.approx(stop, rel=1e-3)


def test_a_sensor_drifts_to_its_warm_value():
    drift = Effect("sensor_drift", "x", {"drift": 0.4, "time": 2.0})
    time = np.array([0.0, 2.0, 100.0])
    shown = drift.on_signal(np.ones(3), time)
    assert np.allclose(shown, [1.0, 1.4 - 0.4 * np.exp(-1), 1.4])
