"""The reduced equations of plants with controls without price or measurements without noise."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.base.budget import Budget
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.scaling import SolverPlant
from robustpolish.synthesis.riccati.gamma import lower_bound, reduced_riccati_pair
from robustpolish.synthesis.riccati.lower_bound import PROVEN


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


def test_a_tiny_price_beside_a_fast_weight_is_kept():
    plant, _ = levitation(1e-3, rp.weight(0.999, 2000.0, 100.0, order=2))
    halves = reduced_riccati_pair(SolverPlant.of(plant, mapped=True).matrices)
    assert halves is not None
    # Three integrations lie between the control and the weight's output, which is its price.
    assert len(halves.control.A) == plant.nx - 3


def test_states_that_are_known_exactly_leave_the_equation():
    plant = rp.GeneralizedPlant.from_matrices(
        [[0.0, 1.0], [-1.0, -0.1]], [[0.0], [1.0]], [[0.0], [1.0]], [[1.0, 0.0]], [[1.0, 0.0]]
    )
    halves = reduced_riccati_pair(PlantMatrices.of(plant))
    assert halves is not None
    assert (len(halves.control.A), len(halves.measurement.A)) == (0, 0)
