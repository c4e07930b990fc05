"""Arrays of a file, sorted into signals, rates and the rest."""

import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.signals.readers.arrays import real_vector, table_of


def sorted_out(chosen=None, **arrays):
    return table_of(arrays, chosen, "a.npz")


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
    with pytest.raises(InvalidInputError, match="table: got 'c', expected a matrix or a group"):
        sorted_out("c", **matrices)
    with pytest.raises(InvalidInputError, match=r"which holds x \(3\)"):
        sorted_out("c", x=np.arange(3.0))


def test_vectors_are_flat_and_real():
    np.testing.assert_array_equal(real_vector([[1], [2], [3]]), [1, 2, 3])
    for other in ([1.0], [[1, 2], [3, 4]], ["a", "b"], [1j, 2j]):
        assert real_vector(other) is None


def test_a_group_is_a_table():
    arrays = {"a/t": np.arange(3.0), "a/x": np.ones(3), "b/t": np.arange(4.0), "fs": np.array(5.0)}
    table = table_of(arrays, "a", "f.h5")
    assert list(table.columns) == ["t", "x"]
    assert table.sampling_rate == 5.0
    with pytest.raises(InvalidInputError, match=r"a/t \(3\), .*b/t \(4\), fs \(one number"):
        table_of(arrays, "c", "f.h5")
