"""The report of a diagnosis: where, which, how much, and what to check."""

from dataclasses import replace

import pytest

from robustpolish.effects import lookup
from robustpolish.report.diagnosis import diagnosis_report
from tests import made_up
from tests.identification.findings.learned_diagnosis import unknown_law


@pytest.fixture(scope="module")
def told():
    return made_up.diagnosis()


def section(report, title):
    return next(part for part in report.sections if part.title == title)


def test_without_data_there_is_no_where(told):
    report = diagnosis_report(told)
    assert report.title == "Diagnosis of slide"
    assert report.good
    assert report.verdict.endswith(told.reasons[0])
    assert [part.title for part in report.sections] == [
        "Which effects were added", "How much of the error is gone", "What to check on the machine",
        "Candidates", "All fitted numbers",
    ]  # fmt: skip


def test_which_and_how_much(told):
    report = diagnosis_report(told)
    which = section(report, "Which effects were added")
    row = ("coulomb_friction", "x, ground", "force", 3.1, 0.02, "N")
    assert which.tables[0].rows == (row,)
    assert lookup("coulomb_friction").looks_like in which.text[0]
    fall = section(report, "How much of the error is gone").tables[0]
    assert fall.rows == (
        ("base", 0.5), ("refit", 0.31), ("coulomb_friction", 0.0123456789), ("noise floor", 0.01),
    )  # fmt: skip


def test_checks_and_what_cannot_be_told_apart(told):
    checks = section(diagnosis_report(told), "What to check on the machine")
    assert len(checks.points) == len(lookup("coulomb_friction").checks)
    assert checks.tables[0].rows[0][2] == "Move slowly, <1 mm/s, and change the speed."


def test_numbers_that_were_not_found_are_left_blank(told):
    report = diagnosis_report(told)
    assert ("spring[0].stiffness", 8e4, None, "N/m") in section(
        report, "All fitted numbers"
    ).tables[0].rows
    candidates = section(report, "Candidates").tables[0].rows
    assert candidates[1] == (1, "quadratic_damping", "x, ground", None, 9.1, "not sensible")


def test_a_learned_law_is_drawn_and_told():
    report = diagnosis_report(unknown_law())
    which = section(report, "Which effects were added")
    (shown,) = which.pictures
    assert shown.caption == "The force over displacement at x, ground as learned."
    assert any("k5*q**5 with k5 = " in point for point in which.points)
    assert [row[:3] for row in which.tables[0].rows] == [("coulomb_friction", "x, ground", "force")]
    assert not report.good  # what nobody has named is to be looked at


def test_nothing_found_is_said(told):
    report = diagnosis_report(
        replace(told, verdict="unexplained", effects=(), candidates=(), indistinguishable=())
    )
    assert not report.good
    assert section(report, "Which effects were added").text == ("None.",)
    assert section(report, "What to check on the machine").text == (
        "Nothing was found that could be checked on the machine.",
    )
    assert "Candidates" not in [part.title for part in report.sections]
