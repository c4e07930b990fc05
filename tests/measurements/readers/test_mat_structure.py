"""The structure of MATLAB files is checked before anything compiled trusts it."""

import io
import struct

import numpy as np
import pytest
import scipy.io
import scipy.sparse

from robustpolish.signals.readers.mat import DamagedFileError, readable_variables


def content(compressed=False, **variables):
    file = io.BytesIO()
    scipy.io.savemat(file, variables, do_compression=compressed)
    return file.getvalue()


@pytest.mark.parametrize("compressed", [False, True])
def test_variables_that_may_hold_signals_are_named(compressed):
    found = content(
        compressed, x=np.arange(5.0), z=1j * np.arange(3), text="made in Delft",
        record={"F": np.arange(3), "deep": {"y": 1.0}}, empty=np.zeros((0, 0)),
        cells=np.array([1, "a"], dtype=object), sparse=scipy.sparse.eye(3),
    )  # fmt: skip
    assert readable_variables(found) == ["x", "z", "text", "record", "empty", "cells"]


def test_version_4_has_another_structure():
    file = io.BytesIO()
    scipy.io.savemat(file, {"x": np.arange(5.0)}, format="4")
    assert readable_variables(file.getvalue()) is None
    assert readable_variables(b"short") is None


GOOD = content(x=np.arange(5.0))


def changed(place, new):
    return GOOD[:place] + new + GOOD[place + len(new) :]


@pytest.mark.parametrize(
    ("bad", "told"),
    [
        (changed(126, b"XX"), "no byte order"),
        (changed(128, struct.pack("<I", 9)), "an element of type 9 among the variables"),
        (changed(132, struct.pack("<I", 10_000)), "larger than the file"),
        (GOOD[:132], "ends in the middle"),
        (changed(136, struct.pack("<I", 5)), "without its flags"),
        (changed(152, struct.pack("<I", 6)), "without its dimensions"),
        (changed(160, struct.pack("<i", -1)), "impossible dimensions"),
        (changed(160, struct.pack("<i", 7)), "data do not fill it"),
    ],
)
def test_what_contradicts_itself_is_damaged(bad, told):
    with pytest.raises(DamagedFileError, match=told):
        readable_variables(bad)


def test_compressed_elements_have_to_be_whole():
    whole = content(True, x=np.arange(500.0))
    size = struct.unpack_from("<I", whole, 132)[0]
    cut = whole[:132] + struct.pack("<I", size - 20) + whole[136:-20]
    with pytest.raises(DamagedFileError, match="not complete"):
        readable_variables(cut)
    with pytest.raises(DamagedFileError, match="compressed element is damaged"):
        readable_variables(whole[:136] + b"\xff" * 8 + whole[144:])
