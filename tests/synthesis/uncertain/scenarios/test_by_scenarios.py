import numpy as np
import pytest
from uncertain_plants import lag

import robustpolish as rp
from robustpolish.base.budget import Budget
from robustpolish.errors import InfeasibleError
from robustpolish.synthesis.uncertain.scenarios import (
    UncertainSamples,
    UnstructuredSearch,
    with_structure,
)


@pytest.fixture(scope="module")
def found():
    return UnstructuredSearch(UncertainSamples(lag(), 1, 1), None, Budget(20_000.0)).from_nominal()


def test_of_a_lag_a_static_gain_does_all_that_can_be_done(found):
    assert found.controller.nstates == 0
    assert found.worst.proven
    assert found.best_possible


def test_the_bound_is_what_one_machine_allows(found):
    weak = rp.output_feedback(rp.GeneralizedPlant(lag().at({"b": 0.8}), 1, 1))
    assert found.lower_bound == weak.lower_bound
    assert found.lower_bound <= found.worst.lower * (1 + 1e-9)


@pytest.mark.long
def test_a_structure_reaches_the_same_and_the_same_numbers_again(found):
    one, other = (
        with_structure(UncertainSamples(lag(), 1, 1), 0, np.ones((1, 1), bool), Budget(1000.0))[0]
        for _ in range(2)
    )
    # So little work ends a little above what is possible.
    assert one.worst.upper <= 1.01 * found.worst.upper
    assert one.controller.D[0, 0] == other.controller.D[0, 0]
    assert one.worst.upper == other.worst.upper


def test_a_pattern_that_moves_nothing_is_refused():
    k = rp.uncertain.real("k", 1.0, percent=10)
    # The control that moves the unstable state stays zero.
    plant = rp.uncertain.system(
        [[k, 0], [0, -1.0]], [[1, 1, 0], [1, 0, 1]], [[1, 1], [0, 1], [1, 0]], 0
    )
    with pytest.raises(InfeasibleError):
        with_structure(
            UncertainSamples(plant, 2, 2), 0, np.array([[0, 0], [1, 1]], bool), Budget(3000.0)
        )
