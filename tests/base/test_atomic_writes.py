"""Results appear whole or not at all, whoever else writes, is killed, or has filled the disk."""

import errno
import os
import pickle
import sys
import threading
from pathlib import Path

import pytest

from robustpolish.base import atomic_writes as renames
from robustpolish.base.atomic_writes import (
    check_new_file,
    new_file,
    new_folder,
    remove_stale_stages,
    replace_folder,
    stage,
    write_file,
)
from robustpolish.base.input_files import is_write_error, write_errors_as_storage_errors
from robustpolish.errors import InvalidInputError, StorageError


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


@pytest.fixture(params=["kernel", "without"])
def way(request, monkeypatch):
    if request.param == "without":
        monkeypatch.setattr(renames, "_system_call", lambda: None)
    return request.param


def folder(path, text):
    path.mkdir()
    (path / "a.txt").write_text(text)
    return path


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


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EROFS, errno.EIO, errno.ENAMETOOLONG])
def test_the_place_the_cause_and_the_remedy_are_told(code):
    told = r"out: not written \(.+\)\. \w+ "
    with pytest.raises(StorageError, match=told) as found, write_errors_as_storage_errors("out"):
        raise OSError(code, "why")
    assert found.value.errno == code
    assert is_write_error(found.value)
    assert str(pickle.loads(pickle.dumps(found.value))) == str(found.value)


@pytest.mark.parametrize("manager", [new_file, new_folder])
def test_nothing_stays_of_what_was_not_written(manager, tmp_path):
    target, told = tmp_path / "results", "results: not written"
    with pytest.raises(StorageError, match=told), manager(target):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(StorageError, match="name too long"), manager(tmp_path / ("a" * 300)):
        pass
