"""Heaps of HDF5 files are checked before the library follows them."""

import struct

import h5py
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.signals.readers.hdf5 import check_heaps


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["t"], file["x"] = np.arange(5.0), np.array([0.0, 1.0, 0.5, 2.0, 1.0])
        file["words"] = [f"word {i}" for i in range(300)]
    return path


def damaged(path, place, number):
    """Write a number as the length that stands at a place of the first heap."""
    content = bytearray(path.read_bytes())
    start = content.index(b"GCOL\x01")
    content[start + place : start + place + 8] = struct.pack("<Q", number)
    path.write_bytes(content)


def test_good_ones_pass(path):
    with path.open("rb") as file:
        check_heaps(file)
    assert list(rp.read_measurement(path, sampling_rate=1.0, columns=["x"])) == ["x"]


@pytest.mark.parametrize("number", [10**6, 2**63, 2**64 - 1])
@pytest.mark.parametrize("place", [8, 24])  # of the heap, of its first object
def test_impossible_sizes_are_refused(path, place, number):
    damaged(path, place, number)
    with pytest.raises(rp.InvalidInputError, match="heap"):
        rp.read_measurement(path)


def test_what_takes_no_room_would_never_end(path):
    content = bytearray(path.read_bytes())
    start = content.index(b"GCOL\x01")
    content[start + 16 : start + 32] = bytes(16)
    path.write_bytes(content)
    with pytest.raises(rp.InvalidInputError, match="an object of an impossible"):
        rp.read_measurement(path)


def test_data_in_other_files_are_not_followed(tmp_path):
    (tmp_path / "secret").write_bytes(np.arange(5.0).tobytes())
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("t", data=np.arange(5.0))
        file.create_dataset("x", (5,), "f8", external=[(str(tmp_path / "secret"), 0, 40)])
    with pytest.raises(rp.InvalidInputError, match="lies in another file"):
        rp.read_measurement(tmp_path / "a.h5")


def test_the_size_of_texts_is_bounded(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["t"], file["x"] = np.arange(5.0), np.array([0.0, 1.0, 0.5, 2.0, 1.0])
        file.create_dataset("words", (10**7,), h5py.string_dtype(), chunks=(10**6,))
    with pytest.raises(rp.InvalidInputError, match="more texts"):
        rp.read_measurement(tmp_path / "a.h5")
    with h5py.File(tmp_path / "b.h5", "w") as file:
        file["words"] = ["a" * 1000, *["b"] * 1000]
    with pytest.raises(rp.InvalidInputError, match="unpacked"):
        rp.read_measurement(tmp_path / "b.h5", max_bytes=100_000)
