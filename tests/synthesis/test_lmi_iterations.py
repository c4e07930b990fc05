"""Cone complementarity finds stabilising gains; fixed modes are found before."""

import numpy as np
import pytest

from robustpolish.budget import Budget
from robustpolish.synthesis.lmi.stabilising_gain import stabilising_gain
from robustpolish.synthesis.problem.fixed_modes import unstable_fixed_modes
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.static_loop import close_static
from robustpolish.synthesis.structured_search.starts import ProgramSolver

solve = ProgramSolver(Budget(), tolerance=1e-7)


def loop(A, B, C, discrete=False):
    A, B, C = (np.atleast_2d(np.array(M, float)) for M in (A, B, C))
    n, nu, ny = len(A), B.shape[1], len(C)
    eye, zeros = np.eye(n), np.zeros
    return PlantMatrices(
        A,
        eye,
        B,
        eye,
        C,
        zeros((n, n)),
        zeros((n, nu)),
        zeros((ny, n)),
        zeros((ny, nu)),
        discrete,
    )


@pytest.mark.parametrize("discrete", [False, True])
def test_finds_a_stabilising_gain(discrete):
    rng = np.random.default_rng(5)
    for _ in range(3):
        A = rng.normal(size=(4, 4))
        if discrete:
            A /= 0.8 * np.abs(np.linalg.eigvals(A)).max()
        plant = loop(A, rng.normal(size=(4, 2)), rng.normal(size=(3, 4)), discrete)
        K = stabilising_gain(plant, np.ones((2, 3), bool), solve)
        assert close_static(plant, K).stable


def test_respects_a_pattern():
    plant = loop(np.diag([0.5, 0.3]), np.eye(2), [[1.0, 0.2], [0.1, 1.0]])
    mask = np.eye(2, dtype=bool)
    K = stabilising_gain(plant, mask, solve)
    assert (K[~mask] == 0).all()
    assert close_static(plant, K).stable


def test_fixed_modes_of_full_and_patterned_gains():
    names = ("a", "b", "c")
    seen = loop(np.diag([0.5, -1.0, 2.0]), [[1], [1], [1]], [[1.0, 1.0, 0.0]])
    (mode,) = unstable_fixed_modes(seen, np.ones((1, 1), bool), names)
    assert (mode.value, mode.state) == (2.0, "c")
    whole = loop(np.diag([0.5, -1.0, 2.0]), np.eye(3), np.eye(3))
    assert unstable_fixed_modes(whole, np.eye(3, dtype=bool), names) == ()
    cyclic = np.array([[0, 1, 0], [0, 0, 0], [0, 0, 0]], bool)
    assert [m.state for m in unstable_fixed_modes(whole, cyclic, names)] == ["a", "c"]
    rotor = loop([[0.1, 5.0], [-5.0, 0.1]], [[0.0], [0.0]], np.eye(2))
    (mode,) = unstable_fixed_modes(rotor, np.ones((1, 2), bool), ("p", "q"))
    assert mode.value == pytest.approx(0.1 + 5j)
