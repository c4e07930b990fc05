import numpy as np
import pytest
from uncertain_plants import lag

import robustpolish as rp
from robustpolish.base.budget import Budget
from robustpolish.errors import SolverError
from robustpolish.synthesis.uncertain.scaled_gain import RobustProblem
from robustpolish.synthesis.uncertain.search import POLICY, ScalingSearch


@pytest.fixture
def problem():
    return RobustProblem.of(lag(), 1, 1, 1.0)


def test_search_ends_below_the_first_controller_and_keeps_to_the_order(problem):
    search = ScalingSearch(problem, 1, Budget(POLICY.work))
    found = search.run()
    assert found.order <= 1
    levels = [note["mu"] for note in search.history if np.isfinite(note["mu"])]
    assert found.level <= levels[0]
    coverage, model = problem.cover(problem.loop(found.controller), found.level)
    assert coverage.complete
    assert coverage.level * model.gain <= found.level * (1 + POLICY.agrees)


def test_the_same_search_finds_the_same_numbers(problem):
    one, other = (ScalingSearch(problem, None, Budget(600.0)).run() for _ in range(2))
    assert (one.controller.A == other.controller.A).all()
    assert one.level == other.level


def test_frequencies_that_a_proof_needs_join(problem):
    search = ScalingSearch(problem, 1, Budget(POLICY.work))
    found = search.run()
    few = found.omega > 1.0
    poor = type(found)(found.controller, 0.5 * found.level, found.omega[few], found.weights[few])
    with_refined_frequencies = search.with_refined_frequencies(poor)
    assert len(with_refined_frequencies.omega) > len(poor.omega)
    assert with_refined_frequencies.level > poor.level


def test_too_few_states_are_told():
    # An unstable oscillator that no gain on its position stabilises.
    k = rp.uncertain.real("k", 1.0, percent=10)
    plant = rp.uncertain.system(
        [[0, 1], [-k, 0.1]], [[0, 0, 0], [1, 0, 1]], [[1, 0], [0, 0], [1, 0]],
        [[0, 0, 0], [0, 0, 1], [0, 1, 0]],
    )  # fmt: skip
    with pytest.raises(SolverError, match="few states"):
        ScalingSearch(RobustProblem.of(plant, 1, 1, 1.0), 0, Budget(2000.0)).run()
