"""Proposals of starts: their order, what they change, and gains that stabilise."""

from itertools import islice

import numpy as np
import pytest
from small_plants import static_plant

from robustpolish.base.budget import Budget
from robustpolish.synthesis.structured.search import POLICY
from robustpolish.synthesis.structured.starts import (
    DrawnStarts,
    KnownStarts,
    RegulatorStart,
    StabilisingStart,
    regulator,
)

GOLDEN = (1 + np.sqrt(5)) / 2
ONE, NONE = np.ones((1, 1)), np.zeros((1, 1))


def proposed(starts, count=10, earlier=(), seed=0):
    rng = np.random.default_rng(seed)
    return list(islice(starts.propose(earlier, Budget(), rng), count))


def same(K):
    """Every entry is a free number."""
    return K.ravel()


def test_known_points_come_in_their_order():
    points = [np.array([2.0]), np.array([1.0])]
    assert proposed(KnownStarts(points)) == points


def test_drawn_changes_keep_to_their_size():
    earlier = (np.array([0.0, 100.0]), np.array([5.0, 5.0]))
    small = proposed(DrawnStarts(-3, -3), 300, earlier)
    apart = np.array([min((p - e for e in earlier), key=np.linalg.norm) for p in small])
    near_first = np.array([np.abs(p - earlier[0]).max() < 1 for p in small])
    assert 0.3 < near_first.mean() < 0.7  # either of the earlier points is changed
    # In proportion to |x| + 0.1: 0.1 and 100.1 at the first point, times 1e-3.
    assert apart[near_first].std(axis=0) == pytest.approx([1e-4, 0.1001], rel=0.25)
    absolute = np.array(proposed(DrawnStarts(0, 0, relative=False, base=earlier[0]), 300, earlier))
    assert (absolute - earlier[0]).std(axis=0) == pytest.approx([1.0, 1.0], rel=0.25)


def test_the_same_seed_draws_the_same_starts():
    drawn = DrawnStarts(-1, 1, base=np.ones(3))
    first, again, other = (np.array(proposed(drawn, seed=seed)) for seed in (4, 4, 5))
    assert np.array_equal(first, again)
    assert not np.isin(first, other).any()


def test_regulators_in_closed_form():
    # x' = x + u with x^2 + u^2: X = 1 + sqrt(2). x+ = x + u: X is the golden ratio.
    F = regulator(ONE, ONE, ONE, ONE, NONE, discrete=False)
    assert F is not None
    assert F.item() == pytest.approx(-(1 + np.sqrt(2)))
    F = regulator(ONE, ONE, ONE, ONE, NONE, discrete=True)
    assert F is not None
    assert F.item() == pytest.approx(-GOLDEN / (1 + GOLDEN))
    # (x + u)^2 is made zero by u = -x, which leaves x' = 0.5 x - x stable.
    F = regulator(0.5 * ONE, ONE, ONE, ONE, ONE, discrete=False)
    assert F is not None
    assert F.item() == pytest.approx(-1.0)


@pytest.mark.parametrize("discrete", [False, True])
def test_no_regulator_where_nothing_stabilises(discrete):
    assert regulator(2 * ONE, NONE, ONE, ONE, NONE, discrete) is None


def test_the_gain_of_the_pattern_nearest_to_the_regulator():
    plant = static_plant(np.diag([1.0, 1.0]), np.eye(2), np.diag([1.0, 2.0]))
    mask = np.array([[True, False], [True, True]])
    (theta,) = proposed(RegulatorStart(plant, mask, same))
    # F = -(1 + sqrt(2)) I, and y_2 = 2 x_2.
    assert theta == pytest.approx(-(1 + np.sqrt(2)) * np.array([1, 0, 0, 0.5]), abs=1e-12)
    lost = static_plant(np.diag([1.0, -1.0]), [[0.0], [1.0]], np.eye(2))
    assert proposed(RegulatorStart(lost, np.ones((1, 2), bool), same)) == []


def test_a_stabilising_gain_where_few_are():
    # An oscillator that is pushed apart: k2 > 0 and k1 > 4 are needed, u = -k y.
    plant = static_plant([[0.0, 1.0], [4.0, 0.5]], [[0.0], [1.0]], np.eye(2))
    (theta,) = proposed(StabilisingStart(plant, np.ones((1, 2), bool), same))
    closed = plant.A + plant.B2 @ theta.reshape(1, 2) @ plant.C2
    assert np.linalg.eigvals(closed).real.max() < 0


def test_semidefinite_programs_are_left_to_small_plants():
    n = POLICY.stabilising_states + 1
    plant = static_plant(-np.eye(n), np.ones((n, 1)), np.ones((1, n)))
    assert proposed(StabilisingStart(plant, np.ones((1, 1), bool), same)) == []
