import numpy as np
import pytest

from robustpolish.robust.loop_model import read_structure
from robustpolish.robust.scalings import Inequality, Space, balanced


def test_scalings_commute_with_delta():
    structure = read_structure([("real", 2), ("full", (2, 3))])
    space = Space(structure, (False, False))
    assert space.size == 4 + 1 + 4
    x = np.random.default_rng(0).standard_normal(space.size)
    Dz, _, Dw, G = space.matrices(x)
    delta = np.zeros((4, 5))
    delta[:2, :2], delta[2:, 2:] = 0.7 * np.eye(2), np.arange(6).reshape(2, 3)
    np.testing.assert_allclose(delta @ Dz, Dw @ delta, atol=1e-12)
    np.testing.assert_allclose(G[:2, :2], np.conj(G[:2, :2].T))
    assert not G[2:].any()


def test_level_of_the_identity_is_the_norm():
    M = np.random.default_rng(1).standard_normal((3, 3)) + 0j
    inequality = Inequality(Space(read_structure([("full", 3)]), (False,)), M[None])
    assert inequality.least_square(np.array([0.5])) == pytest.approx(np.linalg.norm(M, 2) ** 2)


def test_balance():
    d = balanced(np.array([[1.0, 100.0], [1.0, 1.0]]))
    assert d[0] * 100 / d[1] == pytest.approx(d[1] / d[0], rel=1e-2)
