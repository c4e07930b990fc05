"""What shows, and what springs and dampers hide."""

from dataclasses import replace

import pytest

from tests.hidden_effects.cases import Case, axes, one
from tests.hidden_effects.visible import (
    change_by_numbers,
    change_without,
    chaotic,
    left_by_springs,
    sound,
)

X = ("x", "ground")


def case_of(kind, p, machine=None, **more):
    return Case(kind, machine or one(), [(kind, X, p)], samples=2500, drive=10, **more)


def test_a_hardening_spring_shows_even_beside_a_refit():
    change = change_without(case_of("cubic_stiffness", [4e6]), 0)
    assert change.share > 0.2
    assert change.over_noise == pytest.approx(change.share * 10**1.5)
    assert 2 < change.left < change.over_noise


def test_a_trifle_does_not():
    assert change_without(case_of("cubic_stiffness", [1e3]), 0).over_noise < 0.1


def test_what_a_damper_does_as_well_is_not_left():
    drag = change_without(case_of("power_damping", [3.0, 1.0]), 0)
    assert drag.share > 0.2
    assert drag.left < 0.05


def test_a_constant_force_shows_in_displacements_and_not_in_velocities():
    """Where the machine begins is unknown, so that a velocity sensor knows no place."""
    left = [
        change_without(case_of("constant_force", [60.0], machine), 0).left
        for machine in (one(), replace(one(), measured=[("x", "velocity")]))
    ]
    assert left[0] > 10
    assert left[1] < 0.1


def test_each_of_two_effects_is_asked_about():
    case = case_of("cubic_stiffness", [4e6])
    case.effects.append(("constant_force", ("x",), [1e-3]))
    assert change_without(case, 0).share > 0.2
    assert change_without(case, 1).share < 1e-3


def test_a_weak_fifth_power_is_a_cubic_spring_and_a_strong_one_is_not():
    weak, strong = (case_of("fifth_power_stiffness", [k]) for k in (2e8, 3e10))
    assert change_without(weak, 0).left > 1
    assert left_by_springs(weak) < 0.5
    assert left_by_springs(strong) > 1
    assert left_by_springs(case_of("quadratic_stiffness", [4e4])) < 0.01


def test_wrong_numbers_are_measured_in_noises():
    case = Case("numbers", one(), samples=2500, drive=10, wrong={"mass": 0.04})
    louder = replace(case, noise_db=10.0)
    assert change_by_numbers(case) == pytest.approx(10 * change_by_numbers(louder))
    assert change_by_numbers(case) > 2
    assert change_by_numbers(replace(case, wrong={})) == 0


def test_what_breaks_loose_or_sticks_is_not_sound():
    assert sound(case_of("cubic_stiffness", [4e6]))
    assert not sound(case_of("cubic_stiffness", [-4e7]))  # it leaves its well
    assert not sound(case_of("coulomb_friction", [200.0, 0.1]))  # it sticks
    whirling = Case("whirl", axes(), [("cross_stiffness", ("x", "y"), [2e3, -2e3])], samples=2500)
    assert not sound(whirling)


def test_chaos_is_told_from_order():
    assert not chaotic(case_of("quadratic_damping", [4.0]))
    # two wells, and a drive that takes it from one to the other
    wells = Case("wells", one(0.002), [("dead_zone_spring", X, [-6000.0, 0.0]),
                 ("cubic_stiffness", X, [4e7])], samples=8000, drive=12, noise_db=60)  # fmt: skip
    assert chaotic(wells)
