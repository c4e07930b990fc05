"""Where the search for the numbers of blocks starts: given values, limits, signs."""

from itertools import islice

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.base.budget import Budget
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.scaling import scale_plant
from robustpolish.synthesis.structured.block_structure import BlockStarts
from robustpolish.synthesis.structured.block_wiring import LoopUnits, place_blocks


def starts(block, initial=None):
    plant = rp.GeneralizedPlant.from_loop(control.tf([3.0], [1.0, 0.4, 4.0]))
    scaled = scale_plant(plant)
    units = LoopUnits(PlantMatrices.of(scaled.plant))
    return BlockStarts(place_blocks(block, plant), scaled, units, initial or {})


def numbers(found, count):
    drawn = islice(found.propose((), Budget(), np.random.default_rng(0)), count)
    return np.array([found.gain.numbers(theta) for theta in drawn])


def test_given_values_come_first_and_are_not_forgotten():
    Kp = rp.tunable.tunable("Kp", 7.0, low=1.0, high=9.0)
    found = numbers(starts(rp.tunable.pid(kind="PI", Kp=Kp), {"pid_y[0].Ki": -0.3}), 40)
    assert found[0] == pytest.approx([7.0, -0.3])
    assert (found[:, 0] >= 1.0).all()
    assert (found[:, 0] <= 9.0).all()
    assert np.ptp(found[:, 0]) > 1.0


def test_free_gains_come_with_both_signs_and_the_rest_positive():
    found = numbers(starts(rp.tunable.pid()), 40)
    assert (found[:, 3] > 0).all()
    assert 5 < (found[1:, 0] > 0).sum() < 35
    alike = (np.sign(found[:, 0]) == np.sign(found[:, 2])).mean()
    assert alike > 0.5


def test_limits_turn_signs_round():
    positive = {n: rp.tunable.tunable(n, low=0.0) for n in ("Kp", "Ki", "Kd")}
    assert (numbers(starts(rp.tunable.pid(**positive)), 40) > 0).all()
    negative = numbers(starts(rp.tunable.pid(kind="PI", Ki=rp.tunable.tunable("Ki", high=0.0))), 40)
    assert (negative[:, 1] < 0).all()
