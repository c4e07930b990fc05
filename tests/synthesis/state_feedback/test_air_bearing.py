"""State feedback of the air bearing: agreement of methods, prices, bounds, singular problem."""

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.synthesis.problem.pole_regions import Disk, HalfPlane, Sector
from robustpolish.synthesis.state_feedback.state_feedback import state_feedback

# Prices from "almost free" to "almost forbidden", in m per unit of u.
WEIGHTS = (1e-7, 1e-5, 1e-3)
ACTUATIONS = ("displacement", "force")
NORMS = ("hinf", "h2")

# Largest singular value of the printed gains C.4 and C.6 in physical units, and their norms.
PRINTED = {"displacement": (2828.1576, 3.3611e-6), "force": (1027.6179, 3.843e-5)}


def true_norm(plant, gain, norm):
    loop = plant.state_feedback_loop(gain)
    return float(rp.hinf_norm(loop) if norm == "hinf" else rp.h2_norm(loop))


def axis_plant(plant, number):
    """One of the three axes, cut out by hand."""
    states, controls = slice(4 * number, 4 * number + 4), slice(2 * number, 2 * number + 2)
    return rp.GeneralizedPlant.from_matrices(
        plant.A[states, states],
        plant.B1[states],
        plant.B2[states, controls],
        plant.C1[controls, states],
        np.eye(4),
    )


@pytest.mark.parametrize("norm", NORMS)
@pytest.mark.parametrize(
    "actuation", [pytest.param("displacement", marks=pytest.mark.long), "force"]
)
@pytest.mark.parametrize("weight", WEIGHTS)
def test_methods_and_backends_agree(actuation, norm, weight):
    plant = rp.air_bearing(actuation=actuation)
    riccati = state_feedback(plant, norm, "riccati", control_weight=weight)
    lmi = state_feedback(plant, norm, "lmi", "cvxpy", control_weight=weight)
    picos = state_feedback(plant, norm, "lmi", "picos", control_weight=weight)
    assert riccati.status == lmi.status == "optimal"
    assert picos.status in ("optimal", "suboptimal")  # CVXOPT ends where its rounding does
    for design in (riccati, lmi, picos):
        assert design.certificate.valid
        assert design.certificate.achieved <= design.certificate.claimed * (1 + 1e-6)
    reference = riccati.certificate.achieved
    assert lmi.certificate.achieved == pytest.approx(reference, rel=1e-4)
    assert picos.certificate.achieved == pytest.approx(lmi.certificate.achieved, rel=1e-4)


@pytest.mark.parametrize("norm", NORMS)
@pytest.mark.parametrize("actuation", ACTUATIONS)
def test_axes_alone_give_the_norm_of_the_whole(actuation, norm):
    plant = rp.air_bearing(actuation=actuation)
    together = state_feedback(plant, norm, "riccati", control_weight=1e-5, split=False)
    split = state_feedback(plant, norm, "riccati", control_weight=1e-5)
    alone = [
        state_feedback(axis_plant(plant, k), norm, "lmi", control_weight=1e-5).certificate.achieved
        for k in range(3)
    ]
    joined = max(alone) if norm == "hinf" else np.linalg.norm(alone)
    assert split.certificate.achieved == pytest.approx(together.certificate.achieved, rel=1e-6)
    assert joined == pytest.approx(together.certificate.achieved, rel=1e-6)


@pytest.mark.long
@pytest.mark.parametrize("method", ["lmi", "riccati"])
@pytest.mark.parametrize("actuation", ACTUATIONS)
def test_gain_no_larger_than_the_printed_one_does_no_worse(actuation, method):
    bound, printed_norm = PRINTED[actuation]
    plant = rp.air_bearing(actuation=actuation)
    design = state_feedback(plant, "hinf", method, gain_bound=bound, time_limit=300)
    assert np.linalg.norm(design.gain, 2) <= bound
    assert design.status == "suboptimal"
    assert "local optimum" in design.message
    assert true_norm(plant, design.gain, "hinf") <= printed_norm
    assert design.certificate.achieved == pytest.approx(
        true_norm(plant, design.gain, "hinf"), rel=1e-6
    )


