"""Controllers from elsewhere: certified or refused."""

import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError, SolverError


@pytest.fixture
def plant():
    return rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])


def test_a_stabilising_gain_becomes_a_design(plant):
    design = rp.given_controller(plant, [[-3.0]])
    assert design.certificate.achieved == pytest.approx(0.5, rel=1e-9)
    assert design.gain == [[-3.0]]
    assert design.closed_loop.A == [[-2.0]]


def test_an_unstable_loop_is_refused(plant):
    with pytest.raises(SolverError, match="sign"):
        rp.given_controller(plant, [[3.0]])


def test_shapes_are_checked(plant):
    with pytest.raises(InvalidInputError, match="controller"):
        rp.given_controller(plant, [[1.0, 2.0]])
