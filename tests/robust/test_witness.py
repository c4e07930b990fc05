import numpy as np
import pytest

from robustpolish.robust.loop_model import read_structure
from robustpolish.robust.witness import smallest_delta


def search(M, blocks, w):
    M = np.asarray(M, complex)
    zero = np.zeros_like(M)
    structure = read_structure(blocks)
    found = smallest_delta(structure, lambda _: (M, zero), w, 0.0, False, np.ones(len(w)))
    return structure, found


def test_two_numbers():
    structure, found = search([[2, 2], [-1, -1]], ["complex", "real"], np.array([1.0, -0.8 + 0j]))
    assert found.size == pytest.approx(1 / 3, rel=1e-6)
    delta = found.matrix(structure)
    assert np.linalg.det(np.eye(2) - np.array([[2, 2], [-1, -1]]) @ delta) == pytest.approx(
        0, abs=1e-9
    )


def test_no_start():
    assert search([[1.0]], ["complex"], np.array([0j]))[1] is None


def test_no_real_number_makes_it_singular():
    assert search([[1j]], ["real"], np.array([1 + 0j]))[1] is None
