"""The inequalities in changed variables are those of the loop, seen through a congruence."""

import numpy as np
import pytest
from changed_variables import changed, drawn
from hard_plants import random_plant
from published_plants import zhou_h2
from scipy.linalg import block_diag

from robustpolish.synthesis.lmi.output_feedback import (
    LmiVariables,
    assemble_blocks,
    bounded_real,
    coupling,
    impose_h2,
    loop_terms,
    variable_bound,
)
from robustpolish.synthesis.lmi.program import Affine, SemidefiniteProgram
from robustpolish.synthesis.problem.matrices import PlantMatrices, close

NOTHING = np.zeros(0)


def constant(variables):
    return LmiVariables(*(Affine.of(M) for M in variables))


@pytest.mark.parametrize("seed", range(3))
def test_bounded_real_is_that_of_the_loop(seed):
    plant = PlantMatrices.of(random_plant(3, seed)).without_d22()
    K, X, Y = drawn(plant, seed)
    variables, M, N = changed(plant, K, X, Y)
    gamma = 7.0
    found = bounded_real(loop_terms(plant, constant(variables)), gamma).at(NOTHING)
    # P first = second defines the Lyapunov matrix P of the loop.
    n = plant.nx
    first = np.block([[X, np.eye(n)], [M.T, np.zeros((n, n))]])
    second = np.block([[np.eye(n), Y], [np.zeros((n, n)), N.T]])
    P = np.linalg.solve(first.T, second.T).T
    A, B, C, D = close(plant, K)
    nw, nz = plant.nw, plant.nz
    loop = np.block(
        [
            [A.T @ P + P @ A, P @ B, C.T],
            [B.T @ P, -gamma * np.eye(nw), D.T],
            [C, D, -gamma * np.eye(nz)],
        ]
    )
    seen = block_diag(first, np.eye(nw + nz))
    np.testing.assert_allclose(found, seen.T @ loop @ seen, rtol=1e-7, atol=1e-7)


def test_least_energy_is_the_published_h2_optimum():
    plant, program = PlantMatrices.of(zhou_h2()), SemidefiniteProgram()
    v = LmiVariables.of(program, plant, "h2")
    square = impose_h2(program, loop_terms(plant, v), v)
    program.minimise(square)
    solution = program.solve()
    assert np.sqrt(solution.value(square).item()) == pytest.approx(8.9582, rel=1e-4)


@pytest.mark.parametrize(("norm", "free"), [("hinf", [[1, 1], [1, 1]]), ("h2", [[1, 1], [0, 1]])])
def test_for_the_h2_norm_only_what_is_unpriced_or_exact_feeds_through(norm, free):
    # The first control has no price, the second measurement no noise.
    plant = PlantMatrices.of(random_plant(3, 0)).replace(
        D12=np.array([[0.0, 1.0], [0.0, 0.0], [0.0, 0.0]]),
        D21=np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]),
    )
    program = SemidefiniteProgram()
    v = LmiVariables.of(program, plant, norm)
    np.testing.assert_array_equal(v.D.at(np.ones(program.unknowns)), free)


def test_size_and_coupling_are_the_largest_that_fit():
    plant = PlantMatrices.of(random_plant(2, 1)).without_d22()
    K, X, Y = drawn(plant, 1)
    variables, _, _ = changed(plant, K, X, Y)
    program = SemidefiniteProgram()
    v = constant(variables)
    size, beta = variable_bound(program, v), program.scalar()
    coupling(program, v, beta)
    program.minimise(size - beta)
    found = program.solve()
    whole = np.block([[variables.A, variables.B], [variables.C, variables.D]])
    largest = max(np.linalg.norm(part, 2) for part in (X, Y, whole))
    assert found.value(size).item() == pytest.approx(largest, rel=1e-6)
    # [X, beta I; beta I, Y] >= 0 up to the smallest eigenvalue of X Y.
    least = np.sqrt(np.linalg.eigvals(X @ Y).real.min())
    assert found.value(beta).item() == pytest.approx(least, rel=1e-6)


def test_blocks_are_stacked_as_numpy_does():
    program = SemidefiniteProgram()
    blocks = [
        [program.matrix(2, 3), program.matrix(2, 1)],
        [program.matrix(1, 3), program.scalar()],
    ]
    x = np.arange(12.0)
    expected = np.block([[part.at(x) for part in row] for row in blocks])
    np.testing.assert_array_equal(assemble_blocks(blocks).at(x), expected)
