"""Results appear whole or not at all."""

import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.saving import new_folder, write_file


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
