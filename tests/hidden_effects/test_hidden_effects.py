"""Hidden effects are found: a few kinds of case each time, all of them in the long tests."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from tests.hidden_effects.cases import records
from tests.hidden_effects.catalogue import all_cases
from tests.hidden_effects.drawn import CLASSES, JUDGED_SEED, PLAN, class_of, drawn_cases
from tests.hidden_effects.run import page, run_all, run_case

CASES = {case.name: case for case in all_cases()}
# At least this share of the drawn cases is right. Of the 44 of the judged seed 35 were when they
# were first run as a whole: 80 %. The margin is two cases, because a decision that is nearly a draw
# may fall the other way on another machine.
DRAWN_FLOOR = 33 / 44
QUICK = ("quadratic damping", "input delay", "wrong numbers, two masses, in motion", "gyroscopic")


@pytest.mark.parametrize("name", QUICK)
def test_quick_cases_are_named_right(name):
    row = run_case(replace(CASES[name], samples=5000))
    assert row["right"], row
    assert row["ratio"] <= 1.3


@pytest.mark.slow
@pytest.mark.timeout(7200)
def test_nine_of_ten_are_named_right_and_extrapolate():
    rows = run_all(list(CASES.values()))
    named = [row["right"] for row, case in rows if case.verdict == "missing_effect"]
    assert sum(named) >= 0.9 * len(named), wrong(rows)
    calm = [
        row["ratio"] <= 1.3
        for row, case in rows
        if case.verdict == "missing_effect" and not case.chaotic
    ]
    assert sum(calm) >= 0.9 * len(calm), [(row["case"], row["ratio"]) for row, _ in rows]
    assert all(row["right"] for row, case in rows if case.verdict != "missing_effect"), wrong(rows)


@pytest.mark.slow
@pytest.mark.timeout(7200)
def test_of_the_drawn_cases_as_many_are_right_as_ever():
    rows = run_all(drawn_cases(JUDGED_SEED))
    assert sum(row["right"] for row, _ in rows) >= DRAWN_FLOOR * len(rows), wrong(rows)


def wrong(rows):
    return [row for row, _ in rows if not row["right"]]


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
    assert len(one) == len(PLAN) >= 40
    counts = Counter(class_of(case) for case in one)
    assert set(counts) == set(CLASSES)
    assert sum(counts.values()) == len(PLAN)


def test_no_drawn_machine_breaks_loose():
    drawn = [case for case in drawn_cases(JUDGED_SEED) if "quadratic_stiffness" in case.name]
    assert drawn
    for case in drawn:
        assert all(np.isfinite(data.to_array()).all() for data, _ in records(case)), case.name


def row_of(case, right):
    return {
        "case": case.name, "truth": "a truth", "verdict": case.verdict, "found": "-", "alike": "",
        "right": right, "ratio": 1.0, "seconds": 2.0,
    }  # fmt: skip


def test_the_page_tells_the_drawn_cases_by_class_and_those_that_fail():
    listed = [(row_of(case, True), case) for case in CASES.values()]
    drawn = drawn_cases(JUDGED_SEED)
    failing = next(case for case in drawn if class_of(case) == "two axes")
    rows = [(row_of(case, case is not failing), case) for case in drawn]
    lines = page(listed, rows).splitlines()
    assert f"of seed {JUDGED_SEED}" in next(line for line in lines if "whole plan" in line)
    assert any("43 of 44 are right, that is 98 %" in line for line in lines)
    assert "| two axes | 4 | 3 |" in lines
    assert "| signals | 4 | 4 |" in lines
    fails = lines[lines.index("Those that fail:") :]
    assert [line.split(" | ")[0] for line in fails if "**no**" in line] == [f"| {failing.name}"]
    assert sum(line.startswith("| cubic, one mass |") for line in lines) == 1
    assert "Those that fail:" not in page(listed, [(row_of(case, True), case) for case in drawn])
