"""What the system refuses to write becomes one error of the package."""

import errno
import pickle

import pytest

from robustpolish.base.atomic_writes import new_file, new_folder
from robustpolish.base.input_files import (
    is_write_error,
    storage_error,
    write_errors_as_storage_errors,
)
from robustpolish.errors import InvalidInputError, StorageError


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EROFS, errno.EIO, errno.ENAMETOOLONG])
def test_the_place_the_cause_and_the_remedy_are_told(code):
    told = r"out: not written \(.+\)\. \w+ "
    with pytest.raises(StorageError, match=told) as found, write_errors_as_storage_errors("out"):
        raise OSError(code, "why")
    assert found.value.errno == code
    assert is_write_error(found.value)
    assert str(pickle.loads(pickle.dumps(found.value))) == str(found.value)


def test_other_errors_of_the_system_are_left_alone():
    with pytest.raises(ConnectionResetError), write_errors_as_storage_errors("out"):
        raise ConnectionResetError(errno.ECONNRESET, "reset")
    with pytest.raises(FileNotFoundError), write_errors_as_storage_errors("out"):
        raise FileNotFoundError(errno.ENOENT, "none")
    with pytest.raises(InvalidInputError, match="NUL"), write_errors_as_storage_errors("a\0b"):
        pass


def test_long_names_are_shortened():
    assert len(str(storage_error("a" * 300, OSError(errno.ENOSPC, "full")))) < 200


@pytest.mark.parametrize("manager", [new_file, new_folder])
def test_nothing_stays_of_what_was_not_written(manager, tmp_path):
    target, told = tmp_path / "results", "results: not written"
    with pytest.raises(StorageError, match=told), manager(target):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(StorageError, match="name too long"), manager(tmp_path / ("a" * 300)):
        pass
