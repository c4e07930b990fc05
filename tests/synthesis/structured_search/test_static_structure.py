"""Output feedback of a given order and pattern: what is free, where it starts, and units."""

from itertools import islice

import control
import numpy as np
import pytest
from hard_plants import rescaled
from random_loops import scalar_loop
from small_plants import FULL, oscillator, two_masses

from robustpolish.base.budget import Budget
from robustpolish.errors import InfeasibleError, InvalidInputError
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.nonsmooth.parametrisations import AffineGain, MaskedGain
from robustpolish.synthesis.problem.scaling import decoupled_parts, whole_plant
from robustpolish.synthesis.structured.structures import (
    StaticStructure,
    free_gain,
    scaled_matrix,
    zero_controller,
)

ANY = np.ones((1, 1), bool)


def two_lags():
    """Two lags that share no signal."""
    eye = np.eye(2)
    return GeneralizedPlant.from_matrices(np.diag([-1.0, -2.0]), eye, eye, eye, eye)


def test_each_part_has_its_own_entries_of_the_pattern():
    plant = two_lags()
    mask = np.array([[False, False], [False, True]])
    first, second = decoupled_parts(plant, mask)
    structure = StaticStructure("hinf", mask=mask)
    assert structure.problem(first) is None
    problem = structure.problem(second)
    assert problem is not None
    assert problem.parametrisation.size == 1
    assert (problem.what, problem.order) == ("static gain", 0)


def test_a_plant_without_states_leaves_nothing_to_choose():
    gain = control.StateSpace([], [], [], np.eye(2))
    assert StaticStructure("hinf").problem(whole_plant(GeneralizedPlant(gain, 1, 1))) is None


@pytest.mark.parametrize("order", [0, 2])
def test_the_search_starts_at_what_was_given(order):
    plant = rescaled(oscillator(), seed=1)[0]
    rng = np.random.default_rng(0)
    K = control.StateSpace(
        rng.normal(size=(order, order)),
        rng.normal(size=(order, 1)),
        rng.normal(size=(1, order)),
        rng.normal(size=(1, 1)),
    )
    problem = StaticStructure("hinf", order, initial=K).problem(whole_plant(plant))
    assert problem is not None
    first, rest = islice(problem.starts[0].propose((), Budget(), rng), 2)
    again = problem.controller(problem.parametrisation.gain(first))
    for s in (0.3j, 1.0 + 2j):
        assert again(s) == pytest.approx(K(s), rel=1e-9)
    # At rest nothing is fed back.
    assert not problem.controller(problem.parametrisation.gain(rest))(1j).any()


def test_scaling_a_controller_undoes_what_the_problem_does_to_it():
    plant = rescaled(two_masses(FULL), seed=2)[0]
    problem = StaticStructure("hinf", 1).problem(whole_plant(plant))
    assert problem is not None
    K = np.random.default_rng(3).normal(size=(3, 3))
    assert scaled_matrix(problem.controller(K), problem.scaled) == pytest.approx(K, rel=1e-12)


def test_states_at_rest_decay():
    assert zero_controller((3, 3), 2, discrete=False).tolist() == [
        [-1, 0, 0],
        [0, -1, 0],
        [0, 0, 0],
    ]
    assert not zero_controller((3, 3), 2, discrete=True).any()


def test_all_marked_entries_are_free_unless_a_feedthrough_is_left():
    assert isinstance(free_gain(ANY, scalar_loop()), MaskedGain)
    assert isinstance(free_gain(ANY, scalar_loop(D12=1.0)), MaskedGain)
    sampled = scalar_loop(D11=2.0, D12=1.0, D21=0.5, discrete=True)
    assert isinstance(free_gain(ANY, sampled), MaskedGain)
    # 2 + K / 2 = 0 in continuous time.
    free = free_gain(ANY, sampled.replace(discrete=False))
    assert isinstance(free, AffineGain)
    assert free.size == 0
    assert free.gain(np.zeros(0)).item() == pytest.approx(-4.0)


def test_a_feedthrough_that_nothing_cancels_is_refused():
    with pytest.raises(InfeasibleError, match="none cancels the feedthrough D11"):
        free_gain(ANY, scalar_loop(D11=1.0, D12=1.0))
    with pytest.raises(InfeasibleError, match="none cancels the feedthrough D11"):
        free_gain(~ANY, scalar_loop(D11=1.0, D12=1.0, D21=1.0))
    with_d22 = scalar_loop(D11=1.0, D12=1.0, D21=1.0).replace(D22=np.ones((1, 1)))
    with pytest.raises(InvalidInputError, match="Absorb D22"):
        free_gain(ANY, with_d22)
