"""The search on one part: closed forms in the plant's units, ceilings, zeros, refusals."""

import numpy as np
import pytest
from small_plants import oscillator

from robustpolish.base.budget import Budget
from robustpolish.errors import SolverError
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.problem.scaling import whole_plant
from robustpolish.synthesis.structured.search import POLICY, design_part
from robustpolish.synthesis.structured.structures import StaticStructure


def lag(price=1.0, a=-1.0, unit=1.0):
    """X' = a x + w + u, z = unit (x, price u): u = -k x gives sqrt(1 + (price k)^2)/(k - a)."""
    return GeneralizedPlant.from_matrices(
        [[a]], [[1.0]], [[1.0]], [[unit], [0.0]], [[1.0]], D12=[[0.0], [price * unit]]
    )


def design(plant, seed=0, target=0.0, budget=None, **structure):
    problem = StaticStructure("hinf", **structure).problem(whole_plant(plant))
    assert problem is not None
    return design_part(problem, budget or Budget(1e3), seed, target)


def gain(found):
    return np.asarray(found.controller.D).item()


def test_an_optimum_in_closed_form_is_reached_in_the_units_of_the_plant():
    # k = 1 is the best, sqrt(1/2); only a little of it is given away for a smaller gain.
    unit = 1e-6
    found = design(lag(unit=unit), budget=Budget(1e5))
    assert found.norm == pytest.approx(unit * np.sqrt(0.5), rel=1.5 * POLICY.slack)
    assert gain(found) == pytest.approx(-1.0, abs=0.05)
    assert not found.at_ceiling
    assert found.reason == "agreed"
    assert found.agreeing >= 4
    assert found.descents == len(found.history)
    assert min(e["value"] for e in found.history if "value" in e) <= found.norm


def test_a_bound_on_the_gain_is_kept():
    found = design(lag(), gain_bound=0.5, budget=Budget(200.0))
    assert gain(found) == pytest.approx(-0.5, rel=1e-6)
    assert found.norm == pytest.approx(np.sqrt(1.25) / 1.5, rel=1e-4)


def test_a_norm_that_falls_without_end_is_stopped_at_a_ceiling_and_certified():
    found = design(lag(price=0.0))
    assert found.at_ceiling
    assert abs(gain(found)) > 0.5 * POLICY.ceilings[-1]
    assert found.norm == pytest.approx(1 / (1 - gain(found)), rel=1e-6)


def test_a_target_ends_the_search_early():
    found = design(lag(price=0.0), target=0.1)
    assert found.reason == "target"
    assert found.norm < 0.1
    assert found.descents == 1


def test_a_gain_that_cancels_the_disturbance_does_so_exactly():
    # y = w and u = -y leave nothing: x' = -x.
    plant = GeneralizedPlant.from_matrices(
        [[-1.0]], [[0.3]], [[0.1]], [[1.0]], [[0.0]], D21=[[1.0]]
    )
    found = design(plant)
    assert gain(found) == pytest.approx(-3.0, abs=1e-9)
    assert found.norm < 1e-12


def test_the_same_seed_gives_the_same_bits():
    plant = oscillator()
    first, again = (design(plant, seed=3, order=1, budget=Budget(300.0)) for _ in range(2))
    assert first.point.tobytes() == again.point.tobytes()
    assert first.history == again.history


def test_refusals_say_what_was_tried_and_what_to_do():
    # A double integrator with its position measured needs a derivative.
    unstable = GeneralizedPlant.from_matrices(
        [[0, 1], [0, 0]], [[0], [1]], [[0], [1]], [[1, 0]], [[1, 0]]
    )
    with pytest.raises(SolverError, match="No stabilising static gain was found") as caught:
        design(unstable, budget=Budget(100.0))
    assert "lowest spectral abscissa" in str(caught.value)
    assert "Raise order=, try another seed" in str(caught.value)
    # x' = x + u needs k > 1.
    with pytest.raises(SolverError, match=r"that meets the gain bound 0\.9 was found"):
        design(lag(a=1.0), gain_bound=0.9, budget=Budget(300.0))
    with pytest.raises(SolverError, match=r"before time ran out.*raise time_limit"):
        design(lag(a=1.0), budget=Budget(seconds=0.0))
