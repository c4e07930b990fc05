"""Frequencies and gains that suit a loop, whatever its weights."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.structured.block_wiring import LoopUnits, place_blocks


def test_weights_do_not_belong_to_the_loop():
    G = control.tf([4.0], [1.0, 2.0], inputs="F", outputs="x")
    plant = rp.mixed_sensitivity(G, performance=rp.weight(1e4, 1e-3, 0.5), effort=0.1)
    units = LoopUnits(PlantMatrices.of(plant))
    assert units.band == pytest.approx((2.0 / 30, 20.0))
    at = LoopUnits(PlantMatrices.of(plant), 6.0)
    placement = place_blocks(rp.tunable.pid("x"), plant)
    sizes = [at.size(placement.blocks[0], 0, slot) for slot in placement.blocks[0].stages[0].slots]
    gain = abs(2.0 + 6.0j) / 4.0
    assert sizes == pytest.approx([gain, gain * 6.0, gain / 6.0, 1 / 6.0])


def test_a_plant_of_integrators_has_a_band_too():
    plant = rp.GeneralizedPlant.from_loop(control.tf([1.0], [1.0, 0.0, 0.0]))
    low, high = LoopUnits(PlantMatrices.of(plant)).band
    assert 0 < low < 1 < high < np.inf
