"""Draws of a model's numbers."""

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.closed_loop.robustness import draw
from robustpolish.errors import InvalidInputError

AT = ("x", "ground")
MASS, STIFFNESS, OFFSET = "dof.x.mass", "spring[0].stiffness", "effect[0].force"
MODEL = rp.MechanicalModel(
    [rp.Dof("x", 2.0)], [rp.Spring(AT, 8e4)], outputs=[rp.Output("x", AT)]
).with_effect("constant_force", "x", {"force": 0.5})


def test_draws_have_the_covariance_of_the_fit():
    size = np.array([0.02, 800.0])
    covariance = np.outer(size, size) * [[1.0, 0.8], [0.8, 1.0]]
    _, values, nominal, _ = draw(MODEL, (MASS, STIFFNESS), covariance, 4000, 0)
    np.testing.assert_array_equal(nominal, [2.0, 8e4])
    np.testing.assert_allclose(np.cov((values - nominal).T / size[:, None]),
                               [[1.0, 0.8], [0.8, 1.0]], atol=0.05)  # fmt: skip
    again, other = (draw(MODEL, (MASS, STIFFNESS), covariance, 4000, seed)[1] for seed in (0, 1))
    np.testing.assert_array_equal(again, values)
    assert other[0, 0] != values[0, 0]


def test_every_draw_is_a_machine():
    for value in draw(MODEL, (STIFFNESS,), np.array([[1e6]]), 3, 0)[1][:, 0].tolist():
        assert MODEL.with_parameters({STIFFNESS: value}).parameters[STIFFNESS] == value


def test_a_mass_stays_positive_and_a_force_of_an_effect_may_turn():
    masses, forces = draw(MODEL, (MASS, OFFSET), np.diag([1.0, 4.0]), 2000, 0)[1].T
    assert masses.min() > 0
    assert forces.min() < 0 < forces.max()


def test_unknown_errors_are_left_out():
    covariance = np.diag([np.inf, 100.0])
    keys, values, _, left_out = draw(MODEL, (MASS, STIFFNESS), covariance, 5, 0)
    assert (keys, values.shape, left_out) == ((STIFFNESS,), (5, 1), (MASS,))


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
