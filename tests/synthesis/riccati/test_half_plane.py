"""What no controller reaches over a disc inside the right half plane."""

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.base.budget import DeadlineError
from robustpolish.linear.arithmetic.balls import precision
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.riccati import lower_bound as proof
from robustpolish.synthesis.riccati.lower_bound import PreciseRiccatiPair, proven_lower_bound


def out_of_reach(plant, gamma, bits=768):
    with precision(bits):
        return PreciseRiccatiPair.of(PlantMatrices.of(plant)).is_out_of_reach(gamma)


def sensitivity(pole):
    """Return S of 1/(s - pole), weighted by (s + 2)/(2 s + 1), which is 3/4 at least at a zero."""
    return rp.GeneralizedPlant.from_matrices(
        [[pole, 0.0], [-1.0, -0.5]],
        [[0.0], [1.0]],
        [[1.0], [0.0]],
        [[-0.5, 0.75]],
        [[-1.0, 0.0]],
        D11=[[0.5]],
        D21=[[1.0]],
    )


def test_the_feedthrough_at_infinity_stays():
    # Feedback does nothing there, and elsewhere makes S as small as that.
    plant = sensitivity(-1.0)
    assert out_of_reach(plant, 0.4999)
    assert not out_of_reach(plant, 0.5001)


def test_an_unstable_zero_bounds_the_weighted_sensitivity():
    # G = (s - 1)/(s + 1)^2, with S(1) = 1, so that W(1) = 1 with W = (s + 2)/(2 s + 1).
    plant = rp.GeneralizedPlant.from_matrices(
        [[0.0, 1.0, 0.0], [-1.0, -2.0, 0.0], [1.0, -1.0, -0.5]],
        [[0.0], [0.0], [1.0]],
        [[0.0], [1.0], [0.0]],
        [[0.5, -0.5, 0.75]],
        [[1.0, -1.0, 0.0]],
        D11=[[0.5]],
        D21=[[1.0]],
    )
    assert out_of_reach(plant, 0.9999)
    assert not out_of_reach(plant, 1.0001)


@pytest.mark.parametrize("inputs", [1, 2, 3])
def test_controls_that_depend_on_others_do_not_matter(inputs):
    rng = np.random.default_rng(5)
    A, B1, C1, C2 = (rng.standard_normal(shape) for shape in ((4, 4), (4, 2), (2, 4), (1, 4)))
    B2, D12, D21 = rng.standard_normal((4, 1)), rng.standard_normal((2, 1)), [[0.0, 1.0]]
    turn = np.array([[1.0, 2.0, -0.5]])[:, :inputs]
    one = rp.GeneralizedPlant.from_matrices(A, B1, B2, C1, C2, D12=D12, D21=D21)
    bound = rp.output_feedback(one).lower_bound
    many = rp.GeneralizedPlant.from_matrices(A, B1, B2 @ turn, C1, C2, D12=D12 @ turn, D21=D21)
    assert out_of_reach(many, 0.999 * bound)
    assert not out_of_reach(many, 1.01 * bound)


def test_with_more_controls_than_outputs_the_rest_is_free():
    # Both states are set at will and seen without noise: any norm is reached.
    plant = rp.GeneralizedPlant.from_matrices(
        [[1.0, 1.0], [0.0, 2.0]], np.eye(2), np.eye(2), [[1.0, 1.0]], np.eye(2)
    )
    assert not out_of_reach(plant, 1e-6)


def double_integrator():
    return PlantMatrices.of(
        rp.GeneralizedPlant.from_matrices(
            [[0.0, 1.0], [0.0, 0.0]],
            [[0.0, 0.0], [1.0, 0.0]],
            [[0.0], [1.0]],
            [[1.0, 0.0], [0.0, 0.0]],
            [[1.0, 0.0]],
            D12=[[0.0], [1.0]],
            D21=[[0.0, 1.0]],
        )
    )


@pytest.mark.parametrize("guess", [0.0, 1e-20, 1.0, 2.6, 1e20])
def test_a_wrong_guess_takes_longer_only(guess):
    found = proven_lower_bound(double_integrator(), guess, 1e-3)
    assert found == pytest.approx(proven_lower_bound(double_integrator(), 2.58, 1e-4), rel=1.2e-3)


def test_when_the_time_is_over_what_was_proven_is_returned(monkeypatch):
    full = proven_lower_bound(double_integrator(), 2.0, 1e-3)
    looks = [True, True, True]

    def look():
        if not looks:
            raise DeadlineError
        looks.pop()

    monkeypatch.setattr(proof, "check_deadline", look)
    assert 1.9 < proven_lower_bound(double_integrator(), 2.0, 1e-3) < 0.999 * full
    assert proven_lower_bound(double_integrator(), 2.0, 1e-3) == 0
