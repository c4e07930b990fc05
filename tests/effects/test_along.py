"""Laws along a known motion."""

import numpy as np
import pytest

from robustpolish.machines.effects.effect import lookup
from robustpolish.machines.effects.evaluate import force_along, shapes_along
from robustpolish.machines.effects.kind import EffectKind, Motion, Parameter, Scan

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


def test_values_that_no_step_can_follow_give_a_force_all_the_same():
    force = along("attached_resonator", 1e-12, 1e12, 0.0)
    assert force.shape == TIME.shape
    assert np.isfinite(force[0])


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


def test_two_places_have_two_forces():
    motion = Motion(TIME, np.vstack([Q, 2 * Q]), np.vstack([V, 2 * V]), CONTEXT)
    kind = lookup("gyroscopic_coupling")
    force = force_along(kind, motion, np.ones(len(kind.parameters) + len(kind.context)))
    assert force.shape == (2, TIME.size)
    assert np.sum(force * motion.v, axis=0) == pytest.approx(0.0, abs=1e-12)  # it does no work


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


def test_what_slips_grows_with_the_coefficient():
    _, found = shapes("bouc_wen_hysteresis")
    told = [shape.values(np.array([3.0])) for shape in found]
    slips = [3.0 / values["stiffness"] for values in told]
    # 0.01 is less than half of what a sample travels
    expected = np.repeat([0.05, 0.15, 0.4, 0.8], 4) * np.percentile(abs(Q), 95)
    np.testing.assert_allclose(slips, expected)
    assert [values["exponent"] for values in told] == [1.0, 1.0, 2.0, 2.0] * 4
    assert [values["gamma"] for values in told] == [0.5, -0.5] * 8
    assert all(values["force"] == 3.0 for values in told)
    _, found = shapes("dahl_friction")
    told = [shape.values(np.array([3.0])) for shape in found]
    ways = np.array([0.03, 0.1, 0.3]) * np.percentile(abs(Q), 95)
    np.testing.assert_allclose([3.0 / values["stiffness"] for values in told], ways)


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


def test_a_kind_that_declares_no_candidates_has_none():
    kind = EffectKind("idle", "Idle", "pair", (Parameter("a", "F", "b"),), lookup("backlash").law)
    motion, _ = shapes("backlash")
    assert shapes_along(kind, motion) == []


def test_candidates_that_no_number_can_hold_are_left_out():
    def law(t, q, v, z, p, f, dz):
        f[0] = p[0] / (p[1] - q[0])

    parameters = (Parameter("strength", "F*L", "pull"), Parameter("distance", "L", "at rest"))
    scan = (Scan("distance", "1", (float(Q[100]), 1.0)),)
    kind = EffectKind("pole", "Pole", "pair", parameters, law, linear_in=("strength",), scan=scan)
    (shape,) = shapes_along(kind, Motion(TIME, Q[None], V[None]))
    assert shape.values(np.ones(1)) == {"strength": 1.0, "distance": 1.0}
