"""Nothing is replaced by accident, with the kernel's help and without it."""

import errno
import sys

import pytest

from robustpolish.base import atomic_writes as renames
from robustpolish.base.atomic_writes import exchange, rename_noreplace


@pytest.fixture(params=["kernel", "without"])
def way(request, monkeypatch):
    if request.param == "without":
        monkeypatch.setattr(renames, "_system_call", lambda: None)
    return request.param


def folder(path, text):
    path.mkdir()
    (path / "a.txt").write_text(text)
    return path


def test_a_free_name_is_taken(way, tmp_path):
    rename_noreplace(folder(tmp_path / "a", "1"), tmp_path / "b")
    (tmp_path / "c").write_text("2")
    rename_noreplace(tmp_path / "c", tmp_path / "d")
    assert (tmp_path / "b" / "a.txt").read_text() == "1"
    assert (tmp_path / "d").read_text() == "2"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["b", "d"]


def test_a_name_that_is_taken_stays(way, tmp_path):
    old, new = folder(tmp_path / "old", "1"), folder(tmp_path / "new", "2")
    with pytest.raises(FileExistsError):
        rename_noreplace(new, old)
    (tmp_path / "c").write_text("2")
    (tmp_path / "d").write_text("3")
    with pytest.raises(FileExistsError):
        rename_noreplace(tmp_path / "c", tmp_path / "d")
    assert (old / "a.txt").read_text() == "1"
    assert (tmp_path / "d").read_text() == "3"


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux exchanges")
def test_folders_are_exchanged(tmp_path):
    first, second = folder(tmp_path / "1", "1"), folder(tmp_path / "2", "2")
    assert exchange(first, second)
    assert [(path / "a.txt").read_text() for path in (first, second)] == ["2", "1"]
    with pytest.raises(FileNotFoundError):
        exchange(first, tmp_path / "3")


def test_a_file_system_that_knows_no_flags_says_so(monkeypatch, tmp_path):
    def refuses(*_):
        renames.ctypes.set_errno(errno.EINVAL)
        return -1

    monkeypatch.setattr(renames, "_system_call", lambda: refuses)
    assert not exchange(folder(tmp_path / "1", "1"), folder(tmp_path / "2", "2"))


def test_a_file_moves_where_nothing_can_be_linked(monkeypatch, tmp_path):
    def refuses(*_):
        raise OSError(errno.EPERM, "no links")

    monkeypatch.setattr(renames, "_system_call", lambda: None)
    monkeypatch.setattr(renames.os, "link", refuses)
    (tmp_path / "c").write_text("2")
    rename_noreplace(tmp_path / "c", tmp_path / "d")
    assert (tmp_path / "d").read_text() == "2"
    (tmp_path / "c").write_text("3")
    with pytest.raises(FileExistsError):
        rename_noreplace(tmp_path / "c", tmp_path / "d")
