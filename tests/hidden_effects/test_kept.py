"""Rows on file: an interrupted examination goes on."""

from dataclasses import replace

from tests.hidden_effects import kept, run
from tests.hidden_effects.catalogue import all_cases
from tests.hidden_effects.kept import keep, kept_rows, key_of
from tests.hidden_effects.made_up import NoPool, row_of
from tests.hidden_effects.run import run_all

CASES = all_cases()[:2]


def test_a_row_comes_back_and_a_broken_line_is_left_out(tmp_path):
    file = tmp_path / "rows.jsonl"
    assert kept_rows(file) == kept_rows(None) == {}
    row = row_of(CASES[0], True, numbers=[["a", 1.0, 1.1, 0.1]])
    keep(file, CASES[0], row)
    with file.open("a", encoding="utf-8") as out:
        out.write('{"key": "cut o')
    assert kept_rows(file) == {key_of(CASES[0]): row}
    keep(None, CASES[0], row)


def test_another_case_or_another_source_is_another_key(monkeypatch):
    one = key_of(CASES[0])
    assert one == key_of(replace(CASES[0]))
    assert one != key_of(replace(CASES[0], noise_db=31.0))
    monkeypatch.setattr(kept, "_sources", lambda: "other")
    assert one != key_of(CASES[0])


def test_what_is_kept_does_not_run_again(tmp_path, monkeypatch):
    monkeypatch.setattr(run, "ProcessPoolExecutor", NoPool)
    monkeypatch.setattr(run, "run_case", lambda case: row_of(case, False))
    file = tmp_path / "rows.jsonl"
    keep(file, CASES[0], row_of(CASES[0], True))
    rows = run_all(CASES, file)
    assert [(row["right"], case.name) for row, case in rows] == [
        (True, CASES[0].name), (False, CASES[1].name)
    ]  # fmt: skip
    monkeypatch.setattr(run, "run_case", None)
    assert run_all(CASES, file) == rows
