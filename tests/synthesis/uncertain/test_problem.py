import numpy as np
import pytest
import uncertain_plants

import robustpolish as rp
from robustpolish.synthesis.problem.matrices import Controller
from robustpolish.synthesis.uncertain.scaled_gain import (
    RobustProblem,
    controller_from_matrix,
    controller_matrix,
)


def test_level_and_controller_are_those_of_the_plant():
    plant = uncertain_plants.two_masses()
    problem = RobustProblem.of(plant, 1, 1, 2.0)
    assert [b.kind for b in problem.structure.blocks] == ["real", "full"]
    design = rp.output_feedback(rp.GeneralizedPlant(plant.nominal, 1, 1))
    scaled = problem.part.scaled
    K = design.controller
    own = Controller(
        K.A * scaled.time,
        K.B * scaled.time * scaled.measurement,
        K.C / scaled.control[:, None],
        K.D * scaled.measurement / scaled.control[:, None],
    )
    coverage, model = problem.cover(problem.loop(own), 0.0)
    truth = rp.robust_performance(plant.lft(K), 2.0)
    assert coverage.complete
    assert coverage.level * model.gain == pytest.approx(truth.mu[1], rel=3e-3)
    back = problem.controller(own)
    assert back(0.7j) == pytest.approx(K(0.7j), rel=1e-9)


def test_every_copy_becomes_a_complex_number_of_its_own():
    m = rp.uncertain.real("m", 1.0, percent=10)
    plant = rp.uncertain.system([[-m]], [[1.0, m * m]], [[1.0], [m]])
    problem = RobustProblem.of(plant, 1, 1, 1.0)
    copies = problem.structure.blocks[0].copies
    assert copies > 1
    kinds = [(b.kind, b.copies) for b in problem.as_complex.blocks]
    assert kinds == [("complex", 1)] * (copies + 1)


def test_stacked_matrices_come_apart_again():
    K = Controller(np.eye(2), np.ones((2, 1)), np.ones((1, 2)), np.zeros((1, 1)))
    for one, other in zip(controller_from_matrix(controller_matrix(K), 2), K, strict=True):
        assert (one == other).all()
