"""Springs and dampers: signs, an optimum in closed form, bounds, refusals."""

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from robustpolish.plants.plant import GeneralizedPlant

passive_feedback, air_bearing, hinf_norm = rp.passive_feedback, rp.air_bearing, rp.hinf_norm


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


def with_stiffness(plant, rows):
    A = plant.A.copy()
    A[2:, :2] = rows
    return plant.replace(A=A)


MU = 0.1
TUNED = MU / (1 + MU) ** 2
"""Stiffness of the spring of Den Hartog's absorber; his optimum is sqrt(1 + 2 / MU)."""


def test_den_hartogs_absorber():
    plant = with_stiffness(absorber(MU), [[-1 - TUNED, TUNED], [TUNED / MU, -TUNED / MU]])
    design = passive_feedback(plant, dampers=[("p", "q")], time_limit=8)
    assert design.certificate.achieved == pytest.approx(np.sqrt(1 + 2 / MU), rel=5e-3)
    (damper,) = design.details["elements"]
    # Den Hartog: zeta = sqrt(3 mu / (8 (1 + mu))), damping 2 zeta mu omega.
    zeta = np.sqrt(3 * MU / (8 * (1 + MU)))
    assert damper.coefficient == pytest.approx(2 * zeta * MU / (1 + MU), rel=0.06)


def test_spring_and_damper_of_an_absorber_together():
    plant = with_stiffness(absorber(MU), [[-1.0, 0.0], [0.0, 0.0]])
    design = passive_feedback(plant, [("p", "q")], [("p", "q")], time_limit=8)
    spring, damper = design.details["elements"]
    assert design.certificate.achieved <= np.sqrt(1 + 2 / MU) * 1.002
    assert spring.coefficient == pytest.approx(TUNED, rel=0.05)
    assert (spring.unit, damper.unit) == ("N/m", "N s/m")


@pytest.mark.parametrize("norm", ["hinf", "h2"])
def test_springs_and_dampers_pull_both_places_towards_each_other(norm):
    plant, bounds = absorber(0.5), {("p", "q"): 1e-3, ("ground", "p"): 0.2}
    design = passive_feedback(
        plant, [("p", "q")], [("p", "ground")], norm, stiffness_bound=bounds, damping_bound=bounds
    )
    k, d = (element.coefficient for element in design.details["elements"])
    assert k <= 1e-3 * (1 + 1e-9)
    assert d <= 0.2 * (1 + 1e-9)
    expected = [[-k, k, 0, 0], [k, -k, 0, -d]]
    assert np.asarray(design.controller.D) == pytest.approx(np.array(expected), rel=1e-12)


def test_parts_without_elements_are_left_alone():
    # Two masses that share no spring.
    none, eye = np.zeros((2, 2)), np.eye(2)
    forces = np.vstack([none, eye])
    A = np.block([[none, eye], [-np.diag([4.0, 6.0]), -0.1 * eye]])
    plant = GeneralizedPlant.from_matrices(
        A, forces, forces, np.eye(4)[:2], np.eye(4), states=["q", "p", "dq", "dp"]
    )
    design = passive_feedback(plant, dampers=[("q", "ground")], damping_bound=1.0)
    (damper,) = design.details["elements"]
    assert damper.coefficient == pytest.approx(1.0, rel=1e-3)
    assert len(design.details["part_norms"]) == 1
    assert design.certificate.achieved > 1.5 * design.details["part_norms"][0]


def test_the_thesis_plant_gets_better():
    plant = air_bearing(actuation="force")
    open_loop = float(hinf_norm(plant.open_loop))
    dampers = [("x", "ground"), ("y", "ground"), ("z", "ground")]
    design = passive_feedback(plant, dampers=dampers, time_limit=6)
    assert design.certificate.valid
    assert design.certificate.achieved < 1e-3 * open_loop
    assert all(e.coefficient > 0 for e in design.details["elements"])
    bounded = passive_feedback(plant, dampers=dampers, damping_bound=1.0, time_limit=6)
    assert design.certificate.achieved < bounded.certificate.achieved < open_loop


def test_a_norm_that_nothing_bounds_is_told():
    everywhere = [(q, "ground") for q in ("x_m", "x", "y_m", "y", "z_m", "z")]
    # it ends by itself, on a busy machine later than on an idle one
    free = passive_feedback(air_bearing(actuation="force"), everywhere, everywhere, time_limit=60)
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
