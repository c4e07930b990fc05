"""The page tells what the rows say."""

import pytest

from tests.hidden_effects.cases import Case, one
from tests.hidden_effects.catalogue import all_cases
from tests.hidden_effects.drawn import JUDGED_SEED, class_of, drawn_cases
from tests.hidden_effects.laws import KINDS
from tests.hidden_effects.made_up import row_of
from tests.hidden_effects.page import page
from tests.hidden_effects.several import UNSEEN_SEED, several_case

CASES = all_cases()
SEVERAL = [several_case(i) for i in (19, 60, 80, 90)]


@pytest.fixture(scope="module")
def drawn():
    return drawn_cases(JUDGED_SEED)


def rows_of(cases, failing=None):
    return [(row_of(case, case is not failing), case) for case in cases]


def told(rows, drawn, several=None, laws=None):
    """The page, with all cases with several effects right by default, and no laws drawn."""
    return page(rows, drawn, several or rows_of(SEVERAL), laws or [])


def test_the_drawn_cases_are_told_by_class_with_those_that_fail(drawn):
    failing = next(case for case in drawn if class_of(case) == "two axes")
    lines = told(rows_of(CASES), rows_of(drawn, failing)).splitlines()
    assert f"of seed {JUDGED_SEED}" in next(line for line in lines if "whole plan" in line)
    assert any("44 of 45 are right, that is 98 %" in line for line in lines)
    assert "| two axes | 4 | 3 |" in lines
    assert "| signals | 4 | 4 |" in lines
    fails = lines[lines.index("Those that fail:") :]
    assert [line.split(" | ")[0] for line in fails if "**no**" in line] == [f"| {failing.name}"]
    assert sum(line.startswith("| cubic, one mass |") for line in lines) == 1
    assert "Those that fail:" not in told(rows_of(CASES), rows_of(drawn))


def test_the_laws_are_told_apart_from_what_has_none(drawn):
    learned = {
        case.name: row_of(case, True, curves=[0.95 if case.name != "fifth power" else 0.5])
        for case in CASES
    }
    text = told([(learned[c.name], c) for c in CASES], rows_of(drawn))
    law = next(line for line in text.splitlines() if "laws that no catalogue holds" in line)
    assert "at their place: 4 of 4 (100.0 %)" in law
    assert law.endswith("3 of 4 (75.0 %)")
    assert "and no name given: 2 of 2 (100.0 %)" in text


def test_several_effects_are_told_by_number(drawn):
    rows = [
        (row_of(SEVERAL[0], True, exact=1, missed=0, numbers=[["input_gain.gain", 1, 1.1, 0.1]]),
         SEVERAL[0]),
        (row_of(SEVERAL[1], False, exact=1, missed=1, wrong=["backlash at m1"], named=2),
         SEVERAL[1]),
        (row_of(SEVERAL[2], True, exact=2, swapped=1, missed=0), SEVERAL[2]),
        (row_of(SEVERAL[3], True), SEVERAL[3]),
    ]  # fmt: skip
    lines = told(rows_of(CASES), rows_of(drawn), several=rows).splitlines()
    assert any(line.startswith(f"4 cases of seed {UNSEEN_SEED}") for line in lines)
    assert "| right in kind and place, or told alike | 3 of 4 (75.0 %) | 95 % |" in lines
    assert "| a name that is wrong and not told alike | 1 of 4 (25.0 %) | at most 2 % |" in lines
    assert "| nothing named where nothing is missing | 1 of 1 (100.0 %) | 98 % |" in lines
    assert "| two effects | 1 | 0 | 2 | 1 | 0 | 1 | 1 |" in lines
    assert "| three effects | 1 | 1 | 3 | 2 | 1 | 0 | 0 |" in lines
    assert "| input_gain.gain | 1 of 1 (100.0 %) | 1.00 |" in lines
    after = lines[lines.index("Those that are not right:") :]
    assert [line.split(" | ")[0] for line in after if "**no**" in line] == ["| two #60"]


def test_laws_are_told_by_kind(drawn):
    cases = [
        Case(kind, one(), [(kind, ("x", "ground"), [1.0])], "unknown_law")
        for kind in (*KINDS, KINDS[0])
    ]
    good = {"ratio": 1.0, "curves": [0.95]}
    rows = [(row_of(case, True, **good), case) for case in cases[:-1]]
    far = row_of(cases[-1], False, ratio=4.0, curves=[], wrong=["backlash at x"])
    lines = told(rows_of(CASES), rows_of(drawn), laws=[*rows, (far, cases[-1])]).splitlines()
    half, whole, none = "1 of 2 (50.0 %)", "1 of 1 (100.0 %)", "0 of 1 (0.0 %)"
    assert f"| {KINDS[0]} | {half} | {half} | {half} | {half} |" in lines
    assert f"| {KINDS[1]} | {whole} | {whole} | {whole} | {none} |" in lines
    assert any(line.startswith("| all | 4 of 5 (80.0 %) | ") for line in lines)
