"""Stages: somebody's while a process holds them, swept up by the next run when none does."""

import os
import sys
from pathlib import Path

import pytest

from robustpolish.base import atomic_writes as renames
from robustpolish.base.atomic_writes import remove_stale_stages, replace_folder, stage

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="folders cannot be locked")


def killed(work):
    """Run `work` in a process that is killed before it ends by itself."""
    child = os.fork()
    if child == 0:
        try:
            work()
        finally:
            os._exit(0)
    os.waitpid(child, 0)


def leave_a_stage(target, text="new"):
    def work():
        with stage(target) as draft:
            draft.mkdir()
            (draft / "a.txt").write_text(text)
            os._exit(9)

    killed(work)


def test_a_dead_stage_is_swept_up_and_a_living_one_is_not(tmp_path):
    leave_a_stage(tmp_path / "dead")
    (dead,) = tmp_path.iterdir()
    with stage(tmp_path / "alive") as draft:
        draft.write_text("mine")
        remove_stale_stages(tmp_path)
        assert not dead.exists()
        assert draft.read_text() == "mine"
    assert list(tmp_path.iterdir()) == []


def test_what_only_looks_like_a_stage_is_left_alone(tmp_path):
    for name in (".robustpolish-notes", ".robustpolish-12345678.txt", "robustpolish-abcdefgh"):
        (tmp_path / name).mkdir()
    (tmp_path / ".robustpolish-abcdefgh").write_text("a file")
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (tmp_path / ".robustpolish-hgfedcba").symlink_to(elsewhere)
    before = sorted(tmp_path.iterdir())
    remove_stale_stages(tmp_path)
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="needs two users")
def test_another_users_stage_is_left_alone(tmp_path):
    leave_a_stage(tmp_path / "dead")
    (dead,) = tmp_path.iterdir()
    os.chown(dead, 12345, -1)
    remove_stale_stages(tmp_path)
    assert dead.exists()


@pytest.mark.parametrize("missing", ["target", "nothing"])
def test_an_exchange_that_was_cut_is_finished_by_the_next_run(tmp_path, monkeypatch, missing):
    target = tmp_path / "results"
    target.mkdir()
    (target / "a.txt").write_text("old")
    monkeypatch.setattr(renames, "_system_call", lambda: None)
    original = Path.rename

    def rename_and_die(source, place):
        if missing == "target":
            original(source, place)
        os._exit(9)

    def work():
        with stage(target) as draft:
            draft.mkdir()
            (draft / "a.txt").write_text("new")
            monkeypatch.setattr(Path, "rename", rename_and_die)
            replace_folder(draft, target)

    killed(work)
    assert target.exists() is (missing == "nothing")
    remove_stale_stages(tmp_path)
    assert (target / "a.txt").read_text() == ("new" if missing == "target" else "old")
    assert [path.name for path in tmp_path.iterdir()] == ["results"]


def test_without_exchange_a_folder_is_replaced_all_the_same(tmp_path, monkeypatch):
    monkeypatch.setattr(renames, "_system_call", lambda: None)
    target = tmp_path / "results"
    with stage(target) as draft:
        draft.mkdir()
        with pytest.raises(FileNotFoundError):
            replace_folder(draft, target)
        target.mkdir()
        (target / "a.txt").write_text("old")
        replace_folder(draft, target)
        assert list(target.iterdir()) == []
    assert [path.name for path in tmp_path.iterdir()] == ["results"]


@pytest.mark.parametrize("name", ["../elsewhere", "", ".."])
def test_a_manifest_reaches_no_other_folder(tmp_path, name):
    folder = tmp_path / "in"
    home = folder / ".robustpolish-abcdefgh"
    (home / "old").mkdir(parents=True)
    (home / "replacing").write_text(name)
    remove_stale_stages(folder)
    assert [path.name for path in tmp_path.iterdir()] == ["in"]
    assert list(folder.iterdir()) == []


def test_a_forked_process_holds_nothing_and_removes_nothing(tmp_path):
    reader, writer = os.pipe()
    told, telling = os.pipe()
    with stage(tmp_path / "a") as draft:
        child = os.fork()
        if child == 0:
            os.close(writer)
            os.write(telling, b".")
            os.read(reader, 1)  # outlives the stage of its parent
            os._exit(0)
        assert os.read(told, 1)
        (home,) = tmp_path.iterdir()
        copy = tmp_path / ".robustpolish-abcdefgh"
        home.rename(copy)  # as if this process had been killed here
    assert draft.parent.parent == home
    remove_stale_stages(tmp_path)
    assert list(tmp_path.iterdir()) == []
    os.close(writer)
    os.waitpid(child, 0)
    with stage(tmp_path / "b"):
        child = os.fork()
        if child == 0:
            try:
                with stage(tmp_path / "c"):
                    pass
            finally:
                os._exit(len(list(tmp_path.iterdir())))
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 1
