import control
import numpy as np
import pytest
from uncertain_plants import lag, two_masses

import robustpolish as rp
from robustpolish.synthesis.uncertain.scenarios import UncertainSamples


def scattered():
    """Three numbers, of which two are directions of an ellipsoid."""
    fit = rp.uncertain.ellipsoid({"k": 10.0, "c": 1.0}, [[2.0, 0.0], [0.1, 0.1]])
    b = rp.uncertain.real("b", 1.0, range=(0.5, 2.0))
    return rp.uncertain.system([[0, 1], [-fit["k"], -fit["c"]]], [[0, 0], [1, b]], [[1, 0], [1, 0]])


def test_a_machine_is_the_system_at_its_values():
    machines = UncertainSamples(two_masses(), 1, 1)
    assert np.array_equal(machines.at({"k": 0.9}).A, two_masses().at({"k": 0.9}).A)
    assert np.array_equal(machines.nominal.A, two_masses().nominal.A)


def test_what_is_not_named_is_nominal_and_complex_numbers_become_systems():
    a, b = rp.uncertain.complex("a", 1.0, radius=0.3), rp.uncertain.real("b", 1.0, percent=20)
    plant = rp.uncertain.system([[-1.0]], [[1, b]], [[1.0], [a]], 0)
    machines = UncertainSamples(plant, 1, 1)
    assert machines.at({"b": 1.2}).C2[0, 0] == pytest.approx(1.0)
    there = machines.at({"a": 1 + 0.3j}, omega=2.0)
    assert there.system(2j)[1, 0] == pytest.approx((1 + 0.3j) / (1 + 2j))


def test_corners_are_the_ends_of_numbers_and_on_the_surface_of_ellipsoids():
    assert UncertainSamples(two_masses(0.5, 2.0), 1, 1).corners() == [{"k": 0.5}, {"k": 2.0}]
    machines = UncertainSamples(scattered(), 1, 1)
    corners = machines.corners()
    assert len(corners) == 8
    for corner in corners:
        directions = [v for name, v in corner.items() if name != "b"]
        assert np.linalg.norm(directions) == pytest.approx(1)
        assert corner["b"] in (0.5, 2.0)


def test_of_many_numbers_some_corners_are_drawn_always_the_same():
    numbers = [rp.uncertain.real(f"k{i}", 1.0, percent=10) for i in range(9)]
    plant = rp.uncertain.system([[-sum(numbers)]], [[1, 1]], [[1.0], [1.0]], 0)
    corners = UncertainSamples(plant, 1, 1).corners()
    assert len(corners) == 128
    assert corners == UncertainSamples(plant, 1, 1).corners()


def test_a_witness_moves_outward_to_the_bounds():
    machines = UncertainSamples(scattered(), 1, 1)
    names = [e.name for e in machines.numbers if e.group]
    far = machines.moved_to_bounds({names[0]: 0.3, names[1]: -0.4, "b": 1.0})
    assert np.hypot(far[names[0]], far[names[1]]) == pytest.approx(1)
    assert far[names[0]] / far[names[1]] == pytest.approx(-0.75)
    assert UncertainSamples(lag(), 1, 1).moved_to_bounds({"b": 1.1}) == {"b": pytest.approx(1.2)}
    assert UncertainSamples(lag(), 1, 1).moved_to_bounds({"b": 1.0}) == {"b": 1.0}


def test_a_machine_that_is_not_well_posed_is_none():
    b = rp.uncertain.real("b", 0.5, range=(0.0, 1.0))
    plant = rp.uncertain.system([[-1.0]], [[1, 1]], [[1.0], [1.0]], 0)
    machines = UncertainSamples(
        plant * rp.uncertain.append(1 / (1 - b), control.ss([], [], [], 1)), 1, 1
    )
    assert machines.at({"b": 1.0}) is None
