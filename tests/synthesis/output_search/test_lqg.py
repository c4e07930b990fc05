"""H2 output feedback by Riccati equations: a closed form, and limits of plants without price."""

import numpy as np
import pytest
from output_tasks import LAG_H2, settings, task, unstable_lag

from robustpolish.base.budget import Budget
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.output_feedback.riccati import Lqg


def search(plant, budget=None):
    problem = task(plant, "h2", bounded=False)
    return Lqg(settings("h2")).search(problem, budget or Budget())


def test_a_regular_plant_takes_one_pair_of_equations():
    found = search(unstable_lag())
    (candidate,) = found.candidates
    assert candidate.achieved == pytest.approx(LAG_H2, rel=1e-6)
    assert found.history[0]["epsilon"] == 0.0
    assert not found.falling
    # u = F xhat and xhat' = (a + F + L) xhat - L y with F = L = -(1 + sqrt(2)).
    K, x = candidate.controller, 1 + np.sqrt(2)
    assert K.A.item() == pytest.approx(1 - 2 * x)
    assert K.B.item() * K.C.item() == pytest.approx(-x * x)


def test_a_norm_that_falls_with_the_regularisation_is_told():
    # Without price and noise any norm above zero is reached by a large gain.
    found = search(unstable_lag(price=0.0, noise=0.0))
    assert found.falling
    norms = [entry["achieved"] for entry in found.history]
    assert norms == sorted(norms, reverse=True)
    assert found.best < 1e-2 * norms[0]


def test_a_singular_plant_whose_norm_settles_is_not_falling():
    # The lag that is disturbed and watched is not the one that is measured and moved.
    plant = GeneralizedPlant.from_matrices(
        np.diag([-1.0, 1.0]), [[1.0], [0.0]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0, 1.0]]
    )
    found = search(plant)
    assert not found.falling
    assert found.best == pytest.approx(np.sqrt(0.5), rel=1e-6)
    assert len(found.history) < 5  # two rungs without a fall are enough


def test_it_ends_with_its_work():
    plant = unstable_lag(price=0.0, noise=0.0)
    short = Budget(4.0)
    assert 0 < len(search(plant, short).history) < len(search(plant).history)
    assert short.exhausted
