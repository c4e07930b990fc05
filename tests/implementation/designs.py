"""Sampled designs that several tests share."""

import functools

import control
import numpy as np

import robustpolish as rp


def servo():
    """Two masses and a spring, force on one, position of the other measured with noise."""
    A = np.array([[0, 1, 0, 0], [-4, -0.04, 4, 0.04], [0, 0, 0, 1], [4, 0.04, -4, -0.04]])
    return rp.GeneralizedPlant.from_matrices(
        A,
        [[0, 0], [1, 0], [0, 0], [0, 0]],
        [[0], [1], [0], [0]],
        [[0, 0, 1, 0], [0, 0, 0, 0]],
        [[0, 0, 1, 0]],
        D12=[[0], [0.5]],
        D21=[[0, 0.2]],
        controls=["F"],
        measurements=["x"],
        units={"F": "N", "x": "m"},
    )


@functools.cache
def servo_design():
    return rp.output_feedback(servo())


@functools.cache
def sampled_servo(delay=0.02):
    return servo_design().discretize(0.05, delay=delay)


@functools.cache
def two_by_two():
    """Two measurements, two controls, an integrator in the controller."""
    plant = rp.GeneralizedPlant.from_matrices(
        [[-1.0, 0.2], [0.1, -0.5]], np.eye(2), np.eye(2), np.eye(2), np.eye(2)
    )
    K = control.ss(np.diag([0.0, -3.0]), np.eye(2), -np.eye(2), [[-1.0, 0.1], [0.0, -0.5]])
    return rp.given_controller(plant, K).discretize(0.05)


def static_gain():
    plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    return rp.given_controller(plant, [[-3.0]]).discretize(0.1)
