import numpy as np
import pytest
import uncertain_plants

import robustpolish as rp
from robustpolish.base.budget import Budget
from robustpolish.synthesis.problem.matrices import augmented, close_static_loop
from robustpolish.synthesis.uncertain.dk_iteration import k_step, scaled_plant, unit_scalings
from robustpolish.synthesis.uncertain.scaled_gain import (
    LoopResponses,
    RobustProblem,
    controller_matrix,
)


@pytest.mark.parametrize(("name", "signals"), [("lag", 1), ("two_masses", 1), ("column", 2)])
def test_norm_is_that_of_output_feedback(name, signals):
    problem = RobustProblem.of(getattr(uncertain_plants, name)(), signals, signals, 1.0)
    plant = scaled_plant(problem, unit_scalings(problem))
    K = k_step(plant, 1.0, Budget())
    loop = close_static_loop(augmented(plant, len(K.A)), controller_matrix(K))
    assert loop.stable
    omega = np.array([0.0, *np.geomspace(1e-6, 1e6, 600), np.inf])
    norm = np.linalg.norm(LoopResponses.of(loop, omega).M, 2, axis=(1, 2)).max()
    design = rp.output_feedback(problem.plant)
    assert norm <= design.lower_bound * 1.03