@pytest.mark.long
def test_gain_bound_for_the_h2_norm():
    plant = rp.air_bearing(actuation="force")
    bounded = state_feedback(plant, "h2", gain_bound=100.0)
    assert np.linalg.norm(bounded.gain, 2) <= 100.0
    open_loop = float(rp.h2_norm(plant.open_loop))
    assert bounded.certificate.achieved < 0.1 * open_loop


@pytest.mark.parametrize("method", ["lmi", "riccati"])
@pytest.mark.parametrize("norm", NORMS)
@pytest.mark.parametrize("actuation", ACTUATIONS)
def test_problem_of_the_thesis_has_no_optimum(actuation, norm, method):
    plant = rp.air_bearing(actuation=actuation)
    design = state_feedback(plant, norm, method)
    assert design.status == "infimum_not_attained"
    for way_out in ("control_weight", "gain_bound", "pole_region"):
        assert way_out in design.message
    assert design.certificate.valid
    idle = true_norm(plant, np.zeros((6, 12)), norm)
    assert design.certificate.achieved < 1e-3 * idle
    norms = [entry["achieved"] for entry in design.history if "price" in entry]
    assert max(norms) > 2 * min(norms)


def test_price_extends_the_performance_outputs():
    plant = rp.air_bearing(actuation="force")
    design = state_feedback(plant, "h2", "riccati", control_weight=[1e-6] * 6)
    names = design.closed_loop.output_labels
    assert names[:6] == list(plant.performance_names)
    assert names[6:] == [f"price_{name}" for name in plant.control_names]
    K = np.asarray(design.closed_loop.C)[6:]
    np.testing.assert_allclose(K, 1e-6 * design.gain, rtol=1e-12)
    assert design.details["performance_norm"] == pytest.approx(
        true_norm(plant, design.gain, "h2"), rel=1e-9
    )
    assert design.details["performance_norm"] < design.certificate.achieved


@pytest.mark.parametrize("norm", NORMS)
@pytest.mark.parametrize(
    "region",
    [HalfPlane(-300.0), Disk(-40000.0, 39900.0), Sector(0.3), (HalfPlane(-100.0), Sector(0.05))],
)
def test_poles_lie_in_the_region(region, norm):
    plant = rp.air_bearing(actuation="force")
    design = state_feedback(plant, norm, control_weight=1e-6, pole_region=region)
    regions = region if isinstance(region, tuple) else (region,)
    poles = np.linalg.eigvals(plant.A + plant.B2 @ design.gain)
    assert all(r.contains(poles) for r in regions)
    assert design.status == "suboptimal"
    free = state_feedback(plant, norm, "riccati", control_weight=1e-6)
    assert design.certificate.achieved >= free.certificate.achieved * (1 - 1e-4)


def test_region_makes_the_problem_of_the_thesis_solvable():
    plant = rp.air_bearing(actuation="force")
    design = state_feedback(plant, "h2", pole_region=Disk(-20000.0, 19990.0))
    assert design.status == "suboptimal"
    poles = np.linalg.eigvals(plant.A + plant.B2 @ design.gain)
    assert Disk(-20000.0, 19990.0).contains(poles)


def test_undamped_machine():
    plant = rp.air_bearing(dissipation=0, actuation="force")
    designs = [
        state_feedback(plant, "hinf", method, control_weight=1e-5) for method in ("lmi", "riccati")
    ]
    norms = [design.certificate.achieved for design in designs]
    assert norms[0] == pytest.approx(norms[1], rel=1e-4)


@pytest.mark.parametrize("norm", NORMS)
def test_a_disturbance_that_reaches_nothing_leaves_a_proven_zero(norm):
    first, second = [[1.0], [0.0]], [[0.0], [1.0]]
    plant = rp.GeneralizedPlant.from_matrices(-np.eye(2), second, first, [[1.0, 0.0]], np.eye(2))
    design = state_feedback(plant, norm)
    assert design.status == "optimal"
    assert design.certificate.achieved == design.certificate.bound == 0.0
