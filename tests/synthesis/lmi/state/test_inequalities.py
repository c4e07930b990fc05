"""Each inequality, for a given gain, is exactly the norm, the region or the size it names."""

import numpy as np
import pytest
from hard_plants import random_plant

from robustpolish.synthesis.lmi.program import Affine, SemidefiniteProgram
from robustpolish.synthesis.problem.matrices import (
    PlantMatrices,
    state_gain_norm,
    with_measured_states,
)
from robustpolish.synthesis.problem.pole_regions import Disk, HalfPlane, Sector
from robustpolish.synthesis.state_feedback.lmi import (
    gain_inequality,
    h2_inequality,
    hinf_inequality,
    region_inequalities,
    region_matrix,
)
from robustpolish.synthesis.state_feedback.riccati import lqr_gain


def held_plant(discrete, feedthrough):
    """Return a plant and a gain that stabilises it."""
    plant = with_measured_states(PlantMatrices.of(random_plant(3, 1, singular=False)))
    if discrete:
        A = 1.1 * plant.A / np.abs(np.linalg.eigvals(plant.A)).max()
        plant = plant.replace(A=A, discrete=True)
    if not feedthrough:
        plant = plant.replace(D11=np.zeros_like(plant.D11))
    F = lqr_gain(plant)
    assert F is not None
    return plant, F


@pytest.mark.parametrize("discrete", [False, True])
@pytest.mark.parametrize("norm", ["hinf", "h2"])
def test_the_least_bound_for_a_given_gain_is_its_norm(norm, discrete):
    plant, F = held_plant(discrete, feedthrough=norm == "hinf" or discrete)
    # The congruence changes the numbers only.
    E = np.array([[2.0, 0.5, 0.0], [0.0, 1.0, -0.3], [0.0, 0.0, 0.7]])
    program = SemidefiniteProgram()
    Y = program.symmetric(3)
    if norm == "hinf":
        square = program.scalar()
        hinf_inequality(program, plant, Y, F @ Y, square, E)
    else:
        square = h2_inequality(program, plant, Y, F @ Y, E)
    program.positive(Y)
    program.minimise(square)
    found = np.sqrt(program.solve().value(square).item())
    assert found == pytest.approx(state_gain_norm(plant, F, norm), rel=1e-4)


@pytest.mark.parametrize("region", [HalfPlane(-1.0), Disk(-4.0, 3.5), Sector(0.6, -0.5)])
def test_the_matrix_of_a_region_is_positive_for_poles_inside(region):
    rng = np.random.default_rng(0)
    inside = []
    for a, b in zip(rng.uniform(-9, 1, 60), rng.uniform(0, 5, 60), strict=True):
        # Normal, so that Y = I proves what can be proven; the poles are a + bi and a - bi.
        S = Affine.of([[a, b], [-b, a]])
        matrix = region_matrix(region.L, region.M, Affine.of(np.eye(2)), S).at(np.zeros(0))
        inside.append(np.linalg.eigvalsh(matrix)[0] > 0)
        assert inside[-1] == region.contains([a + 1j * b])
    assert 0 < sum(inside) < 60


def test_a_region_is_kept_by_the_gain_that_is_found():
    plant, _ = held_plant(discrete=False, feedthrough=False)
    regions = HalfPlane(-3.0), Sector(0.5)
    program = SemidefiniteProgram()
    Y, M = program.symmetric(3), program.matrix(2, 3)
    program.positive(Y - np.eye(3))
    region_inequalities(program, plant, Y, M, regions)
    program.minimise(Y.trace)
    found = program.solve()
    F = np.linalg.solve(found.value(Y), found.value(M).T).T
    poles = np.linalg.eigvals(plant.A + plant.B2 @ F)
    assert all(region.contains(poles) for region in regions)
    assert not any(region.contains(np.linalg.eigvals(plant.A)) for region in regions)


def least_size(F, Y, left, right):
    program = SemidefiniteProgram()
    square, given = program.scalar(), Affine.of(Y)
    gain_inequality(program, given, F @ given, square, left, right)
    program.minimise(square)
    return np.sqrt(program.solve().value(square).item())


def test_the_size_of_a_gain_is_exact_at_the_identity_and_safe_elsewhere():
    rng = np.random.default_rng(1)
    F, left, right = (rng.standard_normal(shape) for shape in ((2, 3), (2, 2), (3, 3)))
    right = np.eye(3) + 0.2 * right
    size = np.linalg.norm(left @ F @ right, 2)
    assert least_size(F, np.eye(3), left, right) == pytest.approx(size, rel=1e-6)
    assert least_size(F, np.diag([0.8, 1.0, 1.3]), left, right) > 1.001 * size
