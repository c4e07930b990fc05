"""Observer-based controllers: separation of poles, the LQG optimum, the whole loop's norm."""

import control
import numpy as np
import pytest
from hard_plants import rescaled
from output_tasks import LAG_HINF, unstable_lag
from small_plants import regular_plant

import robustpolish as rp
from robustpolish.errors import InfeasibleError, InvalidInputError
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.structured.starts import observer_form

observer_controller, observer_feedback = rp.synthesis.observer_controller, rp.observer_feedback


def sorted_poles(*parts):
    return np.sort_complex(np.concatenate(parts).astype(complex))


def test_poles_separate():
    plant = rp.air_bearing(actuation="force", measured="displacement")
    rng = np.random.default_rng(0)
    F, L = rng.normal(size=(6, 12)), rng.normal(size=(12, 6))
    loop = plant.closed_loop(observer_controller(plant, F, L))
    poles = [np.linalg.eigvals(plant.A + plant.B2 @ F), np.linalg.eigvals(plant.A - L @ plant.C2)]
    # The thesis's order: plant and estimate as in (10.70).
    assert sorted_poles(loop.poles()) == pytest.approx(sorted_poles(*poles), rel=1e-5, abs=1e-5)
    with pytest.raises(InvalidInputError, match=r"^L: "):
        observer_controller(unstable_lag(), [[1.0]], [[1.0, 2.0]])


def test_any_strictly_proper_controller_is_an_observer():
    plant = regular_plant(4, seed=2, d22=0.3)
    K = observer_controller(plant, np.ones((1, 4)), np.ones((4, 1)))
    T = np.random.default_rng(0).normal(size=(4, 4))
    Ak, Bk, Ck = np.linalg.solve(T, K.A @ T), np.linalg.solve(T, K.B), K.C @ T
    gains = observer_form(plant.A, plant.B2, plant.C2, plant.D22, Ak, Bk, Ck)
    again = observer_controller(plant, *gains)
    for s in (0.1j, 1j, 10j):
        assert again(s) == pytest.approx(K(s), rel=1e-6)


def lqg_norm(plant):
    _X, _, F = control.care(plant.A, plant.B2, plant.C1.T @ plant.C1, plant.D12.T @ plant.D12)
    _Y, _, L = control.care(plant.A.T, plant.C2.T, plant.B1 @ plant.B1.T, np.eye(1))
    return float(rp.h2_norm(plant.closed_loop(observer_controller(plant, -F, L.T))))


@pytest.mark.parametrize(
    ("d22", "seed"), [(0.0, 0), (0.0, 1),
                      (0.4, 2)],
)  # fmt: skip
def test_h2_is_the_lqg_optimum(d22, seed):
    plant = regular_plant(seed=seed, d22=d22)
    design = observer_feedback(plant, "h2", time_limit=5)
    assert design.certificate.valid
    assert design.certificate.achieved == pytest.approx(lqg_norm(plant), rel=1e-4)


def test_hinf_is_near_the_infimum_of_full_order_control():
    plant, unit = rescaled(unstable_lag(), seed=5)[:2]
    design = observer_feedback(plant, target=1.005 * LAG_HINF * unit)
    assert design.certificate.achieved == pytest.approx(LAG_HINF * unit, rel=6e-3)
    # The observer of F and L in the units of the plant is the controller.
    F, L = design.details["state_feedback"], design.details["observer_gain"]
    assert design.controller(1j) == pytest.approx(observer_controller(plant, F, L)(1j))
    told = sorted_poles(design.details["feedback_poles"], design.details["observer_poles"])
    assert told == pytest.approx(sorted_poles(design.certificate.poles), rel=1e-5)


def test_parts_that_share_no_signal_get_gains_of_their_own():
    lag = unstable_lag()
    names = ("A", "B1", "B2", "C1", "C2", "D11", "D12", "D21")
    matrices = {n: np.kron(np.diag([1.0, 0.0]), getattr(lag, n)) for n in names}
    # The second part is at rest: nothing to design, and nothing is fed back.
    matrices["A"][1, 1] = -1.0
    design = observer_feedback(GeneralizedPlant.from_matrices(**matrices), "h2")
    for gain in (design.details["state_feedback"], design.details["observer_gain"]):
        assert gain[0, 0] != 0
        assert np.count_nonzero(gain) == 1
    assert -1.0 in design.details["observer_poles"].real.round(9)


@pytest.mark.parametrize(
    "actuation", [pytest.param("displacement", marks=pytest.mark.long), "force"]
)
def test_thesis_plant_from_displacements(actuation):
    plant = rp.air_bearing(actuation=actuation, measured="displacement")
    design = observer_feedback(
        plant, control_weight=1e-8, measurement_noise=1e-8, time_limit=8, seed=1
    )
    assert design.certificate.valid
    loop = plant.closed_loop(design.controller)
    assert float(rp.hinf_norm(loop)) == pytest.approx(design.details["plain_norm"], rel=1e-6)
    assert float(rp.hinf_norm(loop)) < 0.01 * float(rp.hinf_norm(plant.open_loop))
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


def test_what_no_observer_does_is_refused():
    blind = GeneralizedPlant.from_matrices(
        np.diag([0.5, -1.0]), np.ones((2, 1)), np.ones((2, 1)), [[1.0, 1.0]], [[0.0, 1.0]]
    )
    with pytest.raises(InfeasibleError, match="state x1"):
        observer_feedback(blind)
    direct = GeneralizedPlant.from_matrices(
        [[-1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]], D11=[[1.0]]
    )
    with pytest.raises(InfeasibleError, match="D11 passes the disturbance straight to z"):
        observer_feedback(direct, "h2")
