"""Reduced full-order designs as starts: their order, their sizes, and padding."""

from itertools import islice

import control
import numpy as np
import pytest
from small_plants import FULL, two_masses

from robustpolish.base.budget import Budget
from robustpolish.synthesis.problem.matrices import PlantMatrices, augmented
from robustpolish.synthesis.structured.order_starts import ReducedStarts, padded
from robustpolish.synthesis.structured.search import norm_measure


@pytest.mark.parametrize("norm", ["hinf", "h2"])
@pytest.mark.parametrize("order", [0, 1, 3])
def test_starts_have_the_order_and_stable_ones_come_by_their_norm(norm, order):
    plant = two_masses(FULL)
    starts = ReducedStarts(plant, norm, order, lambda K: K)
    found = list(islice(starts.propose((), Budget(1e5), np.random.default_rng(0)), 10))
    assert all(K.shape == (order + plant.nu, order + plant.ny) for K in found)
    measure = norm_measure(augmented(PlantMatrices.of(plant), order), norm)
    pieces = [measure.pieces(K, 0.0, ()) for K in found]
    values = [p[0].value if p else np.inf for p in pieces]
    assert values == sorted(values)
    if order == 3:
        assert np.isfinite(values[0])


@pytest.mark.parametrize("dt", [0, 1.0])
def test_padding_leaves_the_response_as_it_is(dt):
    K = control.StateSpace([[-0.3]], [[1.0, 2.0]], [[3.0]], [[0.5, 0.0]], dt)
    M = padded(K, 3)
    longer = control.StateSpace(M[:3, :3], M[:3, 3:], M[3:, :3], M[3:, 3:], dt)
    point = np.exp(0.7j) if dt else 0.7j
    assert longer(point) == pytest.approx(K(point))
    assert (np.abs(longer.poles()).max() < 1) if dt else (longer.poles().real.max() < 0)
