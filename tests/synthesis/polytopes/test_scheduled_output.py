"""Controllers at the vertices of a polytope, from inequalities with one X and Y."""

import control
import numpy as np
import pytest
from polytope_examples import solver

import robustpolish as rp
from robustpolish.synthesis.problem.matrices import PlantMatrices, close
from robustpolish.synthesis.scheduled.scheduled_feedback import scheduled_controllers


def seen_mass(stiffness):
    return rp.GeneralizedPlant.from_matrices(
        [[0, 1], [-stiffness, -0.1]], [[0, 0], [1, 0]], [[0], [1]], [[1, 0], [0, 0]], [[1, 0]],
        D12=[[0], [1]], D21=[[0, 0.1]],
    )  # fmt: skip


def norm_of(plant, K):
    return float(rp.hinf_norm(control.StateSpace(*close(PlantMatrices.of(plant), K))))


def test_a_single_vertex_gets_its_own_optimum():
    plant = seen_mass(2.0)
    made, claimed = next(scheduled_controllers([PlantMatrices.of(plant)], solver()))
    own = rp.output_feedback(plant).certificate.achieved
    assert own * (1 - 1e-3) <= norm_of(plant, made[0]) <= claimed * (1 + 1e-6)
    assert claimed == pytest.approx(own, rel=0.015)


def test_the_mixture_of_controllers_belongs_to_the_mixture_of_plants():
    ends = [seen_mass(1.0), seen_mass(4.0)]
    made, claimed = next(scheduled_controllers([PlantMatrices.of(p) for p in ends], solver()))
    for t in (0.0, 0.3, 0.7, 1.0):
        K = type(made[0])(*((1 - t) * a + t * b for a, b in zip(*made, strict=True)))
        assert norm_of(seen_mass(1.0 + 3.0 * t), K) <= claimed * (1 + 1e-6)
    assert not np.allclose(made[0].A, made[1].A)
