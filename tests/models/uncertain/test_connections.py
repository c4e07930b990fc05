import numpy as np
import pytest

import robustpolish as rp

K = rp.uncertain.real("k", 10, percent=40)


def test_names():
    plant = rp.uncertain.system(
        [[0, 1], [-K, -1]], [[0], [1]], [[1, 0]], states=["x", "v"], inputs=["F"], outputs=["y"]
    )
    machine = plant.at({"k": 11})
    assert machine.state_labels == ["x", "v"]
    assert machine.input_labels == ["F"]
    assert plant.feedback().nominal.output_labels == ["y"]


def test_sampling_time():
    discrete = rp.uncertain.system([[0.05 * K]], [[1]], [[1]], 0, dt=0.1)
    assert discrete.nominal.dt == 0.1
    with pytest.raises(rp.InvalidInputError, match="sampling time"):
        discrete * rp.uncertain.system([[-K]], [[1]], [[1]])


def test_entries_of_arrays():
    A = np.array([[0, 1], [-K, -1.0]])
    assert rp.uncertain.system(A, [0, 1], [1, 0]).at({"k": 12}).A[1, 0] == pytest.approx(-12)


@pytest.mark.parametrize(
    ("matrices", "says"),
    [
        (([[0, 1]], [[1]], [[1]]), "A: got shape"),
        (([[K]], [[1], [2]], [[1]]), "B: got shape"),
        (([[K]], [[1]], [[1]], [[1, 2]]), "D: got shape"),
        (([["a"]], [[1]], [[1]]), "A"),
        (([[rp.uncertain.dynamics("d")]], [[1]], [[1]]), "dynamic"),
        (([[K, 1], [2]], [[1]], [[1]]), "A"),
    ],
)
def test_bad_matrices(matrices, says):
    with pytest.raises(rp.InvalidInputError, match=says):
        rp.uncertain.system(*matrices)
