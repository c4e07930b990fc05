import numpy as np

from robustpolish.plants.uncertain.lft import reduced_copies


def test_copies_that_nothing_sees_go():
    own, moved = np.zeros((2, 2)), np.array([[1.0, 0], [0, 1]])
    out, into = reduced_copies(own, moved, np.array([[1.0, 2.0]]), 2, (1, 1))
    assert out.shape == (2, 1)
    np.testing.assert_allclose(into @ out, [[1.0]])


def test_a_chain_stays():
    own, moved, seen = np.array([[0.0, 1], [0, 0]]), np.array([[0.0], [1]]), np.array([[1.0, 0]])
    assert reduced_copies(own, moved, seen, 2, (1, 1)) is None


def test_full_blocks():
    # two copies of a 2 x 1 block, both fed by the same signal
    moved = np.array([[1.0], [2.0]])
    out, _ = reduced_copies(np.zeros((2, 4)), moved, np.eye(4), 2, (2, 1))
    assert out.shape == (2, 1)
