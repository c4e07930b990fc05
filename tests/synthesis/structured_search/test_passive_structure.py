"""Springs and dampers: places read off a machine, signs, units, bounds."""

import numpy as np
import pytest

from robustpolish.base.budget import Budget
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.polishing.air_bearing import air_bearing
from robustpolish.synthesis.problem.scaling import decoupled_parts, whole_plant
from robustpolish.synthesis.structured.search import POLICY, PartDesign
from robustpolish.synthesis.structured.structures import Mechanics, PassiveStructure

# Two masses of 2 kg and 0.5 kg on springs to the ground, in q and p, with a force on each.
MASSES, STIFFNESS = np.diag([2.0, 0.5]), np.diag([8.0, 3.0])


def machine():
    none, eye = np.zeros((2, 2)), np.eye(2)
    forces = np.vstack([none, np.linalg.inv(MASSES)])
    A = np.block([[none, eye], [-np.linalg.solve(MASSES, STIFFNESS), -0.1 * eye]])
    return GeneralizedPlant.from_matrices(
        A,
        forces[:, :1],
        forces,
        [[1.0, 0, 0, 0]],
        np.eye(4),
        states=["q", "p", "dq", "dp"],
        controls=["F_q", "F_p"],
    )


def passive(wanted, limits=None):
    limits = np.full(len(wanted), np.inf) if limits is None else np.array(limits)
    return PassiveStructure("hinf", Mechanics.of(machine()), wanted, limits)


def test_places_are_displacements_with_a_velocity_and_a_force():
    found = Mechanics.of(machine())
    assert dict(found.velocity) == {"q": 2, "p": 3}
    assert dict(found.force) == {"q": 0, "p": 1}
    bearing = Mechanics.of(air_bearing(actuation="force"))
    assert set(bearing.force) == {"x_m", "x", "y_m", "y", "z_m", "z"}
    # Where the ground is moved, a control pulls at a spring and is no force on one mass alone.
    assert dict(Mechanics.of(air_bearing(actuation="displacement")).force) == {}


def test_elements_pull_both_places_towards_each_other():
    found = Mechanics.of(machine())
    assert found.gain("spring", ("q", "p")).tolist() == [[-1, 1, 0, 0], [1, -1, 0, 0]]
    assert found.gain("damper", ("ground", "p")).tolist() == [[0, 0, 0, 0], [0, 0, 0, -1]]
    # A spring of 5 N/m between the masses is one in the stiffness matrix.
    K = STIFFNESS + 5.0 * np.array([[1, -1], [-1, 1]])
    closed = machine().A + machine().B2 @ (5.0 * found.gain("spring", ("p", "q")))
    assert closed[2:, :2] == pytest.approx(-np.linalg.solve(MASSES, K))
    assert closed[2:, 2:] == pytest.approx(machine().A[2:, 2:])


def test_units_follow_from_those_of_force_and_displacement():
    found = Mechanics.of(machine())
    assert found.unit("spring", ("q", "ground")) == "N/m"
    assert found.unit("damper", ("ground", "p")) == "N s/m"


def test_coefficients_stay_between_nothing_and_their_limit():
    structure = passive([("spring", ("q", "ground")), ("damper", ("p", "q"))], [4.0, np.inf])
    problem = structure.problem(whole_plant(machine()))
    assert problem is not None
    assert problem.bounds is not None
    bottom, top = problem.bounds
    assert problem.open_ended is not None
    assert problem.open_ended.tolist() == [False, True]
    K = problem.controller(problem.parametrisation.gain(top))
    F = np.asarray(K.D)
    # 4 N/m at most between q and the ground, and a hard damper.
    assert F[0, 0] == pytest.approx(-4.0)
    assert F[0, 2] == pytest.approx(-F[0, 3])
    assert F[1, 2] > 1e2
    rng = np.random.default_rng(0)
    levels = list(problem.starts[0].propose((), Budget(), rng))
    assert levels[-2:] == [pytest.approx(top), pytest.approx(bottom)]
    assert top[1] == POLICY.highest
    assert np.exp(bottom) == pytest.approx(POLICY.nothing)


def test_a_part_without_elements_is_left_alone():
    structure = passive([("spring", ("q", "ground"))])
    assert structure.joined.tolist() == [[True, False, False, False], [False] * 4]
    first, second = decoupled_parts(machine(), structure.joined)[:2]
    assert first.states == (0, 2)
    assert structure.problem(first) is not None
    assert structure.problem(second) is None
    # A damper between them makes one part of both.
    joined = passive([("damper", ("q", "p"))]).joined
    assert decoupled_parts(machine(), joined)[0].states == (0, 1, 2, 3)


def test_what_is_next_to_nothing_is_nothing_in_the_end():
    structure = passive([("spring", ("q", "p")), ("damper", ("p", "ground"))])
    part = whole_plant(machine())
    problem = structure.problem(part)
    assert problem is not None
    point = np.array([np.log(POLICY.nothing), 0.5])
    K = problem.controller(problem.parametrisation.gain(point))
    design = PartDesign(problem.scaled, K, point, 1.0, "agreed", 1, 1, False, ())
    whole, told = structure.join(machine(), [part], [design])
    spring, damper = told["elements"]
    assert spring.coefficient == 0.0
    expected = -damper.coefficient * np.outer([0, 1], [0, 0, 0, 1])
    assert np.asarray(whole.D) == pytest.approx(expected, rel=1e-12)
    assert np.asarray(whole.D)[1, 3] == pytest.approx(np.asarray(K.D)[1, 3], rel=1e-6)
    assert damper.unit == "N s/m"
