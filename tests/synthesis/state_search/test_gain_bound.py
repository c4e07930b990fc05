"""State feedback under a bound on the gain, where the optimum is known in closed form."""

import numpy as np
import pytest

from robustpolish.base.budget import Budget
from robustpolish.synthesis.certificate import Norm
from robustpolish.synthesis.problem.matrices import (
    PlantMatrices,
    state_gain_norm,
    with_measured_states,
)
from robustpolish.synthesis.state_feedback.riccati import RiccatiStateEngine
from robustpolish.synthesis.state_feedback.search import GainBound, minimise_bounded


def priced_lag(price, a=-1.0):
    """X' = a x + w + u, z = (x, price u): u = -k x has the norm sqrt(1 + (price k)^2)/(k - a)."""
    one, empty = np.ones((1, 1)), np.zeros((0, 0))
    C1, D12 = np.array([[1.0], [0.0]]), np.array([[0.0], [price]])
    D11 = np.zeros((2, 1))
    return with_measured_states(PlantMatrices(a * one, one, one, C1, empty, D11, D12, empty, empty))


def bounded(plant, bound, norm: Norm = "hinf", left=1.0, right=1.0):
    gain = GainBound(np.array([[left]]), np.array([[right]]), bound)
    return minimise_bounded(RiccatiStateEngine(norm), plant, gain, Budget())


@pytest.mark.parametrize("size", [1e-3, 1.9, 2.1, 1e6])
def test_gains_are_shrunk_to_the_bound_in_the_units_of_the_plant(size):
    bound = GainBound(np.diag([10.0, 1.0]), np.diag([1.0, 0.1, 1.0]), 20.0)
    F = np.array([[0.0, size * 10, 0.0], [0.0, 0.0, 0.0]])
    assert bound.size(F) == pytest.approx(10 * size)
    inside = bound.inside(F)
    assert bound.size(inside) == pytest.approx(min(10 * size, 20.0))
    assert np.allclose(inside * size, F * inside[0, 1] / 10)  # its direction stays
    assert (inside is F) == (size < 2)


def test_a_bound_beyond_the_optimum_leaves_it_alone():
    # With a price of 1 the optimum is k = 1, sqrt(1/2); a thousandth of it may be given away.
    found = bounded(priced_lag(1.0), 5.0)
    assert found is not None
    assert found.achieved == pytest.approx(np.sqrt(0.5), rel=1e-4)
    assert abs(found.F.item()) < 1.1


@pytest.mark.parametrize(("norm", "expected"), [("hinf", 0.25), ("h2", 1 / np.sqrt(8))])
def test_where_control_is_free_the_whole_bound_is_used(norm, expected):
    # 1/(1 + 3), and 1/sqrt(2 (1 + 3)).
    found = bounded(priced_lag(0.0), 3.0, norm)
    assert found is not None
    assert found.achieved == pytest.approx(expected, rel=1e-5)
    assert -3.0 <= found.F.item() < -2.999


def test_the_bound_is_kept_in_the_units_of_the_plant_and_costs():
    # |2 F 5| <= 5 allows k = 1/2 only.
    found = bounded(priced_lag(1.0), 5.0, left=2.0, right=5.0)
    assert found is not None
    assert -0.5 <= found.F.item() < -0.4999
    assert found.achieved == pytest.approx(np.sqrt(1.25) / 1.5, rel=1e-5)
    assert found.achieved == state_gain_norm(priced_lag(1.0), found.F, "hinf")
    assert {entry["step"] for entry in found.history} >= {"price", "descent on the true norm"}


def test_no_answer_where_no_gain_within_the_bound_stabilises():
    # x' = 2 x + u needs k > 2.
    assert bounded(priced_lag(1.0, a=2.0), 1.9) is None
    found = bounded(priced_lag(1.0, a=2.0), 2.5)
    assert found is not None
    assert found.achieved == pytest.approx(np.sqrt(1 + 2.5**2) / 0.5, rel=1e-4)
