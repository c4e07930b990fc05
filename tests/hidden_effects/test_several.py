"""The plan of a hundred cases: it repeats, it is mixed, and what is missing shows."""

from collections import Counter

import numpy as np
import pytest

from tests.hidden_effects.cases import model_of, records
from tests.hidden_effects.several import (
    COUNTS,
    LEAST_LEFT,
    LEAST_OVER_NOISE,
    LEAST_SHARE,
    NUMBERS_OF_EFFECTS,
    PLAN,
    number_of_effects,
    several_case,
    several_cases,
)
from tests.hidden_effects.visible import change_by_numbers, change_without, sound

FEW = (0, 19, 22, 60, 80, 90, 96)
CASES = {i: several_case(i) for i in FEW}


def test_the_plan_holds_a_hundred():
    assert len(PLAN) == 100
    assert Counter(COUNTS.get(kind, 1) for kind in PLAN) == {1: 50, 2: 30, 3: 10, 0: 10}


def test_a_case_repeats():
    for i in (0, 22):
        assert repr(several_case.__wrapped__(i)) == repr(CASES[i])
    assert several_cases(1) == [CASES[0]]
    assert len({case.seed for case in CASES.values()}) == len(FEW)


def test_what_is_planned_is_drawn():
    for i, case in CASES.items():
        assert len(case.effects) == COUNTS.get(PLAN[i], 1)
        assert number_of_effects(case) == NUMBERS_OF_EFFECTS[COUNTS.get(PLAN[i], 1) - 1]
        if PLAN[i] not in COUNTS:
            assert case.effects[0][0] == PLAN[i]
    assert [CASES[i].verdict for i in (0, 90, 96)] == ["missing_effect", "adequate", "parameters"]


@pytest.mark.parametrize("i", [i for i in FEW if i < 90])
def test_every_effect_shows(i):
    case = CASES[i]
    assert sound(case)
    for k in range(len(case.effects)):
        change = change_without(case, k)
        assert change.over_noise >= LEAST_OVER_NOISE
        assert change.share >= LEAST_SHARE
        assert change.left >= LEAST_LEFT


def test_wrong_numbers_show():
    assert change_by_numbers(CASES[96]) > LEAST_OVER_NOISE
    assert CASES[96].wrong
    assert not CASES[90].wrong


@pytest.mark.parametrize("i", FEW)
def test_both_records_suit_the_model(i):
    case = CASES[i]
    model = model_of(case)
    for data, noise in records(case):
        assert np.isfinite(data.to_array()).all()
        assert set(noise) == set(model.output_names)
        assert len(noise) >= min(2, len(case.machine.names))
        assert set(noise) | {item.name for item in model.inputs} == set(data)


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_the_whole_plan_is_as_mixed_as_promised():
    cases = several_cases()
    assert len({case.name for case in cases}) == 100
    excitations = Counter(case.excitation for case in cases)
    assert set(excitations) == {"noise", "multisine", "sweep", "none", "blow"}
    assert 25 <= excitations["none"] + excitations["blow"] <= 42
    assert 30 <= sum(bool(case.wrong) for case in cases) <= 50
    assert {len(case.machine.names) for case in cases} == {1, 2, 3}
    mixed = [len({quantity for _, quantity in case.machine.measured}) > 1 for case in cases]
    assert sum(mixed) >= 40
    assert all(len(c.machine.measured) >= min(2, len(c.machine.names)) for c in cases)
    noise = np.array([case.noise_db for case in cases])
    assert 20 <= noise.min() < 25
    assert 55 < noise.max() <= 60
