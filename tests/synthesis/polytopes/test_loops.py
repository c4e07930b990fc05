"""Loops in balls and of uncertain systems are those that python-control closes."""

import control
import numpy as np
import pytest
from polytope_examples import held_mass

import robustpolish as rp
from robustpolish.synthesis.problem.matrices import Controller, PlantMatrices
from robustpolish.synthesis.scheduled.proof import output_loop, state_loop, uncertain_loop

F = np.array([[-1.0, -2.0]])


def test_state_and_output_feedback_in_balls():
    plant = held_mass(2.0)
    loop = state_loop(PlantMatrices.of(plant), F).doubles
    expected = plant.state_feedback_loop(F)
    for own, name in zip(loop, "ABCD", strict=True):
        assert own == pytest.approx(getattr(expected, name), abs=1e-15)
    K = Controller(*(np.array(M) for M in ([[-3.0]], [[2.0]], [[-1.0]], [[-0.5]])))
    loop = output_loop(PlantMatrices.of(plant), K).doubles
    expected = plant.closed_loop(control.StateSpace(*K))
    for own, name in zip(loop, "ABCD", strict=True):
        assert own == pytest.approx(getattr(expected, name), abs=1e-15)


def test_the_loop_of_an_uncertain_system():
    k = rp.uncertain.real("k", 5.0, percent=80)
    mass = rp.uncertain.system([[0, 1], [-k, -0.1]], [[0, 0], [1, 1]], [[1, 0]], 0)
    loop = uncertain_loop(mass, 1, F).at({"k": 7.0})
    assert pytest.approx(np.array([[0, 1], [-8, -2.1]])) == loop.A
    assert (loop.ninputs, loop.noutputs) == (1, 1)
