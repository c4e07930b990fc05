"""Sampled designs that several tests share."""

import functools

import robustpolish as rp
from tests.reference import examples as ex
from tests.reference.examples import servo_design


@functools.cache
def sampled_servo(delay=0.02):
    return servo_design().discretize(0.05, delay=delay)


@functools.cache
def two_by_two():
    return ex.two_by_two().discretize(0.05)


def static_gain():
    plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    return rp.given_controller(plant, [[-3.0]]).discretize(0.1)
