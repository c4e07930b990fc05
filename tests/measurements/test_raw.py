"""What a reader gets out of a file, before any check."""

import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.measurements.raw import (
    RawTable,
    real_vector,
    split_header,
    table_of,
    unreadable,
)


def sorted_out(chosen=None, **arrays):
    return table_of(arrays, chosen, "a.npz")


@pytest.mark.parametrize(
    ("header", "name", "unit"),
    [
        ("x [mm]", "x", "mm"), (" # x  [ mm ] ", "x", "mm"), ("x", "x", ""), ("[mm]", "[mm]", ""),
        ("k[1] [N/m]", "k[1]", "N/m"), ("a []", "a", ""),
    ],
)  # fmt: skip
def test_headers_are_split(header, name, unit):
    assert split_header(header) == (name, unit)


def test_a_name_is_used_once_and_a_unit_in_the_file_goes_before_the_header():
    table = RawTable()
    table.add("x [mm]", [1.0], "um")
    assert table.units == {"x": "um"}
    with pytest.raises(InvalidInputError, match="column: got 'x', expected a name used once"):
        table.add("x", [2.0])


def test_what_is_no_signal_is_left_out_with_a_note():
    table = sorted_out(x=np.arange(3.0), words=np.array(["a", "b"]), z=1j * np.arange(3))
    assert list(table.columns) == ["x"]
    assert table.notes == ["left out, as they are no signals: words, z"]


@pytest.mark.parametrize(
    ("name", "value", "rate"),
    [("fs", 500.0, 500.0), ("Ts", 0.002, 500.0), ("fs", -1.0, None), ("gain", 3.0, None)],
)
def test_a_lone_number_may_be_the_rate(name, value, rate):
    assert sorted_out(x=np.arange(3.0), **{name: np.array([[value]])}).sampling_rate == rate


def test_a_matrix_is_a_table_whose_columns_may_have_names():
    matrix = np.arange(8.0).reshape(4, 2)
    assert list(sorted_out(m=matrix).columns) == ["m_1", "m_2"]
    lying = sorted_out(m=matrix.T, columns=np.array(["t", "x [mm]"]))
    np.testing.assert_array_equal(lying.columns["x"], matrix[:, 1])
    assert lying.units == {"x": "mm"}


def test_one_of_several_matrices_has_to_be_chosen():
    matrices = {"a": np.ones((4, 2)), "b": np.zeros((4, 2))}
    assert sorted_out("b", **matrices).columns["b_1"].sum() == 0
    with pytest.raises(InvalidInputError, match=r"a\.npz with the tables a, b"):
        sorted_out(**matrices)
    with pytest.raises(InvalidInputError, match="table: got 'c', expected a matrix of the file"):
        sorted_out("c", **matrices)
    with pytest.raises(InvalidInputError, match="the file has no matrix"):
        sorted_out("c", x=np.arange(3.0))


def test_vectors_are_flat_and_real():
    np.testing.assert_array_equal(real_vector([[1], [2], [3]]), [1, 2, 3])
    for other in ([1.0], [[1, 2], [3, 4]], ["a", "b"], [1j, 2j]):
        assert real_vector(other) is None


def test_a_library_s_complaint_is_told_in_one_line():
    assert "a.wav (first)" in str(unreadable("a.wav", "WAV", ValueError("first\nsecond")))
    assert "a.wav (KeyError)" in str(unreadable("a.wav", "WAV", KeyError()))
