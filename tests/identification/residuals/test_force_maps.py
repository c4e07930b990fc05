import numpy as np
import pytest

from robustpolish.identification.observer.missing_force import SmoothedMotion
from robustpolish.identification.residuals.tests import MAPS, force_maps, predictable_share
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import Damper, Dof, Input, Output, Spring
from tests.identification.oscillators import PLACE

TIME = np.arange(6000) / 100
RANDOM = np.random.default_rng(0)


def swing(first, second):
    q = np.sin(first * TIME) + 0.6 * np.sin(second * TIME)
    return q, first * np.cos(first * TIME) + 0.6 * second * np.cos(second * TIME)


X, XV = swing(5.0, 13.1)
Y, YV = swing(7.7, 3.3)


def two(joined=True):
    springs = [Spring(PLACE, 100.0), Spring(("y", "ground"), 100.0)]
    return MechanicalModel(
        [Dof("x", 1.0), Dof("y", 1.0)],
        springs + ([Spring(("x", "y"), 50.0)] if joined else []),
        [Damper(PLACE, 1.0)],
        [Input("F", PLACE)],
        [Output("x", PLACE), Output("y", ("y", "ground"))],
    )


def motion(force):
    q, v = np.array([X, Y]), np.array([XV, YV])
    return SmoothedMotion(q, v, v, np.array(force), np.zeros((6000, 1)), q.T, np.zeros((6000, 0)))


def test_the_place_of_a_law_comes_first():
    between = 3.0 * (X - Y) ** 3
    maps = force_maps(two(), motion([between, -between]))
    assert maps[0].name == "x - y"
    assert maps[0].follows > 0.94
    assert maps[0].size == pytest.approx(np.sqrt(np.mean(between**2)))
    assert max(m.follows for m in maps[1:]) < 0.8
    law = maps[0].surface["force"].mean("velocity")
    known = law.notnull()
    wanted = 3.0 * law["displacement"] ** 3
    np.testing.assert_allclose(law[known], wanted[known], atol=0.12 * float(wanted.max()))


def test_at_one_mass_only_its_own_map_tells():
    friction = 2.0 * np.sign(XV)
    maps = force_maps(two(), motion([friction, 0 * X]))
    assert maps[0].name == "x"
    assert "y" not in [m.name for m in maps]  # nothing is missing there
    assert maps[0].unit == "N"


def test_noise_is_mapped_too_and_follows_from_nothing():
    noise = RANDOM.standard_normal((2, 6000))
    maps = force_maps(two(joined=False), motion(noise))
    assert [m.name for m in maps] != []
    assert all(m.follows < 0.05 for m in maps)
    assert maps[0].size == pytest.approx(1.0, rel=0.05)


def test_a_motion_that_could_not_be_followed_has_no_map():
    assert force_maps(two(), motion([np.full(6000, np.nan), 0 * X])) == ()


def test_half_of_the_power_of_a_law_under_noise_is_foretold():
    law = np.sign(XV)
    share = predictable_share(X, XV, law + RANDOM.standard_normal(6000))
    assert share == pytest.approx(0.5, abs=0.06)
    assert predictable_share(X, XV, 0 * X) == 0.0
    assert MAPS.tells < 0.5
