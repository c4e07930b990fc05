"""Results appear whole or not at all."""

import sys
import threading

import pytest

from robustpolish.base import atomic_writes as renames
from robustpolish.base.atomic_writes import check_new_file, new_file, new_folder, write_file
from robustpolish.errors import InvalidInputError


def test_a_folder_appears_at_the_end(tmp_path):
    target = tmp_path / "deep" / "results"
    with new_folder(target) as folder:
        (folder / "a.txt").write_text("a")
        assert not target.exists()
    assert (target / "a.txt").read_text() == "a"
    assert [path.name for path in target.parent.iterdir()] == ["results"]


def test_failure_leaves_nothing_and_keeps_the_old(tmp_path):
    target = tmp_path / "results"
    with new_folder(target) as folder:
        (folder / "a.txt").write_text("old")
    with pytest.raises(RuntimeError), new_folder(target, force=True) as folder:
        (folder / "a.txt").write_text("new")
        raise RuntimeError
    assert (target / "a.txt").read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["results"]


def test_existing_results_need_force(tmp_path):
    target = tmp_path / "results"
    with new_folder(target) as folder:
        (folder / "a.txt").write_text("old")
    with pytest.raises(InvalidInputError, match="--force"), new_folder(target):
        pass
    with new_folder(target, force=True) as folder:
        (folder / "b.txt").write_text("new")
    assert not (target / "a.txt").exists()
    assert (target / "b.txt").exists()


def test_a_folder_of_something_else_is_never_replaced(tmp_path):
    (tmp_path / "thesis.txt").write_text("years of work")
    with pytest.raises(InvalidInputError, match="left alone"), new_folder(tmp_path, force=True):
        pass
    assert (tmp_path / "thesis.txt").read_text() == "years of work"


def test_files(tmp_path):
    target = tmp_path / "a.json"
    write_file(target, "1")
    with pytest.raises(InvalidInputError, match="--force"):
        write_file(target, "2")
    write_file(target, "3", force=True)
    assert target.read_text() == "3"
    with pytest.raises(InvalidInputError, match="existing folder"):
        write_file(tmp_path / "none" / "a.json", "1")
    assert [path.name for path in tmp_path.iterdir()] == ["a.json"]


@pytest.mark.parametrize("exchanging", [True, False])
def test_of_writers_with_force_the_last_one_wins(tmp_path, monkeypatch, exchanging):
    if not exchanging:
        monkeypatch.setattr(renames, "_system_call", lambda: None)
    target, errors = tmp_path / "results", []

    def write(text):
        try:
            for _ in range(20):
                with new_folder(target, force=True) as folder:
                    (folder / "a.txt").write_text(text)
                    (folder / "b.txt").write_text(text)
        except BaseException as error:
            errors.append(error)

    writers = [threading.Thread(target=write, args=(text,)) for text in "123"]
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)  # writers meet more often
    try:
        for writer in writers:
            writer.start()
        for writer in writers:
            writer.join()
    finally:
        sys.setswitchinterval(interval)
    assert errors == []
    assert (target / "a.txt").read_text() == (target / "b.txt").read_text()
    assert [path.name for path in tmp_path.iterdir()] == ["results"]


def test_what_appears_meanwhile_is_not_replaced_without_force(tmp_path):
    with pytest.raises(InvalidInputError, match="--force"), new_folder(tmp_path / "a"):
        (tmp_path / "a").mkdir()
    with pytest.raises(InvalidInputError, match="--force"), new_file(tmp_path / "b") as draft:
        draft.write_text("late")
        (tmp_path / "b").write_text("early")
    assert (tmp_path / "b").read_text() == "early"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "b"]


def test_a_refused_place_is_swept_too(tmp_path):
    (tmp_path / "a.txt").write_text("mine")
    (tmp_path / ".robustpolish-deadbeef").mkdir()
    with pytest.raises(InvalidInputError, match="--force"):
        check_new_file(tmp_path / "a.txt")
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]
