"""Hidden effects are found: a few kinds of case each time, all of them in the long tests."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from tests.hidden_effects.cases import records
from tests.hidden_effects.catalogue import all_cases
from tests.hidden_effects.drawn import CLASSES, JUDGED_SEED, PLAN, class_of, drawn_cases
from tests.hidden_effects.figures import figures, law_learned
from tests.hidden_effects.kept import KEPT
from tests.hidden_effects.rows import run_case
from tests.hidden_effects.run import drawn_several, run_all
from tests.hidden_effects.several import SEEN_SEED, UNSEEN_SEED

CASES = {case.name: case for case in all_cases()}
# At least this share of the drawn cases is right. Of the 44 of the judged seed 35 were when they
# were first run as a whole: 80 %. The margin is two cases, because a decision that is nearly a draw
# may fall the other way on another machine. A 45th case came when learned laws did; it adds nothing
# to the floor.
DRAWN_FLOOR = 33 / 45
QUICK = ("quadratic damping", "input delay", "wrong numbers, two masses, in motion", "gyroscopic")


@pytest.mark.parametrize("name", QUICK)
def test_quick_cases_are_named_right(name):
    row = run_case(replace(CASES[name], samples=5000))
    assert row["right"], row
    assert row["ratio"] <= 1.3


@pytest.mark.long
@pytest.mark.timeout(7200)
def test_nine_of_ten_are_named_right_and_extrapolate():
    rows = run_all(list(CASES.values()), KEPT)
    named = [row["right"] for row, case in rows if case.verdict == "missing_effect"]
    assert sum(named) >= 0.9 * len(named), wrong(rows)
    calm = [
        row["ratio"] <= 1.3
        for row, case in rows
        if case.verdict == "missing_effect" and not case.chaotic
    ]
    assert sum(calm) >= 0.9 * len(calm), [(row["case"], row["ratio"]) for row, _ in rows]
    assert all(row["right"] for row, case in rows if case.verdict != "missing_effect"), wrong(rows)
    laws = [row for row, case in rows if case.verdict == "unknown_law"]
    assert len(laws) == 4
    assert all(map(law_learned, laws)), [(r["case"], r["ratio"], r["curves"]) for r in laws]


@pytest.mark.long
@pytest.mark.timeout(7200)
def test_of_the_drawn_cases_as_many_are_right_as_ever():
    rows = run_all(drawn_cases(JUDGED_SEED), KEPT)
    assert sum(row["right"] for row, _ in rows) >= DRAWN_FLOOR * len(rows), wrong(rows)


@pytest.mark.long
@pytest.mark.timeout(6 * 3600)
@pytest.mark.parametrize("seed", [SEEN_SEED, UNSEEN_SEED])
def test_cases_with_several_effects_come_out_as_promised(seed):
    rows = run_all(drawn_several(seed), KEPT)
    found = figures(rows)
    assert found.right.value >= 0.95, wrong(rows)
    assert found.confident.value <= 0.02, [row for row, _ in rows if row["wrong"]]
    assert found.quiet.value >= 0.98, [row for row, case in rows if not case.effects]
    assert 0.90 <= found.covered.value <= 0.99, found.covered
    assert found.floors.value >= 0.95, [(row["case"], row["floors"]) for row, _ in rows]


@pytest.fixture(scope="module")
def drawn():
    return drawn_cases(JUDGED_SEED)


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
        "input_gain", "sensor_offset", "sensor_gain", "input_lag", "maxwell_element",
        "input_saturation", "input_dead_zone",
    } <= kinds  # fmt: skip
    assert len({case.seed for case in CASES.values()}) == len(CASES)


def test_drawn_cases_repeat(drawn):
    one, two = drawn_cases(3, 6), drawn_cases(3, 6)
    assert [repr(case) for case in one] == [repr(case) for case in two]
    assert len(drawn) == len(PLAN) >= 40
    counts = Counter(class_of(case) for case in drawn)
    assert set(counts) == set(CLASSES)
    assert sum(counts.values()) == len(PLAN)


def test_what_is_outside_of_the_catalogue(drawn):
    verdicts = {kind: case.verdict for case in CASES.values() for kind, _, _ in case.effects}
    assert verdicts["fifth_power_stiffness"] == verdicts["saturating_spring"] == "unknown_law"
    assert verdicts["dead_zone_spring"] == verdicts["drifting_stiffness"] == "unknown_law"
    assert verdicts["fading_damping"] == "unexplained"
    verdicts = {case.effects[0][0]: case.verdict for case in drawn if case.effects}
    assert verdicts["saturating_spring"] == "unknown_law"
    assert verdicts["random_walk_force"] == "unexplained"


def test_no_drawn_machine_breaks_loose(drawn):
    asymmetric = [case for case in drawn if "quadratic_stiffness" in case.name]
    assert asymmetric
    for case in asymmetric:
        assert all(np.isfinite(data.to_array()).all() for data, _ in records(case)), case.name
