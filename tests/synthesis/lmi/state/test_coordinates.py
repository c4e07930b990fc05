"""Coordinates change the numbers that a solver sees, and nothing else."""

import numpy as np
import pytest
from hard_plants import random_plant
from scipy.linalg import solve_continuous_lyapunov

from robustpolish.synthesis.problem.matrices import (
    PlantMatrices,
    state_gain_norm,
    with_measured_states,
)
from robustpolish.synthesis.state_feedback.lmi import Coordinates
from robustpolish.synthesis.state_feedback.riccati import lqr_gain

PLANT = with_measured_states(PlantMatrices.of(random_plant(4, 1, singular=False)))
RNG = np.random.default_rng(0)
COORDINATES = Coordinates(RNG.standard_normal((4, 4)), np.diag([10.0, 0.2]), np.eye(4), 30.0)


@pytest.mark.parametrize("norm", ["hinf", "h2"])
def test_norms_of_loops_are_divided_by_the_unit(norm):
    # The H2 norm of a loop with feedthrough is infinite.
    plant = PLANT if norm == "hinf" else PLANT.replace(D11=np.zeros_like(PLANT.D11))
    inside = COORDINATES.apply(plant)
    gain = lqr_gain(inside)
    assert gain is not None
    outside = COORDINATES.gain(np.eye(4), gain)
    expected = state_gain_norm(plant, outside, norm) / 30.0
    assert state_gain_norm(inside, gain, norm) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("even_out", [True, False])
def test_in_the_next_coordinates_the_solution_is_the_identity(even_out):
    plant = COORDINATES.apply(PLANT)
    gain = lqr_gain(plant)
    assert gain is not None
    Y = solve_continuous_lyapunov(plant.A + plant.B2 @ gain, -np.diag([1.0, 2.0, 3.0, 4.0]))
    following = COORDINATES.next(plant, Y, gain @ Y, even_out)
    back = np.linalg.solve(following.T, COORDINATES.T)
    np.testing.assert_allclose(back @ Y @ back.T, np.eye(4), atol=1e-8)
    # The same gain there: F = F_new with u and x in their new units, each u of size one.
    F = COORDINATES.gain(Y, gain @ Y)
    there = np.linalg.solve(following.V, F @ following.T)
    np.testing.assert_allclose(np.linalg.norm(there, axis=1), 1.0, rtol=1e-8)
    q = following.apply(PLANT)
    lyapunov = -(q.A + q.B2 @ there) - (q.A + q.B2 @ there).T
    evened = following.E.T @ lyapunov @ following.E
    assert np.allclose(evened, np.eye(4), atol=1e-7) == even_out
    np.testing.assert_array_equal(following.without_congruence().E, np.eye(4))


def test_without_a_positive_solution_there_are_no_next_ones():
    plant = COORDINATES.apply(PLANT)
    with pytest.raises(np.linalg.LinAlgError, match="Y is not positive"):
        COORDINATES.next(plant, -np.eye(4), np.zeros((2, 4)), True)


def test_plain_coordinates_leave_the_plant_as_it_is():
    same = Coordinates.plain(PLANT, 1.0).apply(PLANT)
    for name in ("A", "B1", "B2", "C1", "C2", "D11", "D12", "D21"):
        np.testing.assert_array_equal(getattr(same, name), getattr(PLANT, name))
