"""Draws of a model's numbers."""

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.closed_loop.sampled_loops import draw
from robustpolish.errors import InvalidInputError

AT = ("x", "ground")
MASS, STIFFNESS, OFFSET = "dof.x.mass", "spring[0].stiffness", "effect[0].force"
MODEL = rp.MechanicalModel(
    [rp.Dof("x", 2.0)], [rp.Spring(AT, 8e4)], outputs=[rp.Output("x", AT)]
).with_effect("constant_force", "x", {"force": 0.5})


def test_draws_have_the_covariance_of_the_fit():
    size = np.array([0.02, 800.0])
    covariance = np.outer(size, size) * [[1.0, 0.8], [0.8, 1.0]]
    found = draw(MODEL, (MASS, STIFFNESS), covariance, 4000, 0)
    np.testing.assert_array_equal(found.nominal, [2.0, 8e4])
    np.testing.assert_allclose(np.cov((found.values - found.nominal).T / size[:, None]),
                               [[1.0, 0.8], [0.8, 1.0]], atol=0.05)  # fmt: skip
    again = draw(MODEL, (MASS, STIFFNESS), covariance, 4000, 0)
    np.testing.assert_array_equal(again.values, found.values)
    assert draw(MODEL, (MASS, STIFFNESS), covariance, 4000, 1).values[0, 0] != found.values[0, 0]


def test_every_draw_is_a_machine():
    found = draw(MODEL, (STIFFNESS,), np.array([[1e6]]), 3, 0)
    for value in found.values[:, 0].tolist():
        assert MODEL.with_parameters({STIFFNESS: value}).parameters[STIFFNESS] == value


def test_a_mass_stays_positive_and_a_force_of_an_effect_may_turn():
    found = draw(MODEL, (MASS, OFFSET), np.diag([1.0, 4.0]), 2000, 0)
    assert found.values[:, 0].min() > 0
    assert found.values[:, 1].min() < 0 < found.values[:, 1].max()


def test_unknown_errors_are_left_out():
    found = draw(MODEL, (MASS, STIFFNESS), np.diag([np.inf, 100.0]), 5, 0)
    assert (found.keys, found.left_out) == ((STIFFNESS,), (MASS,))
    assert found.values.shape == (5, 1)


@pytest.mark.parametrize(
    ("covariance", "samples", "told"),
    [
        ([[-1.0]], 5, "standard_errors: got a negative variance"),
        ([[np.inf]], 5, "learned: got no number with a known error"),
        ([[1.0]], True, "samples: got True"),
        ([[1.0]], 2.5, "samples: got 2.5"),
        ([[1e6]], 1000, "standard_errors: got an error of dof.x.mass as large as its value"),
    ],
)
def test_bad_draws_are_named(covariance, samples, told):
    with pytest.raises(InvalidInputError, match=told):
        draw(MODEL, (MASS,), np.array(covariance), samples, 0)
