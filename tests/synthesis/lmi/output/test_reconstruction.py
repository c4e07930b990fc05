"""Controllers come back from the changed variables, and keep the bound they were asked for."""

import control
import numpy as np
import pytest
from changed_variables import changed, drawn
from hard_plants import random_plant
from published_plants import scherer_1997

from robustpolish.base.budget import Budget
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.synthesis.lmi.output_feedback import (
    bounded_real,
    loop_terms,
    rebalanced,
    reconstruct,
    solve_projected,
    well_conditioned_controllers,
)
from robustpolish.synthesis.lmi.program import ProgramSolver
from robustpolish.synthesis.problem.matrices import PlantMatrices, close


@pytest.mark.parametrize("seed", range(3))
def test_the_controller_that_was_changed_comes_back(seed):
    plant = PlantMatrices.of(random_plant(3, seed)).without_d22()
    K, X, Y = drawn(plant, seed)
    found = reconstruct(plant, changed(plant, K, X, Y)[0])
    assert found is not None
    # In other states, so that only its response is the same.
    for s in (0.0, 1j, 0.3 - 2j):
        given, back = (control.StateSpace(*each)(s) for each in (K, found))
        np.testing.assert_allclose(back, given, rtol=1e-6)


def test_no_factors_where_x_and_y_are_inverse_in_one_direction():
    plant = PlantMatrices.of(random_plant(3, 0)).without_d22()
    K, _, _ = drawn(plant, 0)
    X, Y = np.diag([0.5, 3.0, 4.0]), np.diag([2.0, 1.0, 1.0])
    assert reconstruct(plant, changed(plant, K, X, Y)[0]) is None


def controllers(bound, work=np.inf):
    """Return the loops that are found for a bound on a plant whose optimum is 9.508."""
    solver = ProgramSolver("cvxpy", None, Budget(work))
    plant = PlantMatrices.of(scherer_1997())
    best = solve_projected(plant, 9.51, ProgramSolver("cvxpy", None, Budget()))
    found = None if best is None else rebalanced(plant, best.R, best.S)
    assert found is not None
    frame = found[0]

    def impose(program, v):
        program.positive(-bounded_real(loop_terms(frame, v), bound))

    found = well_conditioned_controllers(frame, "hinf", impose, solver)
    return [(K, control.StateSpace(*close(frame, K))) for K in found]


def test_the_first_keeps_the_bound_with_a_gain_that_is_far_smaller():
    (first, loop), (second, _) = controllers(9.6)
    assert 9.508 < hinf_norm(loop).value <= 9.6
    assert first.gain < 0.01 * second.gain


def test_without_work_or_solution_there_are_none():
    assert controllers(9.6, work=0.0) == []
    assert controllers(8.0) == []
