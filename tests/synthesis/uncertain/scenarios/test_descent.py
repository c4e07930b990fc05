import control
import numpy as np
import pytest
from uncertain_plants import two_masses

import robustpolish as rp
from robustpolish.base.budget import Budget
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.scaling import whole_plant
from robustpolish.synthesis.structured.search import SearchEffort
from robustpolish.synthesis.structured.structures import StaticStructure
from robustpolish.synthesis.uncertain.scenarios import UncertainSamples, WorstCaseObjective


@pytest.fixture
def descent():
    """A static gain on the lags 1 / (s + a), a = 1 and -1, with a price on u and noise on y."""
    a = rp.uncertain.real("a", 0.0, range=(-1.0, 1.0))
    plant = rp.uncertain.system(
        [[-a]], [[1.0, 0, 1.0]], [[1.0], [0.0], [1.0]], [[0, 0, 0], [0, 0, 0.2], [0, 0.1, 0]]
    )
    machines = UncertainSamples(plant, 1, 1)
    part = StaticStructure("hinf").problem(whole_plant(machines.nominal))
    found = [machines.at({"a": value}) for value in (-1.0, 1.0)]
    return WorstCaseObjective(
        part, tuple(part.scaled.in_units(PlantMatrices.of(one)) for one in found)
    )


def worst_norm(k):
    """Return the larger norm of both loops in the units of the plant, computed anew."""
    norms = []
    for a in (-1.0, 1.0):
        loop = control.ss([[k - a]], [[1.0, 0.1 * k]], [[1.0], [0.2 * k]], [[0, 0], [0, 0.02 * k]])
        norms.append(rp.hinf_norm(loop).value)
    return max(norms)


def test_the_largest_norm_is_that_of_the_worst_machine(descent):
    K = descent.part.parametrisation.gain(np.array([-3.0]))
    k = float(descent.part.controller(K).D[0, 0])
    level = max(descent.instability_or_norm(K, m, Budget())[1] for m in descent.machines)
    assert descent.part.scaled.norm(level) == pytest.approx(worst_norm(k), rel=1e-6)


def test_unstable_loops_are_worse_than_any_norm(descent):
    K = descent.part.parametrisation.gain(np.array([0.0]))
    judged = [descent.instability_or_norm(K, machine, Budget()) for machine in descent.machines]
    assert [unstable for unstable, _ in judged] == [True, False]


@pytest.mark.parametrize("thorough", [False, True])
def test_a_descent_makes_stable_and_finds_the_best_gain(descent, thorough):
    _, level = descent.lower(np.array([0.0]), Budget(5000.0), thorough)
    best = min(worst_norm(k) for k in np.linspace(-20, -2, 91))
    assert best * 0.995 < descent.part.scaled.norm(level) <= best * (1 + 1e-9)


def test_several_starts_agree(descent):
    starts = [np.array([x]) for x in (-1.0, 5.0, -20.0)]
    theta, level = descent.search(starts, SearchEffort(descents=3, fewest=2), Budget(5000.0))
    assert level == pytest.approx(descent.lower(theta, Budget(5000.0), True)[1], rel=1e-6)


def test_machines_that_no_gain_stabilises_have_an_infinite_level():
    machines = UncertainSamples(two_masses(), 1, 1)
    part = StaticStructure("hinf", 0, np.ones((1, 1), bool)).problem(whole_plant(machines.nominal))
    one = part.scaled.in_units(PlantMatrices.of(machines.at({"k": 1.1})))
    # A force on the first mass by the position of the second alone always drives one mode.
    _, level = WorstCaseObjective(part, (one,)).lower(np.array([-1.0]), Budget(2000.0), False)
    assert level == np.inf
