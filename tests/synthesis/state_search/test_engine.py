"""The engines of state feedback: one form, work counted, and the clock without influence."""

import time

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.base.budget import Budget
from robustpolish.synthesis.problem.matrices import (
    PlantMatrices,
    state_gain_norm,
    with_measured_states,
)
from robustpolish.synthesis.problem.scaling import scale_plant
from robustpolish.synthesis.state_feedback.state_feedback import ENGINES


def priced_mass():
    plant = rp.GeneralizedPlant.from_matrices(
        [[0.0, 1.0], [-50.0, -0.1]],
        [[0.0], [0.5]],
        [[0.0], [0.5]],
        [[1.0, 0.0], [0.0, 0.0]],
        [[1.0, 0.0]],
        D12=[[0.0], [0.1]],
    )
    return with_measured_states(PlantMatrices.of(scale_plant(plant).plant))


@pytest.mark.parametrize("norm", ["hinf", "h2"])
@pytest.mark.parametrize("method", sorted(ENGINES))
def test_every_engine_answers_and_counts_its_work(method, norm):
    plant, budget = priced_mass(), Budget(1e4)
    found = ENGINES[method](norm).search(plant, budget)
    assert found is not None
    assert 0 < budget.spent < 1e4
    assert found.achieved == state_gain_norm(plant, found.F, norm)
    assert found.achieved <= found.claimed
    assert found.status == "suboptimal"  # only a lower bound can tell more
    idle = state_gain_norm(plant, np.zeros((plant.nu, plant.nx)), norm)
    assert found.achieved < idle


def unpriced_plant():
    rng = np.random.default_rng(4)
    A, B1, B2 = rng.normal(size=(4, 4)), rng.normal(size=(4, 2)), rng.normal(size=(4, 2))
    return rp.GeneralizedPlant.from_matrices(A, B1, B2, rng.normal(size=(2, 4)), np.eye(4))


@pytest.mark.long
@pytest.mark.parametrize("options", [{"gain_bound": 6.0}, {"method": "lmi"}])
def test_a_slow_machine_finds_the_same_gain(options, monkeypatch):
    """Four seconds pass with every look at the clock, as on a machine that is thousands slower."""
    plant = unpriced_plant()
    at_ease = rp.state_feedback(plant, time_limit=1e9, **options)
    real, looks = time.monotonic, iter(range(10**9))
    for clock in ("monotonic", "perf_counter"):
        monkeypatch.setattr(time, clock, lambda: real() + 4.0 * next(looks))
    slow = rp.state_feedback(plant, time_limit=1e9, **options)
    assert slow.status == at_ease.status
    assert slow.gain.tobytes() == at_ease.gain.tobytes()


def test_the_end_of_the_work_is_no_lack_of_time(monkeypatch):
    from dataclasses import replace

    from robustpolish.synthesis.state_feedback import state_feedback as module

    short = replace(module.POLICY, work=3e2)
    monkeypatch.setattr(module, "POLICY", short)
    design = rp.state_feedback(unpriced_plant(), gain_bound=6.0)
    assert design.certificate.valid
    assert design.status == "suboptimal"
    assert "ended with its work" in design.message
