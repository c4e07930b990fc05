"""The true model compares at the noise floor, from whatever start and with whatever sensors."""

import numpy as np
import pytest

import robustpolish as rp
from tests.identification.drawn_machines import drawn


def held(seed, most=9000):
    machine = drawn(seed, most)
    found = rp.compare(machine.model, machine.data)
    if not found.reproducible:  # runs of other steps part from each other there
        return
    rmse = np.array([found.outputs[name].rmse for name in machine.model.output_names])
    assert np.max(rmse / machine.noise) < 1.1, seed


@pytest.mark.parametrize("seed", range(5))
def test_the_true_model_runs_at_the_noise(seed):
    held(seed, most=2500)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 220))
def test_the_true_model_runs_at_the_noise_of_longer_records(seed):
    held(seed)
