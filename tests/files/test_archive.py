"""Archives are looked at before they are unpacked."""

import zipfile

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.base.input_files import FileSpec, members, open_checked

WANTED = FileSpec("path", "a file", "Check the path.", 10_000)


def found(path, wanted=WANTED):
    with open_checked(path, wanted) as file:
        return [info.filename for info in members(file, path, wanted)]


def test_members_are_listed_up_to_the_limit(tmp_path):
    path = tmp_path / "a.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a", bytes(6000))
        archive.writestr("b", bytes(4000))
    assert found(path) == ["a", "b"]
    with pytest.raises(rp.InvalidInputError, match="unpacked, of 10,000 bytes"):
        found(path, WANTED.limited(9_999))


def test_too_many_members_are_refused(tmp_path):
    path = tmp_path / "a.zip"
    with zipfile.ZipFile(path, "w") as archive:
        for i in range(10_001):
            archive.writestr(str(i), b"")
    with pytest.raises(rp.InvalidInputError, match="10001 members"):
        found(path, WANTED.limited(10_000_000))


def test_an_array_that_claims_more_than_it_has_reserves_nothing(tmp_path):
    np.save(tmp_path / "a.npy", np.arange(10.0))
    claim = (tmp_path / "a.npy").read_bytes().replace(b"(10,)", b"(99999999999,)", 1)
    claim = claim.replace(b"         \n", b"\n", 1)  # the head keeps its length
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("a.npy", claim)
    with pytest.raises(rp.InvalidInputError, match="shorter than it says"):
        rp.read_measurement(tmp_path / "a.npz")
