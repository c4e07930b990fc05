"""Hidden effects are found: a few kinds of case each time, all of them in the long tests."""

from dataclasses import replace

import pytest

from .catalogue import all_cases
from .drawn import PLAN, drawn_cases
from .run import run_case, table

CASES = {case.name: case for case in all_cases()}
QUICK = ("quadratic damping", "input delay", "wrong numbers, two masses, in motion", "gyroscopic")


@pytest.mark.parametrize("name", QUICK)
def test_quick_cases_are_named_right(name):
    row = run_case(replace(CASES[name], samples=5000))
    assert row["right"], row
    assert row["ratio"] <= 1.3


@pytest.mark.slow
@pytest.mark.timeout(7200)
def test_nine_of_ten_are_named_right_and_extrapolate():
    rows = [(run_case(case), case) for case in CASES.values()]
    page = table(rows)
    named = [row["right"] for row, case in rows if case.verdict == "missing_effect"]
    assert sum(named) >= 0.9 * len(named), page
    calm = [
        row["ratio"] <= 1.3
        for row, case in rows
        if case.verdict == "missing_effect" and not case.chaotic
    ]
    assert sum(calm) >= 0.9 * len(calm), page
    assert all(row["right"] for row, case in rows if case.verdict != "missing_effect"), page


def test_the_cases_cover_the_catalogue():
    kinds = {kind for case in CASES.values() for kind, _, _ in case.effects}
    assert len(CASES) >= 40
    assert {
        "coulomb_friction", "stribeck_friction", "elastic_coulomb_friction", "lugre_friction",
        "quadratic_damping", "displacement_dependent_damping", "bouc_wen_hysteresis",
        "cubic_stiffness", "quadratic_stiffness", "backlash", "contact_stop", "pendulum_gravity",
        "constant_force", "harmonic_force", "unbalance", "parametric_stiffness",
        "gyroscopic_coupling", "cross_stiffness", "attached_resonator", "input_delay",
        "input_gain", "sensor_offset", "sensor_gain",
    } <= kinds  # fmt: skip
    assert len({case.seed for case in CASES.values()}) == len(CASES)


def test_drawn_cases_repeat():
    one, two = drawn_cases(3), drawn_cases(3)
    assert [repr(case) for case in one] == [repr(case) for case in two]
    assert len(one) == len(PLAN)
