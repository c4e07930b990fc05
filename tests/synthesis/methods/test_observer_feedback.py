"""Observer-based controllers: the LQG optimum, the whole loop's norm, refusals."""

import time

import control
import numpy as np
import pytest
from small_plants import regular_plant

from robustpolish.errors import InfeasibleError, SolverError
from robustpolish.linear.norms.h2 import h2_norm
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.polishing.air_bearing import air_bearing
from robustpolish.synthesis.structured.methods import observer_feedback
from robustpolish.synthesis.structured.observer import observer_controller


def lqg_norm(plant):
    _X, _, F = control.care(plant.A, plant.B2, plant.C1.T @ plant.C1, plant.D12.T @ plant.D12)
    _Y, _, L = control.care(plant.A.T, plant.C2.T, plant.B1 @ plant.B1.T, np.eye(1))
    return float(h2_norm(plant.closed_loop(observer_controller(plant, -F, L.T))))


@pytest.mark.parametrize("d22", [0.0, pytest.param(0.4, marks=pytest.mark.long)])
def test_h2_is_the_lqg_optimum(d22):
    for seed in range(3):
        plant = regular_plant(seed=seed, d22=d22)
        design = observer_feedback(plant, "h2", time_limit=5)
        assert design.certificate.valid
        assert design.certificate.achieved == pytest.approx(lqg_norm(plant), rel=1e-4)


def test_hinf_is_near_the_infimum_of_full_order_control():
    plant = GeneralizedPlant.from_matrices(
        [[1.0]],
        [[1.0, 0.0]],
        [[1.0]],
        [[1.0], [0.0]],
        [[1.0]],
        D12=[[0.0], [1.0]],
        D21=[[0.0, 1.0]],
    )
    design = observer_feedback(plant, time_limit=5)
    # X = Y = x with 2 x - x^2 (1 - g^-2) + 1 = 0, and x = g at the optimum: g^2 - 2 g - 2 = 0.
    roots = np.roots([1.0, -2.0, -2.0])
    assert design.certificate.achieved == pytest.approx(max(roots), rel=5e-3)


@pytest.mark.parametrize(
    "actuation", [pytest.param("displacement", marks=pytest.mark.long), "force"]
)
def test_thesis_plant_from_displacements(actuation):
    plant = air_bearing(actuation=actuation, measured="displacement")
    design = observer_feedback(
        plant, control_weight=1e-8, measurement_noise=1e-8, time_limit=8, seed=1
    )
    assert design.certificate.valid
    loop = plant.closed_loop(design.controller)
    assert float(hinf_norm(loop)) == pytest.approx(design.details["plain_norm"], rel=1e-6)
    assert float(hinf_norm(loop)) < 0.01 * float(hinf_norm(plant.open_loop))
    F, L = design.details["state_feedback"], design.details["observer_gain"]
    assert (F.shape, L.shape) == ((6, 12), (12, 6))
    assert design.details["observer_poles"].real.max() < 0
    assert design.details["feedback_poles"].real.max() < 0
    assert design.controller.state_labels[0] == "x_m_hat"


@pytest.mark.parametrize("norm", ["hinf", "h2"])
def test_discrete_time(norm):
    sampled = control.c2d(regular_plant(seed=4).system, 0.1)
    design = observer_feedback(GeneralizedPlant(sampled, 1, 1), norm, time_limit=4)
    assert design.certificate.valid
    assert np.abs(design.certificate.poles).max() < 1


def test_unreachable_modes_and_feedthroughs_are_refused():
    blind = GeneralizedPlant.from_matrices(
        np.diag([0.5, -1.0]), np.ones((2, 1)), np.ones((2, 1)), [[1.0, 1.0]], [[0.0, 1.0]]
    )
    with pytest.raises(InfeasibleError, match="state x1"):
        observer_feedback(blind)
    direct = GeneralizedPlant.from_matrices(
        [[-1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]], D11=[[1.0]]
    )
    with pytest.raises(InfeasibleError, match="H2 norm is infinite"):
        observer_feedback(direct, "h2")


def test_the_time_limit_holds_for_large_plants():
    plant = regular_plant(30, seed=1)
    began = time.monotonic()
    refusal = ""
    try:
        assert observer_feedback(plant, time_limit=3).certificate.valid
    except SolverError as error:
        refusal = str(error)
    assert not refusal or "time_limit" in refusal
    assert time.monotonic() - began < 12
