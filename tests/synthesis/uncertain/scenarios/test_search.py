import numpy as np
import pytest
from uncertain_plants import lag

import robustpolish as rp
from robustpolish.base.budget import Budget
from robustpolish.synthesis.problem.scaling import whole_plant
from robustpolish.synthesis.structured.search import SearchEffort
from robustpolish.synthesis.structured.structures import StaticStructure
from robustpolish.synthesis.uncertain.scenarios import POLICY, ScenarioSearch, UncertainSamples


def searching(plant):
    machines = UncertainSamples(plant, 1, 1)
    part = StaticStructure("hinf").problem(whole_plant(machines.nominal))
    return part, ScenarioSearch(machines, part.scaled, Budget(20_000.0))


def bent():
    """A lag whose damping is a parabola of a number: the worst machine is in the middle."""
    b = rp.uncertain.real("b", 0.2, range=(-1.0, 1.0))
    return rp.uncertain.system(
        [[-0.1 - b * b]], [[1.0, 0.0, 1.0]], [[1.0], [0.0], [1.0]],
        [[0, 0, 0], [0, 0, 0.5], [0, 0.1, 0]],
    )  # fmt: skip


def test_the_worst_corner_joins_until_none_is_worse():
    part, search = searching(lag())
    found = search.settled(part, np.array([0.0]))
    assert [values for values, _ in search.known] == [{}, {"b": 0.8}]
    proven = search.proven(found)
    assert proven.worst.proven
    assert proven.worst.upper <= found.gain * (1 + POLICY.agrees)
    assert search.worst_samples(found)[0][1][0] == {"b": 0.8}


@pytest.mark.long
def test_a_worst_machine_between_the_corners_joins_by_the_proof():
    part, search = searching(bent())
    found = search.settled(part, np.array([0.0]))
    proven = search.proven(found)
    inner = [values["b"] for values, _ in search.known if "b" in values]
    assert any(abs(b) < 0.05 for b in inner)
    # The middle is the nearest to instability, and its own best norm is what is left.
    middle = rp.GeneralizedPlant(bent().at({"b": 0.0}), 1, 1)
    assert proven.worst.upper <= 1.01 * rp.output_feedback(middle).certificate.achieved


def test_a_search_stops_where_its_level_does_not_come_low_enough():
    part, search = searching(lag())
    best = search.settled(part, np.array([0.0]))
    effort = SearchEffort(descents=2, fewest=1, smooth_first=False)
    starts = [np.array([-0.5]), np.array([-2.0])]
    assert search.searched(part, starts, effort, below=0.9 * best.gain) is None
    found = search.searched(part, starts, effort)
    assert found.gain == pytest.approx(best.gain, rel=1e-4)
