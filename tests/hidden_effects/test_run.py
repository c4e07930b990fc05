"""Which cases run, and when the page is written; none of them is diagnosed here."""

import pytest

from tests.hidden_effects import run
from tests.hidden_effects.cases import Case, one
from tests.hidden_effects.catalogue import all_cases
from tests.hidden_effects.kept import kept_rows
from tests.hidden_effects.laws import KINDS, UNSEEN_LAWS
from tests.hidden_effects.made_up import NoPool, row_of
from tests.hidden_effects.several import several_case


def law(number, seed):
    """A law that is quickly drawn."""
    at = ("x", "ground")
    return Case(f"law {number} of {seed}", one(), [(KINDS[number], at, [1.0])], "unknown_law")


@pytest.fixture
def ran(monkeypatch, tmp_path):
    """The names of the cases that run; the plans are short."""
    names = []

    def run_case(case):
        names.append(case.name)
        return row_of(case, True)

    monkeypatch.setattr(run, "ProcessPoolExecutor", NoPool)
    monkeypatch.setattr(run, "run_case", run_case)
    monkeypatch.setattr(run, "PLAN", run.PLAN[:3])
    monkeypatch.setattr(run, "LAWS", run.LAWS[:2])
    monkeypatch.setattr(run, "law_case", law)
    monkeypatch.setattr(run, "all_cases", lambda: all_cases()[:4])
    monkeypatch.setattr(run, "drawn_cases", lambda seed: all_cases()[seed % 7 + 4 : seed % 7 + 6])
    monkeypatch.setattr(run, "page", lambda *groups: f"{[len(group) for group in groups]}")
    monkeypatch.setattr(run, "PAGE", tmp_path / "page.md")
    return names


LISTED = [case.name for case in all_cases()]


def test_everything_runs_and_the_page_is_written(ran, tmp_path, capsys):
    run.main(["--keep", str(tmp_path / "rows.jsonl")])
    assert (tmp_path / "page.md").read_text() == "[4, 2, 3, 2]"
    several = [several_case(i).name for i in range(3)]
    drawn = LISTED[run.JUDGED_SEED % 7 + 4 :][:2]
    laws = [law(i, UNSEEN_LAWS).name for i in range(2)]
    assert sorted(ran) == sorted([*LISTED[:4], *drawn, *several, *laws])
    ran.clear()
    run.main(["--keep", str(tmp_path / "rows.jsonl")])
    assert not ran
    assert "[4, 2, 3, 2]" in capsys.readouterr().out


def test_two_parts_are_the_whole(ran, tmp_path):
    file = tmp_path / "rows.jsonl"
    run.main(["--part", "0/2", "--keep", str(file)])
    assert len(ran) == 2 + 1 + 2 + 1
    run.main(["--part", "1/2", "--keep", str(file)])
    assert len(ran) == len(kept_rows(file)) == 11
    assert not (tmp_path / "page.md").exists()
    ran.clear()
    run.main(["--keep", str(file)])
    assert not ran
    assert (tmp_path / "page.md").exists()


def test_parts_of_names_choose(ran, capsys):
    run.main(["coulomb", "stribeck"])
    assert ran == ["coulomb, one mass", "stribeck, one mass"]
    ran.clear()
    run.main(["--several", "#01", "coulomb"])
    assert ran == ["coulomb_friction #00", "stribeck_friction #01", "elastic_coulomb_friction #02"]
    ran.clear()
    run.main(["--drawn", "7"])
    assert ran == LISTED[4:6]
    assert f"| {LISTED[4]} |" in capsys.readouterr().out
    ran.clear()
    run.main(["--laws", "5", "saturating"])
    assert ran == ["law 1 of 5"]


@pytest.mark.parametrize("part", ["2/2", "a/b", "1"])
def test_a_part_is_one_of_so_many(part, capsys):
    with pytest.raises(SystemExit):
        run.main(["--several", "--part", part])
    assert "is no part such as" in capsys.readouterr().err
