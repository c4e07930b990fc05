"""The infimum of regular and singular problems, from Riccati equations alone."""

import control
import numpy as np
import pytest
from published_plants import compleib

import robustpolish as rp
from robustpolish.base.budget import Budget
from robustpolish.linear.arithmetic.balls import precision
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.preflight import SolverPlant, scale_plant
from robustpolish.synthesis.riccati.gamma import (
    PROVABLE_STATES,
    PROVEN,
    PreciseRiccatiPair,
    lower_bound,
)
from tests.synthesis.weighted_servos import drawn, realisations

# Infima of the full-order H-infinity norm of COMPleib plants, most of them singular.
INFIMUM = {
    "AC1": 0.0,
    "AC4": 0.557292,
    "AC8": 1.61648,
    "HE1": 0.0736154,
    "NN2": 1.76438,
    "ROC6": 21.5279,
}


def bound_of(plant, tolerance=1e-4):
    scaled = scale_plant(plant)
    found = lower_bound(PlantMatrices.of(scaled.plant), tolerance, Budget())
    assert found is not None
    return scaled.norm(found.value), found.how


@pytest.mark.shared
@pytest.mark.parametrize("name", INFIMUM)
def test_infimum_of_singular_plants(shared, name):
    value, how = bound_of(compleib(shared, name))
    assert value == pytest.approx(INFIMUM[name], rel=2e-4)
    assert how == PROVEN


@pytest.mark.parametrize("seed", range(5))
def test_the_infimum_does_not_depend_on_coordinates(seed):
    rng = np.random.default_rng(seed)
    draw = rng.standard_normal
    A, B1, B2, C1, C2 = draw((4, 4)), draw((4, 3)), draw((4, 2)), draw((3, 4)), draw((2, 4))
    D12 = np.outer(draw(3), [1.0, 0.0])  # the second control has no price
    D21 = np.outer([0.0, 1.0], draw(3))  # the first measurement has no noise
    T = draw((4, 4))
    turned = (
        np.linalg.solve(T, A @ T),
        np.linalg.solve(T, B1),
        np.linalg.solve(T, B2),
        C1 @ T,
        C2 @ T,
    )
    first = bound_of(rp.GeneralizedPlant.from_matrices(A, B1, B2, C1, C2, D12=D12, D21=D21))
    second = bound_of(rp.GeneralizedPlant.from_matrices(*turned, D12=D12, D21=D21))
    assert first[1] == second[1] == PROVEN
    assert first[0] == pytest.approx(second[0], rel=2e-4)


def test_no_controller_comes_below_the_bound_and_one_comes_near():
    rng = np.random.default_rng(3)
    draw = rng.standard_normal
    plant = rp.GeneralizedPlant.from_matrices(
        draw((4, 4)), draw((4, 2)), draw((4, 1)), draw((2, 4)), draw((1, 4)), D12=draw((2, 1))
    )
    value, _ = bound_of(plant)
    design = rp.output_feedback(plant)
    assert value <= design.certificate.achieved <= value * 1.004
    assert design.lower_bound == pytest.approx(value, rel=2e-4)


def bounds_of_realisations(seed):
    plants = realisations(*drawn(seed))
    return np.array([bound_of(plant, 1e-3)[0] for plant in plants])


# In double precision the bounds of one and the same plant differed by factors up to three.
@pytest.mark.parametrize(
    "seed",
    [7, 29, pytest.param(42, marks=pytest.mark.long), pytest.param(50, marks=pytest.mark.long)],
)
def test_units_and_last_digits_do_not_change_the_bound(seed):
    found = bounds_of_realisations(seed)
    assert found.max() <= found.min() * (1 + 2e-3)


@pytest.mark.long
@pytest.mark.parametrize("start", range(51, 111, 10))
def test_units_and_last_digits_do_not_change_the_bound_of_any_servo(start):
    for seed in range(start, start + 10):
        found = bounds_of_realisations(seed)
        assert found.max() <= found.min() * (1 + 2e-3), seed


def test_a_bound_of_many_states_is_an_estimate():
    rng = np.random.default_rng(0)
    n = PROVABLE_STATES + 1
    plant = rp.GeneralizedPlant.from_matrices(
        -np.diag(np.arange(1.0, n + 1)),
        rng.standard_normal((n, 2)),
        rng.standard_normal((n, 1)),
        np.vstack([rng.standard_normal((1, n)), np.zeros((1, n))]),
        rng.standard_normal((1, n)),
        D12=[[0.0], [1.0]],
        D21=[[0.0, 1.0]],
    )
    found = lower_bound(PlantMatrices.of(scale_plant(plant).plant), 1e-3, Budget())
    assert found is not None
    assert not found.proven
    assert "estimated" in found.how


def levitation(delay, weight):
    """A magnetically levitated ball, unstable, with a weight on T."""
    pole = 66.94
    system = control.ss(control.tf([-36.27], np.poly([pole, -pole, -45.69])))
    system = control.ss(system, inputs="voltage", outputs="gap")
    plant = rp.GeneralizedPlant(system, measurements="gap", controls="voltage")
    delayed = plant.with_delay("voltage", delay)
    return rp.mixed_sensitivity(delayed, robustness=weight).without_delays(), pole


@pytest.mark.parametrize("delay", [1e-4, 1e-3, 5e-3])
@pytest.mark.parametrize("order", [1, 2])
def test_the_bound_of_an_unstable_plant_with_delay_is_the_analytic_one(delay, order):
    weight = rp.weight(0.999, 2000.0, 100.0, order=order)
    plant, pole = levitation(delay, weight)
    part = SolverPlant.of(plant, mapped=True)
    found = lower_bound(part.matrices, 1e-4, Budget())
    # T is one at the unstable pole and zero at the zeros of the Pade model, whose inverse there
    # is exp(pole delay); maximum principle.
    infimum = abs(weight(pole)) * np.exp(pole * delay)
    assert found is not None
    assert found.how == PROVEN
    assert part.norm(found.value) == pytest.approx(infimum, rel=2e-3)
    assert part.norm(found.value) <= infimum * (1 + 1e-4)


# What no controller reaches over a disc inside the right half plane.


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
