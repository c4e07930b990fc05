"""Learned curves beside the true force."""

from dataclasses import replace

import numpy as np
import pytest

from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.effects.learned_law import LearnedLaw
from robustpolish.machines.effects.spline_law import spline_basis
from tests.hidden_effects.cases import Case, model_of, one, two
from tests.hidden_effects.curves import curve_shares, static_force
from tests.hidden_effects.made_up import diagnosis_of

X = ("x", "ground")


def law_of(over, at, low, high, force):
    grid = np.linspace(low, high, 400)
    basis = spline_basis(grid, low, high, 25, over != "stiffness")
    c = np.linalg.lstsq(basis.T, force(grid), rcond=None)[0]
    values = {"low": low, "high": high} | {f"c{j + 1}": x for j, x in enumerate(c)}
    size = 1e-3 * float(np.max(np.abs(c)))
    return LearnedLaw(Effect(f"learned_{over}_25", at, values), size**2 * np.eye(c.size))


def test_forces_of_a_place_add_up():
    effects = [("cubic_stiffness", X, [2.0]), ("quadratic_damping", X, [3.0]),
               ("constant_force", ("x",), [0.5])]  # fmt: skip
    case = Case("sum", one(), effects)
    d, v = np.array([1.0, -2.0, 0.0]), np.array([0.0, 0.0, -1.0])
    np.testing.assert_allclose(static_force(case, X, d, v), [1.5, -16.5, -3.5])
    assert not static_force(case, ("y", "ground"), d, v).any()


@pytest.mark.parametrize(("k5", "near"), [(1.2e10, True), (1.3e10, False)])
def test_a_curve_holds_what_the_models_spring_lacks(k5, near):
    case = Case("fifth", one(), [("fifth_power_stiffness", X, [1.2e10])], "unknown_law",
                wrong={"stiffness": 0.1})  # fmt: skip
    law = law_of("stiffness", X, -0.01, 0.01, lambda q: k5 * q**5 - 300 * q)
    (share,) = curve_shares(case, diagnosis_of(case, laws=[law]))
    assert (share > 0.95) is near
    right = replace(case, wrong={})
    (share,) = curve_shares(right, diagnosis_of(right, laws=[law]))
    assert share < 0.3


def test_a_curve_over_the_velocity_holds_the_damper():
    case = Case("power", one(), [("power_damping", X, [4.0, 1.5])], "unknown_law",
                wrong={"damping": -0.5})  # fmt: skip
    lacks = model_of(replace(case, wrong={})).dampers[0].damping / 2
    law = law_of("damping", X, -1.0, 2.0, lambda v: 4 * np.sign(v) * np.abs(v) ** 1.5 + lacks * v)
    (share,) = curve_shares(case, diagnosis_of(case, laws=[law]))
    assert share > 0.95


@pytest.mark.parametrize(("rate", "near"), [(700.0 / 16, True), (720.0 / 16, False)])
def test_a_stiffness_over_time_holds_what_drifts_and_what_the_spring_lacks(rate, near):
    case = Case("drift", one(), [("drifting_stiffness", X, [700.0, 16.0])], "unknown_law",
                warm_up=1000, wrong={"stiffness": 0.1})  # fmt: skip
    began = rate * 1000 * case.machine.dt - 300
    law = law_of("varying_stiffness", X, 0.0, 12.0, lambda t: began + rate * t)
    (share,) = curve_shares(case, diagnosis_of(case, laws=[law]))
    assert (share > 0.95) is near


def test_a_damping_over_time_is_judged_as_one():
    case = Case("breath", one(), [("fading_damping", X, [6.0, 1.3])], "unknown_law")
    law = law_of("varying_damping", X, 0.0, 12.0, lambda t: 6 * (1 + np.sin(1.3 * t)))
    (share,) = curve_shares(case, diagnosis_of(case, laws=[law]))
    assert share > 0.95


def test_a_place_the_other_way_round():
    case = Case("saturating", two(), [("quadratic_stiffness", ("x", "x_m"), [5e4])], "unknown_law")
    law = law_of("stiffness", ("x_m", "x"), -0.01, 0.02, lambda q: -5e4 * q**2)
    (share,) = curve_shares(case, diagnosis_of(case, laws=[law]))
    assert share > 0.95


def test_without_a_law_there_is_nothing_to_compare():
    case = Case("cubic", one(), [("cubic_stiffness", X, [1.0])])
    assert curve_shares(case, diagnosis_of(case)) == []
