"""A row is plain data, and a failure is one too."""

import json

import pytest

from tests.hidden_effects import rows
from tests.hidden_effects.cases import Case, one, records
from tests.hidden_effects.made_up import diagnosis_of, found
from tests.hidden_effects.rows import empty_row, run_case, told

X = ("x", "ground")
CASE = Case("cubic", one(), [("cubic_stiffness", X, [4e6])], samples=1500, drive=8)


def test_what_is_told_of_a_case_is_plain():
    (data, noise), _ = records(CASE)
    alike = [(("cubic_stiffness", X), ("backlash", X))]
    said = diagnosis_of(CASE, [found("cubic_stiffness", X, stiffness=4.1e6)], alike=alike,
                        noise_floor={"x": 0.03})  # fmt: skip
    row = empty_row(CASE) | told(CASE, data, noise, said)
    assert json.loads(json.dumps(row | {"ratio": 1.0})) == row | {"ratio": 1.0}
    assert row["right"]
    assert row["found"] == row["truth"] == "cubic_stiffness at x, ground"
    assert row["alike"] == "cubic_stiffness at x, ground / backlash at x, ground"
    assert row["numbers"] == [["cubic_stiffness.stiffness", 4e6, 4.1e6, 4.1e4]]
    assert (row["exact"], row["missed"], row["wrong"], row["named"]) == (1, 0, [], 1)


def test_stated_noise_is_judged_by_the_record_that_was_diagnosed(monkeypatch):
    """Other forces move the machine further in the other record, and noise is a share of that."""
    (_, seen), (_, unseen) = records(CASE)
    assert seen["x"] != unseen["x"]
    (data, _), _ = records(CASE)
    floor = seen["x"] / float(data["x"].std())
    said = diagnosis_of(CASE, [], noise_floor={"x": floor})
    monkeypatch.setattr(rows, "diagnose", lambda model, data: said)
    assert run_case(CASE)["floors"]["x"] == pytest.approx(1.0)


def test_a_failure_is_a_result(monkeypatch):
    def refuse(model, data):
        raise ValueError("no such luck")

    monkeypatch.setattr(rows, "diagnose", refuse)
    row = run_case(CASE)
    assert (row["verdict"], row["right"], row["missed"]) == ("error", False, 1)
    assert row["found"] == "ValueError: no such luck"
    assert row["seconds"] >= 0
