"""Springs and dampers: signs, an optimum in closed form, bounds, refusals."""

import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.polishing.air_bearing import air_bearing
from robustpolish.synthesis.structured.methods import passive_feedback


def absorber(ratio):
    """Main mass and spring of 1 without damping, and a small mass on a spring, in SI units."""
    K = np.array([[1.0 + ratio, -ratio], [-ratio, ratio]])
    M = np.diag([1.0, ratio])
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(M, K), np.zeros((2, 2))]])
    B2 = np.vstack([np.zeros((2, 2)), np.linalg.inv(M)])
    return GeneralizedPlant.from_matrices(
        A,
        B2[:, :1],
        B2,
        [[1.0, 0, 0, 0]],
        np.eye(4),
        states=["q", "p", "dq", "dp"],
        controls=["F_q", "F_p"],
    )


def test_den_hartogs_absorber():
    # With the small mass tuned to 1 / (1 + mu), Den Hartog's optimum is sqrt(1 + 2 / mu).
    mu = 0.1
    plant = absorber(mu)
    tuned = plant.A.copy()
    stiffness = mu / (1 + mu) ** 2
    tuned[2, :2] = [-1 - stiffness, stiffness]
    tuned[3, :2] = [stiffness / mu, -stiffness / mu]
    plant = GeneralizedPlant.from_matrices(
        tuned,
        plant.B1,
        plant.B2,
        plant.C1,
        plant.C2,
        states=plant.states,
        controls=plant.control_names,
    )
    design = passive_feedback(plant, dampers=[("p", "q")], time_limit=8)
    assert design.certificate.achieved == pytest.approx(np.sqrt(1 + 2 / mu), rel=5e-3)
    (damper,) = design.details["elements"]
    # Den Hartog: zeta = sqrt(3 mu / (8 (1 + mu))), damping 2 zeta mu omega.
    zeta = np.sqrt(3 * mu / (8 * (1 + mu)))
    assert damper.coefficient == pytest.approx(2 * zeta * mu / (1 + mu), rel=0.06)


def test_spring_and_damper_of_an_absorber_together():
    mu = 0.1
    A = absorber(mu).A.copy()
    A[2, :2], A[3, :2] = [-1.0, 0.0], [0.0, 0.0]
    loose = absorber(mu)
    plant = GeneralizedPlant.from_matrices(
        A, loose.B1, loose.B2, loose.C1, loose.C2, states=loose.states
    )
    design = passive_feedback(plant, [("p", "q")], [("p", "q")], time_limit=8)
    spring, damper = design.details["elements"]
    assert design.certificate.achieved <= np.sqrt(1 + 2 / mu) * 1.002
    assert spring.coefficient == pytest.approx(mu / (1 + mu) ** 2, rel=0.05)
    assert (spring.unit, damper.unit) == ("N/m", "N s/m")


def test_elements_act_between_their_places():
    plant = air_bearing(actuation="force")
    design = passive_feedback(
        plant, dampers=[("x_m", "x")], damping_bound=5.0, time_limit=4, norm="h2"
    )
    (damper,) = design.details["elements"]
    d = damper.coefficient
    assert 0 < d <= 5.0 * (1 + 1e-9)
    F = np.array(design.controller.D)
    expected = np.zeros((6, 12))
    expected[0, [1, 3]] = [-d, d]
    expected[1, [1, 3]] = [d, -d]
    assert pytest.approx(expected, rel=1e-12) == F
    assert "damper between x_m and x" in str(damper)


def test_thesis_plant_gets_better_and_says_when_nothing_bounds_it():
    plant = air_bearing(actuation="force")
    open_loop = float(hinf_norm(plant.open_loop))
    dampers = [("x", "ground"), ("y", "ground"), ("z", "ground")]
    design = passive_feedback(plant, dampers=dampers, time_limit=6)
    assert design.certificate.valid
    assert design.certificate.achieved < 1e-3 * open_loop
    assert all(e.coefficient > 0 for e in design.details["elements"])
    bounded = passive_feedback(plant, dampers=dampers, damping_bound=1.0, time_limit=6)
    assert design.certificate.achieved < bounded.certificate.achieved < open_loop
    everywhere = [(q, "ground") for q in ("x_m", "x", "y_m", "y", "z_m", "z")]
    # it ends by itself, on a busy machine later than on an idle one
    free = passive_feedback(plant, everywhere, everywhere, time_limit=60)
    assert free.status == "infimum_not_attained"


@pytest.mark.parametrize(
    ("springs", "actuation"),
    [
        ([("x", "nowhere")], "force"),
        ([("x", "x")], "force"),
        ([("dx", "ground")], "force"),
        ([("x", "ground")], "displacement"),
        ([("x", "ground"), ("x", "ground")], "force"),
        ([], "force"),
    ],
)
def test_wrong_places_are_named(springs, actuation):
    with pytest.raises(InvalidInputError, match="springs"):
        passive_feedback(air_bearing(actuation=actuation), springs)
